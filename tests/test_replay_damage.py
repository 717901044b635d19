"""A replay of a log with something wrong in it: it goes on, counts what it met, and exits with 3."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scpf.ingest import messages
from scpf.ingest.drive_log import IMAGE_TOPIC, MAP_ATTACHMENT, DriveLog, DriveLogWriter, EncodedImage
from scpf.models.instances import Instance
from scpf.models.road_map import to_geojson
from scpf.replay.cli import run

SAMPLE = Path(__file__).parent.parent / "sample_logs" / "ring_road.mcap"
FRAMES = 12
IMAGE_TYPE = "sensor_msgs/msg/CompressedImage"
Change = Callable[[int, EncodedImage], EncodedImage]


def as_it_is(index: int, image: EncodedImage) -> EncodedImage:
    return image


def write(
    path: Path,
    change: Change = as_it_is,
    calibrated: bool = True,
    relabel: Callable[[int, Instance], Instance] = lambda index, instance: instance,
    sign: bool = False,
) -> Path:
    """The first frames of the sample drive, each image changed."""
    with DriveLog(SAMPLE) as sample, DriveLogWriter(path) as log:
        trajectory, camera, road_map = sample.trajectory(), sample.camera(), sample.road_map()
        assert trajectory is not None and camera is not None and road_map is not None
        masks = sample.instances()
        if sign:
            marks = road_map.landmarks
            road_map = replace(
                road_map, landmarks=(*marks, replace(marks[0], id="S1", landmark_class="stop_sign"))
            )
        log.attach(MAP_ATTACHMENT, "application/geo+json", json.dumps(to_geojson(road_map)).encode())
        for k, (image, _) in enumerate(zip(sample.images(), range(FRAMES), strict=False)):
            if calibrated and not k:
                log.write_camera(image.stamp_ns, camera)
            pose = trajectory.at(image.stamp_ns)
            changed = change(k, image)
            # The log's own clock runs on, whatever the camera's does.
            header = messages.to_header(changed.stamp_ns, "camera")
            pixels = np.frombuffer(changed.data, dtype=np.uint8)
            message = messages.make(IMAGE_TYPE, header=header, format=changed.format, data=pixels)
            log.write_message(IMAGE_TOPIC, IMAGE_TYPE, message, max(image.stamp_ns, changed.stamp_ns))
            if pose is not None:
                log.write_pose(changed.stamp_ns, pose)
            found = [relabel(k, one) for one in masks.get(image.stamp_ns, ())]
            log.write_instances(changed.stamp_ns, found)
    return path


def replayed(log: Path, capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, dict[str, Any], str]:
    """Exit code, summary and what stderr said; the recording is whole."""
    code = run(["replay", str(log), "-o", str(log.parent), "--format", "json", *options])
    captured = capsys.readouterr()
    viewer = Path(sys.executable).with_name("rerun")
    recording = log.with_suffix(".rrd")
    assert subprocess.run([viewer, "rrd", "verify", recording], capture_output=True).returncode == 0
    return code, json.loads(captured.out), captured.err


def test_the_untouched_frames_are_no_problem(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, summary, told = replayed(write(tmp_path / "d.mcap"), capsys, "--segmenter", "recorded")
    assert (code, summary["warnings"], told) == (0, [], "")


def test_a_corrupt_jpeg(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def corrupt(index: int, image: EncodedImage) -> EncodedImage:
        return image._replace(data=b"\xff\xd8" + bytes(300)) if index in (4, 7) else image

    code, summary, told = replayed(write(tmp_path / "d.mcap", corrupt), capsys)
    assert (code, summary["frames"]) == (3, FRAMES)
    assert summary["warnings"] == ["2 × image that cannot be decoded"]
    assert "2 × image that cannot be decoded" in told
    assert summary["notes"]["WARN"] == 2
    assert summary["poles_per_frame"]["0"] >= 2


def test_no_calibration(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = write(tmp_path / "d.mcap", calibrated=False)
    code, summary, told = replayed(log, capsys, "--segmenter", "recorded")
    assert code == 3 and "no calibration" in told
    assert summary["states"] == {"unconstrained": FRAMES}
    assert summary["errors"]["position"]["count"] == FRAMES


@pytest.mark.parametrize(
    ("shift_s", "said"), [(5.0, "1 × gap before the frame"), (-0.3, "3 × time goes back")]
)
def test_times_that_jump(
    shift_s: float, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def shifted(index: int, image: EncodedImage) -> EncodedImage:
        return image._replace(stamp_ns=image.stamp_ns + int(shift_s * 1e9) * (index >= 6))

    code, summary, _ = replayed(write(tmp_path / "d.mcap", shifted), capsys, "--segmenter", "recorded")
    assert (code, summary["frames"]) == (3, FRAMES)
    assert said in summary["warnings"]


def test_an_unknown_landmark_class(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    relabelled = 0

    def relabel(index: int, instance: Instance) -> Instance:
        nonlocal relabelled
        if index % 3:
            return instance
        relabelled += 1
        return replace(instance, landmark_class="stop_sign")

    log = write(tmp_path / "d.mcap", relabel=relabel, sign=True)
    code, summary, told = replayed(log, capsys, "--segmenter", "recorded")
    assert code == 3 and relabelled > 0
    assert f"{relabelled} × instance of unknown landmark class 'stop_sign'" in summary["warnings"]
    assert "the map has 1 landmarks of class 'stop_sign'" in told
    assert summary["detections"]["unmeasured"] == relabelled
