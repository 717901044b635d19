"""The drive log: what is written is read."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from small_logs import ORIGIN, STEP, T0, a_camera, a_pose, image, write

from scpf.ingest.drive_log import (
    GPS_POSE_TOPIC,
    IMAGE_TOPIC,
    INS_POSE_TOPIC,
    MAP_ATTACHMENT,
    DriveLog,
    DriveLogWriter,
)
from scpf.ingest.gps_messages import to_fix
from scpf.ingest.mcap_write import McapWriter
from scpf.models.errors import InputError
from scpf.models.geodesy import Origin


@pytest.mark.parametrize("origin", [ORIGIN, None])
def test_everything_written_is_read(tmp_path: Path, origin: Origin | None) -> None:
    with DriveLog(write(tmp_path / "drive.mcap", origin=origin)) as log:
        assert (log.start_ns, log.end_ns) == (T0, T0 + 39 * STEP)
        images = list(log.images())
        assert [image_.stamp_ns for image_ in images] == [T0 + k * STEP for k in range(40)]
        assert all(bytes(shown.data) == image(k) and shown.format == "jpeg" for k, shown in enumerate(images))
        camera = log.camera()
        assert camera is not None
        np.testing.assert_allclose(camera.T_body_camera, a_camera().T_body_camera, atol=1e-12)
        np.testing.assert_array_equal(camera.distortion, a_camera().distortion)
        trajectory = log.trajectory()
        assert trajectory is not None
        np.testing.assert_allclose(trajectory.poses()[17], a_pose(17), atol=1e-9)
        gps = log.gps()
        assert gps is not None
        np.testing.assert_allclose(gps[1], [a_pose(k)[:2, 3] for k in range(0, 40, 4)], atol=1e-3)
        np.testing.assert_allclose(gps[2], 4.0)
        road_map = log.road_map()
        assert road_map is not None
        np.testing.assert_allclose(road_map.positions_m, [[10.0, 5.0]], atol=1e-3)
        assert log.origin() == origin
        found = log.instances()
        assert len(found) == 40
        assert found[T0] == []
        assert found[T0 + STEP][0].landmark_id == "a"
        assert found[T0 + STEP][0].mask.all()
        assert log.metadata()["scpf"] == {"made_by": "a test"}
        assert (GPS_POSE_TOPIC in log.channels) == (origin is None)


def test_messages_come_by_log_time_and_within_bounds(small_log: Path) -> None:
    with DriveLog(small_log) as log:
        everything = list(log.messages())
        assert len(everything) == sum(channel.count for channel in log.channels.values())
        stamps = [record.stamp_ns for record in everything]
        assert stamps == sorted(stamps)
        low, high = T0 + 10 * STEP, T0 + 20 * STEP
        part = [record.stamp_ns for record in log.messages([INS_POSE_TOPIC], low, high)]
        assert part == [T0 + k * STEP for k in range(10, 20)]
        assert [shown.stamp_ns for shown in log.images(low, high)] == part
        assert list(log.messages([])) == []
        sequences = [record.sequence for record in log.messages([IMAGE_TOPIC])]
        assert sequences == list(range(40))


def test_a_small_topic_is_read_without_the_images(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / "drive.mcap", size=200_000)
    with DriveLog(path) as log:
        read: list[int] = []
        exactly = log._mcap.read_exactly
        monkeypatch.setattr(log._mcap, "read_exactly", lambda *a: (read.append(a[1]), exactly(*a))[1])
        assert len(list(log.messages([INS_POSE_TOPIC]))) == 40
        assert sum(read) < 0.02 * path.stat().st_size


def test_the_reference_library_agrees(small_log: Path) -> None:
    with small_log.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        total = sum(1 for _ in reader.iter_messages())
        assert total == summary.statistics.message_count
        assert reader.get_header().profile == "ros2"
        assert next(iter(reader.iter_attachments())).name == MAP_ATTACHMENT


@pytest.mark.parametrize("compression", list(CompressionType))
def test_files_of_the_reference_library_are_read(tmp_path: Path, compression: CompressionType) -> None:
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1000, compression=compression, enable_data_crcs=True)
        writer.start(profile="ros2", library="other")
        text = b"uint32 data\n"
        schema = writer.register_schema("other_msgs/msg/Count", "ros2msg", text)
        channel = writer.register_channel("/count", "cdr", schema)
        for k in range(300):  # times that go back and forth, within and across chunks
            stamp = 1000 + (k * 37) % 300
            data = b"\x00\x01\x00\x00" + struct.pack("<I", stamp)
            writer.add_message(channel, stamp, data, stamp, k)
        writer.finish()
    with DriveLog(path) as log:
        assert [record.message.data for record in log.messages()] == list(range(1000, 1300))
        assert log.camera() is log.trajectory() is log.gps() is log.road_map() is None


def test_an_existing_log_is_kept_and_a_failure_leaves_the_partial(tmp_path: Path) -> None:
    path = write(tmp_path / "drive.mcap", 3)
    before = path.read_bytes()
    with pytest.raises(InputError, match="exists"):
        DriveLogWriter(path)
    with pytest.raises(KeyboardInterrupt), DriveLogWriter(path, overwrite=True) as log:
        log.write_image(T0, b"1", "png")
        raise KeyboardInterrupt
    assert path.read_bytes() == before
    with DriveLog(tmp_path / "drive.mcap.partial") as log_:
        assert log_.channels[IMAGE_TOPIC].count == 1


def test_an_empty_log_is_a_log(tmp_path: Path) -> None:
    with DriveLogWriter(tmp_path / "empty.mcap"):
        pass
    with DriveLog(tmp_path / "empty.mcap") as log:
        assert list(log.messages()) == []
        assert log.images(None) is not None


def test_a_log_without_an_origin_cannot_place_its_gps(tmp_path: Path) -> None:
    with DriveLogWriter(tmp_path / "a.mcap") as log:
        fix = to_fix(T0, np.zeros(3), None, ORIGIN, "gps")
        log.write_message("/gps/fix", "sensor_msgs/msg/NavSatFix", fix, T0)
    with DriveLog(tmp_path / "a.mcap") as log_, pytest.raises(InputError, match="origin"):
        log_.gps()


def test_what_is_a_second_old_survives_a_kill(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [100.0]
    monkeypatch.setattr("scpf.ingest.mcap_write.time.monotonic", lambda: now_s[0])
    with DriveLogWriter(tmp_path / "a.mcap") as log:
        log.write_pose(T0, a_pose(0))
        small = (tmp_path / "a.mcap.partial").stat().st_size
        now_s[0] += 1.1
        log.write_pose(T0 + STEP, a_pose(1))
        assert (tmp_path / "a.mcap.partial").stat().st_size > small + 200


def test_a_log_that_is_not_live_has_the_same_bytes_however_long_it_took(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = [100.0]
    monkeypatch.setattr("scpf.ingest.mcap_write.time.monotonic", lambda: now_s[0])
    logs = {}
    for live in (True, False):
        for pause_s in (0.0, 1.1):
            path = tmp_path / f"{live}_{pause_s}.mcap"
            with DriveLogWriter(path, live=live) as log:
                for k in range(3):
                    log.write_pose(T0 + k * STEP, a_pose(k))
                    now_s[0] += pause_s
            logs[live, pause_s] = path.read_bytes()
    assert logs[False, 0.0] == logs[False, 1.1] != logs[True, 1.1]


def test_a_full_disk_is_not_kept_from_the_writer_of_messages() -> None:
    """What the flushing in the background meets is raised where the next message is added."""

    class Full(io.BytesIO):
        full = False

        def write(self, data: object) -> int:
            if self.full:
                raise OSError(28, "No space left on device")
            return super().write(data)  # type: ignore[arg-type]

    out = Full()
    writer = McapWriter(out, "test")
    channel = writer.add_channel("/a", "", b"", message_encoding="json")
    writer.add_message(channel, 1, b"{}", 1, 0)
    out.full = True
    writer._flushed_s -= 10
    writer.flush_if_due()
    with pytest.raises(OSError, match="No space left"):
        writer.add_message(channel, 2, b"{}", 2, 1)
    assert writer._stop_flushing is not None
    writer._stop_flushing.set()


def test_a_chunk_of_schemas_alone_has_no_time(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1, use_statistics=False)
        writer.start()
        channel = writer.register_channel(
            "/a", "cdr", writer.register_schema("a/msg/A", "ros2msg", b"uint8 a")
        )
        for stamp in (5, 7):
            writer.add_message(channel, stamp, b"\0\1\0\0\1", stamp)
        writer.finish()
    with DriveLog(path) as log:
        assert (log.start_ns, log.end_ns, log.channels["/a"].count) == (5, 7, 2)
