"""Frames of a drive log: order, poses, GPS emulation, windows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scpf.ingest import messages
from scpf.ingest.drive_log import DriveLog, DriveLogWriter
from scpf.ingest.topics import IMAGE_TOPIC
from scpf.models.errors import InputError, MissingError
from scpf.replay.frames import (
    BACKWARDS,
    GAP,
    UNREADABLE,
    Window,
    decode,
    expected_frames,
    first_state,
    pictures,
    read_frames,
)
from scpf.replay.settings import GpsSettings
from scpf.replay.step import Frame

PERIOD_NS = 77_000_000


def jpeg(value: int) -> bytes:
    import cv2

    return bytes(cv2.imencode(".jpg", np.full((24, 32, 3), value, np.uint8))[1])


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    """Ten frames at 10 m/s along x, every second one with a reference pose (off by half a period)."""
    path = tmp_path / "drive.mcap"
    with DriveLogWriter(path) as log:
        for k in range(10):
            log.write_image(k * PERIOD_NS + 1_000_000_000, jpeg(20 * k), "jpeg")
        for k in range(-1, 12):
            pose = np.eye(4)
            pose[0, 3] = 10.0 * (k * PERIOD_NS + PERIOD_NS // 2) * 1e-9
            log.write_pose(k * PERIOD_NS + 1_000_000_000 + PERIOD_NS // 2, pose)
    return path


def frames(path: Path, gps: GpsSettings, window: Window | None = None, seed: int = 0) -> list[Frame]:
    with DriveLog(path) as log:
        return list(
            read_frames(log, log.trajectory(), gps, seed, window or Window(), recorded=False, pixels=True)
        )


def test_poses_are_interpolated_to_the_exposure(drive: Path) -> None:
    for k, frame in enumerate(frames(drive, GpsSettings("none"))):
        assert frame.index == k
        assert frame.dt_s == pytest.approx(0.077 if k else 0.0)
        assert frame.T_map_body is not None
        assert frame.T_map_body[0, 3] == pytest.approx(0.77 * k, abs=1e-6)
        assert frame.gps_m is None
        assert frame.image is not None
        assert frame.image.shape == (24, 32, 3)
        assert abs(int(frame.image[0, 0, 0]) - 20 * k) <= 2


def test_emulated_gps_has_its_sigma_and_does_not_depend_on_the_window(drive: Path) -> None:
    whole = frames(drive, GpsSettings("emulated", 3.0), seed=7)
    part = frames(drive, GpsSettings("emulated", 3.0), Window(0.3), seed=7)
    assert [frame.index for frame in part] == [4, 5, 6, 7, 8, 9]
    for frame in part:
        np.testing.assert_array_equal(frame.gps_m, whole[frame.index].gps_m)
    other = frames(drive, GpsSettings("emulated", 3.0), seed=8)
    assert not np.array_equal(other[0].gps_m, whole[0].gps_m)
    noise = np.concatenate(
        [
            f.gps_m - f.T_map_body[:2, 3]
            for s in range(40)
            for f in frames(drive, GpsSettings("auto", 3.0), seed=s)
        ]
    )
    assert noise.std() == pytest.approx(3.0, rel=0.1)


def test_the_window_ends_before_its_stop(drive: Path) -> None:
    assert [frame.index for frame in frames(drive, GpsSettings("none"), Window(0.1, 0.4))] == [2, 3, 4, 5]


def test_the_first_state_is_the_reference_s_with_its_velocity(drive: Path) -> None:
    with DriveLog(drive) as log:
        frame = next(
            read_frames(
                log, log.trajectory(), GpsSettings("none"), 0, Window(0.35), recorded=False, pixels=False
            )
        )
        np.testing.assert_allclose(first_state(frame, log.trajectory()), [3.85, 0.0, 10.0, 0.0], atol=1e-6)


def test_what_is_missing_is_said(tmp_path: Path) -> None:
    path = tmp_path / "blind.mcap"
    with DriveLogWriter(path) as log:
        log.write_image(5, jpeg(9), "jpeg")
    with pytest.raises(MissingError, match="GPS"):
        frames(path, GpsSettings("log"))
    with pytest.raises(MissingError, match="reference"):
        frames(path, GpsSettings("emulated"))
    assert first_state(frames(path, GpsSettings("auto"))[0], None) is None


@pytest.mark.parametrize("data", [b"", b"no picture", jpeg(3)[:40]])
def test_damaged_images_are_named(data: bytes) -> None:
    with pytest.raises(InputError, match="frame 3"):
        decode(data, "drive.mcap: frame 3")


def test_what_is_wrong_with_a_frame_is_said_and_the_rest_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "bumpy.mcap"
    with DriveLogWriter(path) as log:
        for log_s, stamp_s, data in (
            (1.0, 1.0, jpeg(9)),
            (1.1, 1.1, b"broken"),
            (1.2, 0.9, jpeg(9)),
            (7.0, 7.0, jpeg(9)),
        ):
            header = messages.to_header(round(stamp_s * 1e9), "camera")
            pixels = np.frombuffer(data, dtype=np.uint8)
            image = messages.make(
                "sensor_msgs/msg/CompressedImage", header=header, format="jpeg", data=pixels
            )
            log.write_message(IMAGE_TOPIC, "sensor_msgs/msg/CompressedImage", image, round(log_s * 1e9))
    found = frames(path, GpsSettings("none"))
    assert [[kind for kind, _ in frame.problems] for frame in found] == [[], [UNREADABLE], [BACKWARDS], [GAP]]
    assert [frame.image is None for frame in found] == [False, True, False, False]
    np.testing.assert_allclose([frame.dt_s for frame in found], [0.0, 0.1, 0.0, 5.9])


def test_frames_are_thinned_to_a_rate_without_drift(drive: Path) -> None:
    def indices(rate_hz: float) -> list[int]:
        return [frame.index for frame in frames(drive, GpsSettings("none"), Window(rate_hz=rate_hz))]

    everything = indices(float("inf"))
    assert indices(1000.0) == everything
    stamps = {frame.index: frame.stamp_ns for frame in frames(drive, GpsSettings("none"))}
    kept = indices(5.0)
    assert kept[0] == everything[0]
    assert np.diff([stamps[k] for k in kept]) == pytest.approx(0.2e9, abs=0.06e9)


def test_an_outage_takes_the_fixes_and_nothing_else(drive: Path) -> None:
    whole = frames(drive, GpsSettings("emulated", 3.0))
    cut = frames(drive, GpsSettings("emulated", 3.0, ((0.15, 0.35),)))
    assert [f.index for f in whole] == [f.index for f in cut]
    first_ns = whole[0].stamp_ns
    for before, after in zip(whole, cut, strict=True):
        if 0.15 <= (before.stamp_ns - first_ns) * 1e-9 < 0.35:
            assert after.gps_m is None
        else:
            np.testing.assert_array_equal(before.gps_m, after.gps_m)
    assert any(f.gps_m is None for f in cut)


@pytest.mark.parametrize("window", [Window(), Window(0.1, 0.6), Window(start_s=0.3), Window(rate_hz=5.0)])
def test_how_many_frames_are_expected_is_told_before_they_are_read(drive: Path, window: Window) -> None:
    with DriveLog(drive) as log:
        found = sum(1 for _ in pictures(log, window))
        assert expected_frames(log, window) == pytest.approx(found, abs=2) and found > 2
