"""A replay that starts in the middle knows what was said once, at the beginning."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scpf.ingest import messages
from scpf.ingest.drive_log import (
    CAMERA_INFO_TOPIC,
    IMAGE_TOPIC,
    TF_STATIC_TOPIC,
    DriveLog,
    DriveLogWriter,
)
from scpf.models.camera import Camera, looking_ahead

T0 = 1_660_847_613_000_000_000
MATRIX = np.array([[700.0, 0, 320], [0, 700, 240], [0, 0, 1]])


def transform(stamp_ns: int, child: str, x: float) -> object:
    pose = np.eye(4)
    pose[0, 3] = x
    item = messages.make(
        "geometry_msgs/msg/TransformStamped",
        header=messages.to_header(stamp_ns, "base_link"),
        child_frame_id=child,
        transform=messages.to_transform(pose),
    )
    return messages.make("tf2_msgs/msg/TFMessage", transforms=[item])


@pytest.fixture
def log_path(tmp_path: Path) -> Path:
    path = tmp_path / "drive.mcap"
    mount = looking_ahead()
    mount[:3, 3] = 1.5, 0.0, 1.2
    with DriveLogWriter(path) as log:
        log.write_camera(T0, Camera(640, 480, MATRIX, T_body_camera=mount))
        for k, (child, x) in enumerate([("lidar", 1.0), ("antenna", 2.0), ("lidar", 3.0)]):
            stamp_ns = T0 + 1 + k
            log.write_message(
                TF_STATIC_TOPIC, "tf2_msgs/msg/TFMessage", transform(stamp_ns, child, x), stamp_ns
            )
        for k in range(20):
            log.write_image(T0 + k * 10**8, b"x", "jpeg")
        log.attach("map.geojson", "application/geo+json", b'{"type": "FeatureCollection", "features": []}')
    return path


def test_what_was_latched_comes_first(log_path: Path) -> None:
    with DriveLog(log_path) as log:
        start_ns = T0 + 10**9
        found = list(log.messages(None, start_ns, latched=True))
        early = [record for record in found if record.stamp_ns < start_ns]
        assert found[: len(early)] == early
        assert [(record.topic, record.stamp_ns - T0) for record in early] == [
            (CAMERA_INFO_TOPIC, 0), (TF_STATIC_TOPIC, 0), (TF_STATIC_TOPIC, 2), (TF_STATIC_TOPIC, 3),
        ]  # fmt: skip
        assert [record.topic for record in found[len(early) :]] == [IMAGE_TOPIC] * 10
        assert [m.stamp_ns for m in log.messages(None, start_ns)] == [T0 + k * 10**8 for k in range(10, 20)]
        assert all(m.stamp_ns >= start_ns for m in log.messages([IMAGE_TOPIC], start_ns, latched=True))
        assert len(list(log.messages(None, latched=True))) == len(list(log.messages()))


def test_camera_and_map_do_not_depend_on_the_start(log_path: Path) -> None:
    with DriveLog(log_path) as log:
        for image in log.images(T0 + 15 * 10**8):
            assert image.stamp_ns >= T0 + 15 * 10**8
            camera, road_map = log.camera(), log.road_map()
            assert camera is not None
            np.testing.assert_allclose(camera.T_body_camera[:3, 3], [1.5, 0.0, 1.2])
            assert road_map is not None


@pytest.mark.parametrize(
    ("profiles", "held"),
    [
        ("- durability: transient_local", 1),
        ("- {durability: 1, depth: 1}", 1),
        ("- durability: 2", 0),
        ("", 0),
    ],
)
def test_the_quality_of_service_says_what_is_latched(tmp_path: Path, profiles: str, held: int) -> None:
    with DriveLogWriter(tmp_path / "a.mcap") as log:
        channel = log.mcap.add_channel(
            "/robot", "std_msgs/msg/Int32", b"int32 data\n", metadata={"offered_qos_profiles": profiles}
        )
        for stamp_ns in (1, 2):
            log.mcap.add_message(channel, stamp_ns, b"\0\1\0\0\1\0\0\0", stamp_ns, 0)
    with DriveLog(tmp_path / "a.mcap") as opened:
        assert [m.stamp_ns for m in opened.messages(None, 5, latched=True)] == [2] * held
