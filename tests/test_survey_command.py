"""``scpf map survey``: a wrong map put right by a drive log, and what is said when it cannot be."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from distance_logs import FEET, LENS, QUICK, START_NS, write_log
from pole_scenes import pose, road_map

from scpf.ingest.drive_log import DriveLog, DriveLogWriter
from scpf.ingest.maps import read_map, write_map
from scpf.models.errors import InputError, MissingError, UsageError
from scpf.models.geodesy import Origin
from scpf.replay.cli import run
from scpf.replay.distance_training import gather, train
from scpf.replay.survey_command import map_survey
from scpf.replay.survey_sights import CUT, NO_DISTANCE, NO_POSE, read_sights


@pytest.fixture(scope="module")
def log_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_log(tmp_path_factory.mktemp("log") / "drive.mcap")


@pytest.fixture(scope="module")
def model_path(log_path: Path) -> Path:
    path = log_path.with_name("distance.npz")
    train(gather([log_path], "recorded", every=2), QUICK, 0).save(path)
    return path


@pytest.fixture(scope="module")
def wrong_map(log_path: Path) -> Path:
    """The poles of the log, each 1 to 1.5 m off."""
    rng = np.random.default_rng(3)
    off, turn = rng.uniform(1.0, 1.5, len(FEET)), rng.uniform(0.0, 2 * np.pi, len(FEET))
    mapped = np.array(FEET) + off[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    path = log_path.with_name("wrong.geojson")
    write_map(path, road_map(*[(float(x), float(y)) for x, y in mapped]))
    return path


def test_the_command_puts_a_wrong_map_right(
    log_path: Path, model_path: Path, wrong_map: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "surveyed.geojson"
    call = ["map", "survey", str(log_path), "--map", str(wrong_map), "--segmenter", "recorded"]
    call += ["--distance-model", str(model_path), "-o", str(output)]
    assert run(call) == 0
    shown = capsys.readouterr()
    assert shown.err == ""
    assert "P3 " in shown.out
    assert "3  " in shown.out.splitlines()[1] and "kept: too few sightings" in shown.out.splitlines()[1]
    assert f"{output}: 13 of 14 landmarks surveyed" in shown.out
    surveyed = read_map(output)
    off = np.hypot(*(surveyed.positions_m - np.array(FEET)).T)
    assert off[0] == pytest.approx(np.hypot(*(read_map(wrong_map).positions_m[0] - np.array(FEET[0]))))
    assert off[1:].mean() < 0.15
    assert off[1:].max() < 0.5
    assert all(0.0 < mark.variance_m2 < 0.25 for mark in surveyed.landmarks[1:])

    with pytest.raises(InputError, match="exists"):
        map_survey((log_path,), output=output)
    assert run([*call, "--overwrite", "--every", "10", "--format", "json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["frames"] == 15
    assert [row["id"] for row in figures["landmarks"]] == [f"P{k}" for k in range(14)]
    assert any(row["reason"] for row in figures["landmarks"])
    assert (
        sum(row["sightings"] + row["rejected"] for row in figures["landmarks"])
        + figures["unmatched"]
        + figures["doubtful"]
        == figures["sightings"]
    )


def test_two_drives_know_more_than_one(log_path: Path, model_path: Path, wrong_map: Path) -> None:
    start = read_map(wrong_map)
    once = read_sights([log_path], "recorded", 0.9, str(model_path), 1, start)
    twice = read_sights([log_path, log_path], "recorded", 0.9, str(model_path), 1, start)
    assert len(twice.sights) == 2 * len(once.sights) > 500
    assert twice.frames == 2 * once.frames
    assert (np.diff(twice.sights.times_s) >= 0.0).all()
    # The camera is ahead of the body: directions are taken from where it is.
    assert np.hypot(*(once.sights.seen_from_m - once.sights.ranged_from_m).T) == pytest.approx(1.9)


def test_what_cannot_be_used_is_counted(log_path: Path, model_path: Path, tmp_path: Path) -> None:
    with DriveLog(log_path) as log:
        found, mapped = log.instances(), log.road_map()
    assert mapped is not None
    seen = found[START_NS][0]
    at_side = replace(seen, box_px=(0.0, *seen.box_px[1:]), offset_px=(0, seen.offset_px[1]))
    path = tmp_path / "odd.mcap"
    with DriveLogWriter(path) as writer:
        writer.write_camera(START_NS, LENS)
        writer.write_pose(START_NS, pose())
        writer.write_instances(START_NS, [seen, at_side, replace(seen, landmark_class="tree")])
        writer.write_instances(START_NS + 10**9, [seen])
    sights = read_sights([path], "recorded", 0.9, str(model_path), 1, mapped)
    assert len(sights.sights) == 1
    assert sights.dropped.keys() >= {NO_DISTANCE, NO_POSE}
    assert sum(sights.dropped.values()) == 3
    assert sights.dropped.keys() <= {
        NO_DISTANCE,
        NO_POSE,
        CUT,
        "outside the training range of the distance model",
    }


def test_logs_that_do_not_fit_are_refused(
    log_path: Path, model_path: Path, wrong_map: Path, tmp_path: Path
) -> None:
    output = tmp_path / "m.geojson"
    with pytest.raises(MissingError, match="calibration"):
        map_survey((write_log(tmp_path / "bare.mcap", frames=2, parts=False),), output=output)
    elsewhere = tmp_path / "elsewhere.geojson"
    write_map(elsewhere, replace(road_map(*FEET), origin=Origin(43.0, -80.0, 300.0)))
    with pytest.raises(InputError, match="origin"):
        map_survey((log_path,), output=output, road_map=elsewhere, distance_model=str(model_path))
    blind = tmp_path / "blind.mcap"
    with DriveLogWriter(blind) as writer:
        writer.write_camera(START_NS, LENS)
        writer.write_pose(START_NS, pose())
        writer.write_instances(START_NS, [])
    more = {"segmenter": "recorded", "distance_model": str(model_path), "road_map": wrong_map}
    with pytest.raises(InputError, match="nothing to survey in 1 frames"):
        map_survey((blind,), output=output, **more)  # type: ignore[arg-type]
    for wrong in ({"every": 0}, {"fewest": 0}, {"map_sigma_m": 0.0}, {"bearing_sigma_deg": float("nan")}):
        with pytest.raises(UsageError):
            map_survey((log_path,), output=output, **wrong)  # type: ignore[arg-type]
    assert not output.exists()
