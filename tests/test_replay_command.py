"""``scpf replay`` as typed: several logs, refused options, what the results say of themselves."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

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


@pytest.mark.parametrize(
    "options",
    [
        [str(SAMPLE), str(SAMPLE)],
        [str(SAMPLE), "other.mcap", "--name", "both"],
        [str(SAMPLE), "--gps-outage", "30:20"],
        [str(SAMPLE), "--gps-outage", "soon"],
        [str(SAMPLE), "--rate", "0"],
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
