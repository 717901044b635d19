"""``scpf label``: suggested masks come back as labels to train on, and corrected ones are not overwritten."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from scpf.ingest.drive_log import DriveLogWriter
from scpf.ingest.labelled_folders import labelled_images
from scpf.models.instances import Instance
from scpf.replay.cli import run
from scpf.replay.label_command import _stretches
from scpf.sample_logs.street_scenes import scene

WIDTH, HEIGHT = 120, 90


def pole(k: int, score: float) -> Instance:
    mask = np.ones((60, 4), dtype=bool)
    return Instance((10.0 + k, 8.0, 14.0 + k, 68.0), mask, (10 + k, 8), score)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten frames, the fourth damaged; the pole moves by a pixel a frame, and is the most doubtful in frame 7."""
    path = tmp_path_factory.mktemp("log") / "drive.mcap"
    with DriveLogWriter(path) as log:
        for k in range(10):
            image = np.random.default_rng(k).integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8)
            data = cv2.imencode(".jpg", image)[1].tobytes()
            log.write_image(1_000 + k, data if k != 3 else data[:5], "jpeg")
            log.write_instances(1_000 + k, [pole(k, 0.55 if k == 7 else 0.95), pole(60, 0.2)])
    return path


def test_masks_come_back_as_labels(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "labels"
    command = ["label", str(log), "-o", str(folder), "--segmenter", "recorded"]
    assert run([*command, "--count", "2", "--format", "json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary == {"folder": str(folder), "frames": 2, "masks": 2, "unreadable": 0}
    images = labelled_images(folder)
    assert [image.path.name for image in images] == ["drive_000002.jpg", "drive_000007.jpg"]
    for image, k in zip(images, (2, 7), strict=True):
        (labelled,) = image.read().objects
        assert labelled.instance.box_px == pole(k, 1).box_px
        assert labelled.instance.mask.all()

    corrected = folder / "drive_000002.json"
    corrected.write_text(corrected.read_text().replace("light_pole", "tree"))
    assert run([*command, "--frame", "2"]) == 1
    assert "corrected already" in capsys.readouterr().err
    assert "tree" in corrected.read_text()
    assert run([*command, "--frame", "2", "--overwrite"]) == 0
    assert "tree" not in corrected.read_text()


def test_the_most_doubtful_frame_of_a_stretch_is_taken(log: Path, tmp_path: Path) -> None:
    command = [
        "label",
        str(log),
        "-o",
        str(tmp_path),
        "--segmenter",
        "recorded",
        "--count",
        "2",
        "--doubtful",
        "-q",
    ]
    assert run(command) == 3  # frame 3 cannot be decoded
    assert "drive_000007.json" in [path.name for path in tmp_path.glob("*.json")]


def test_frames_that_are_not_there_are_wrong_usage(log: Path, tmp_path: Path) -> None:
    command = ["label", str(log), "-o", str(tmp_path), "--segmenter", "recorded"]
    assert run([*command, "--frame", "10"]) == 2
    assert run([*command, "--count", "0"]) == 2
    assert run([*command, "--frame", "3"]) == 3


def test_the_network_suggests(tmp_path: Path) -> None:
    image, _ = scene(900_009)
    with DriveLogWriter(tmp_path / "a.mcap") as log:
        log.write_image(1, cv2.imencode(".png", image)[1].tobytes(), "png")
    assert run(["label", str(tmp_path / "a.mcap"), "-o", str(tmp_path / "out")]) == 0
    (labelled,) = labelled_images(tmp_path / "out")
    assert labelled.path.name == "a_000000.png" and labelled.read().objects


def test_frames_are_spread_over_the_log() -> None:
    assert _stretches(100, (), 4, 1) == [[12], [37], [62], [87]]
    assert _stretches(3, (), 50, 5) == [[0], [1], [2]]
    assert [len(each) for each in _stretches(100, (), 4, 5)] == [5] * 4
    assert _stretches(10, (7, 2, 7), 4, 1) == [[2], [7]]
