"""One drive, replayed from the log that the simulator wrote, from its raw files, and from a converted bag."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from scpf.replay.cli import run

OPTIONS = ["--gps", "emulated", "--threshold", "0.3", "-q"]
"""The raw files have no rough GPS; in small pictures the network is sure of few poles."""


def replay(log: Path) -> dict[str, Any]:
    assert run(["replay", str(log), "-o", str(log.parent), "--name", log.stem, *OPTIONS]) == 0
    return dict(json.loads((log.parent / f"{log.stem}.json").read_text()))


@pytest.fixture(scope="module")
def raw(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The raw files of a drive of one second; the log that was written with them lies beside the folder."""
    folder = tmp_path_factory.mktemp("drive")
    command = ["simulate", "-o", str(folder / "direct.mcap"), "--start-m", "300", "--duration", "1"]
    command += [
        "--seed",
        "3",
        "--weather",
        "cloudy",
        "--width",
        "384",
        "--map-error",
        "0.3",
        "--workers",
        "1",
    ]
    assert run([*command, "--raw", str(folder / "raw"), "-q"]) == 0
    return folder / "raw"


@pytest.fixture(scope="module")
def direct(raw: Path) -> dict[str, Any]:
    return replay(raw.parent / "direct.mcap")


def test_ingested_raw_files_give_the_same_results(raw: Path, tmp_path: Path, direct: dict[str, Any]) -> None:
    log = tmp_path / "raw.mcap"
    command = ["ingest", str(raw / "basler"), "-o", str(log), "-q", "--trajectory", str(raw / "lvx.gsof")]
    command += ["--calibration", str(raw / "camera.yaml"), "--map", str(raw / "map.geojson")]
    assert run([*command, "--timestamps", str(raw / "basler_times.csv")]) == 0
    found = replay(log)
    assert found["detections"] == direct["detections"] and found["detections"]["total"] > 10
    assert found["states"] == direct["states"]
    for name, expected in direct["errors"].items():
        assert found["errors"][name]["mean"] == pytest.approx(expected["mean"], abs=1e-3), name


def test_a_converted_bag_differs_by_its_rectified_pictures_alone(
    raw: Path, tmp_path: Path, direct: dict[str, Any]
) -> None:
    log = tmp_path / "bag.mcap"
    command = ["convert", str(raw / "drive.bag"), "-o", str(log), "--map", str(raw / "map.geojson"), "-q"]
    assert run(command) == 0
    found = replay(log)
    assert found["frames"] == direct["frames"]
    assert found["detections"]["total"] == pytest.approx(direct["detections"]["total"], rel=0.25)
    baseline, expected = found["errors"]["baseline_position"], direct["errors"]["baseline_position"]
    assert baseline["mean"] == pytest.approx(expected["mean"], abs=1e-3)
    assert found["errors"]["position"]["mean"] == pytest.approx(direct["errors"]["position"]["mean"], abs=0.6)
