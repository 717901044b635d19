"""``scpf replay`` as typed: several logs, refused options, what the results say of themselves."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from scpf.ingest.drive_log import DriveLog, DriveLogWriter
from scpf.replay.cli import run

SAMPLE = Path(__file__).parent.parent / "sample_logs" / "ring_road.mcap"
QUICK = ["--segmenter", "recorded", "--stop", "0.8"]


def test_several_logs_each_leave_their_own_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = tmp_path / "other.mcap"
    shutil.copy(SAMPLE, other)
    out = tmp_path / "out"
    assert run(["replay", str(SAMPLE), str(other), "-o", str(out), *QUICK, "--format", "json"]) == 0
    summaries = json.loads(capsys.readouterr().out)
    assert [summary["log"] for summary in summaries] == ["ring_road.mcap", "other.mcap"]
    assert summaries[0]["errors"] == summaries[1]["errors"]
    assert sorted(path.name for path in out.iterdir()) == [
        f"{name}.{kind}" for name in ("other", "ring_road") for kind in ("json", "results.mcap", "rrd")
    ]


def test_rate_and_outage_reach_the_results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    thinned = ["--rate", "6.5", "--gps-outage", "0.2:0.5", "--gps-outage", "0.6:0.7", "--format", "json"]
    assert run(["replay", str(SAMPLE), "-o", str(tmp_path), *QUICK, *thinned]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["frames"] == 6
    assert summary["settings"]["gps"]["outages_s"] == [[0.2, 0.5], [0.6, 0.7]]
    assert summary["window"] == {"start_s": 0.0, "stop_s": 0.8, "rate_hz": 6.5}
    assert summary["rate"]["frames_per_s"] > 0


def test_no_gps_is_no_gps(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["replay", "--no-gps", "--show-config"]) == 0
    assert tomllib.loads(capsys.readouterr().out)["gps"]["source"] == "none"


@pytest.mark.parametrize(
    "options",
    [
        [str(SAMPLE), str(SAMPLE)],
        [str(SAMPLE), "other.mcap", "--name", "both"],
        [str(SAMPLE), "--gps-outage", "30:20"],
        [str(SAMPLE), "--gps-outage", "soon"],
        [str(SAMPLE), "--rate", "0"],
        [str(SAMPLE), "--stop", "3", "--duration", "2"],
        [str(SAMPLE), "--duration", "0"],
        [str(SAMPLE), "--start", "3", "--stop", "3"],
        [str(SAMPLE), "--loop", "0"],
        [str(SAMPLE), "--gps", "log", "--no-gps"],
    ],
    ids=" ".join,
)
def test_what_makes_no_sense_is_refused_before_anything_is_written(
    options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert run(["replay", *options, "-o", str(out)]) == 2
    assert capsys.readouterr().err.startswith("scpf: ")
    assert not out.exists()


def test_a_duration_counts_from_the_start_and_each_pass_has_the_next_seed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stretch = ["--segmenter", "recorded", "--start", "2", "--duration", "0.6", "--seed", "5"]
    assert run(["replay", str(SAMPLE), "-o", str(tmp_path), *stretch, "--loop", "2", "--format", "json"]) == 0
    first, second = json.loads(capsys.readouterr().out)
    assert first["window"]["start_s"] == 2.0 and first["window"]["stop_s"] == pytest.approx(2.6)
    assert first["frames"] == second["frames"] == 8
    assert (first["settings"]["seed"], second["settings"]["seed"]) == (5, 6)
    assert first["errors"]["position"]["mean"] != second["errors"]["position"]["mean"]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        f"ring_road{number}.{kind}" for number in ("", ".2") for kind in ("json", "results.mcap", "rrd")
    )
    alone = ["--seed", "6", "--name", "alone", "--format", "json"]
    assert run(["replay", str(SAMPLE), "-o", str(tmp_path), *stretch[:-2], *alone]) == 0
    assert json.loads(capsys.readouterr().out)["errors"] == second["errors"]


def test_images_alone_are_replayed_as_far_as_they_go(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "images.mcap"
    with DriveLog(SAMPLE) as sample, DriveLogWriter(log) as bare:
        for image, _ in zip(sample.images(), range(5), strict=False):
            bare.write_image(image.stamp_ns, image.data, image.format)
    assert run(["replay", str(log), "-o", str(tmp_path), "--format", "json"]) == 3
    captured = capsys.readouterr()
    summary = json.loads(captured.out)
    assert (summary["frames"], summary["states"], summary["errors"]) == (5, {"initialising": 5}, {})
    assert summary["detections"]["unmeasured"] == summary["detections"]["total"] > 0
    for missing in ("calibration", "map", "reference", "says where the drive begins"):
        assert missing in captured.err
    viewer = Path(sys.executable).with_name("rerun")
    assert subprocess.run([viewer, "rrd", "verify", tmp_path / "images.rrd"], check=False).returncode == 0


def test_a_drive_begins_with_its_first_fix(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "late.mcap"
    with DriveLog(SAMPLE) as sample, DriveLogWriter(log) as late:
        trajectory = sample.trajectory()
        assert trajectory is not None
        for k, (image, _) in enumerate(zip(sample.images(), range(8), strict=False)):
            late.write_image(image.stamp_ns, image.data, image.format)
            pose = trajectory.at(image.stamp_ns)
            if k >= 3 and pose is not None:
                late.write_gps(image.stamp_ns, pose[:2, 3], 1.0)
    assert run(["replay", str(log), "-o", str(tmp_path), *QUICK[:2], "--format", "json"]) == 3
    captured = capsys.readouterr()
    assert json.loads(captured.out)["states"] == {"unconstrained": 5, "initialising": 3}
    assert "3 × frame before" in captured.err
