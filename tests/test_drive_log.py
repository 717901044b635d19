"""The drive log: what is written is read, and damage has a name and a place."""

from __future__ import annotations

import io
import json
import resource
import struct
import zlib
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from scpf.ingest import messages
from scpf.ingest.drive_log import (
    GPS_POSE_TOPIC,
    IMAGE_TOPIC,
    INS_POSE_TOPIC,
    MAP_ATTACHMENT,
    DriveLog,
    DriveLogWriter,
)
from scpf.ingest.gps_messages import to_fix
from scpf.ingest.mcap_decompress import decompress
from scpf.ingest.mcap_write import McapWriter
from scpf.models.camera import Camera, looking_ahead
from scpf.models.errors import DamagedError, InputError
from scpf.models.geodesy import Origin
from scpf.models.instances import instance_from_mask
from scpf.models.road_map import Landmark, RoadMap, to_geojson

ORIGIN = Origin(43.47, -80.54, 330.0)
T0 = 1_660_847_613_703_000_000
STEP = 77_000_000
MATRIX = np.array([[700.0, 0, 320], [0, 701, 240], [0, 0, 1]])


def a_camera() -> Camera:
    mount = looking_ahead()
    mount[:3, 3] = 1.5, 0.1, 1.2
    return Camera(640, 480, MATRIX, np.array([-0.2, 0.05, 0, 0, 0]), T_body_camera=mount)


def a_pose(k: int) -> np.ndarray:
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(k / 9), -np.sin(k / 9)], [np.sin(k / 9), np.cos(k / 9)]]
    pose[:3, 3] = k, -2.0 * k, 0.1
    return pose


def image(k: int, size: int = 30_000) -> bytes:
    return np.random.default_rng(k).bytes(size)


def write(path: Path, frames: int = 40, origin: Origin | None = ORIGIN, size: int = 30_000) -> Path:
    road = RoadMap(
        (Landmark("a", (10.0, 5.0, 0.0)),), np.column_stack([np.arange(20.0), np.zeros(20)]), origin=origin
    )
    mask = np.zeros((50, 60), bool)
    mask[5:40, 20:24] = True
    with DriveLogWriter(path, origin=origin) as log:
        log.write_camera(T0, a_camera())
        for k in range(frames):
            stamp_ns = T0 + k * STEP
            log.write_image(stamp_ns, image(k, size), "jpeg")
            log.write_pose(stamp_ns, a_pose(k), 0.02**2)
            if k % 4 == 0:
                log.write_gps(stamp_ns, a_pose(k)[:2, 3], 4.0)
            log.write_instances(stamp_ns, [instance_from_mask(mask, landmark_id="a")] if k else [])
        log.attach(MAP_ATTACHMENT, "application/geo+json", json.dumps(to_geojson(road)).encode())
        log.metadata("scpf", {"made_by": "a test"})
    return path


@pytest.fixture(scope="module")
def log_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("log") / "drive.mcap")


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


def test_messages_come_by_log_time_and_within_bounds(log_path: Path) -> None:
    with DriveLog(log_path) as log:
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


def test_the_reference_library_agrees(log_path: Path) -> None:
    with log_path.open("rb") as file:
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


def read_all(path: Path) -> int:
    with DriveLog(path) as log:
        count = sum(record.message is not None for record in log.messages())
        log.attachments(), log.metadata()
        return count


@pytest.mark.parametrize("share", [0.0, 0.0001, 0.3, 0.9, 0.9999])
def test_a_truncated_log_is_refused(tmp_path: Path, log_path: Path, share: float) -> None:
    data = log_path.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: int(share * len(data))])
    with pytest.raises(DamagedError, match=r"cut\.mcap: byte \d+"):
        read_all(tmp_path / "cut.mcap")


def test_no_flipped_byte_goes_unseen(tmp_path: Path, log_path: Path) -> None:
    data = log_path.read_bytes()
    rng = np.random.default_rng(3)
    expected = read_all(log_path)
    places = [*rng.integers(0, len(data), 60), *(len(data) - 1 - rng.integers(0, 4000, 100))]
    seen = 0
    for place in places:
        broken = bytearray(data)
        broken[place] ^= 0x10
        path = tmp_path / "flipped.mcap"
        path.write_bytes(broken)
        try:
            # Bytes outside every checksum (the header, message indexes, the data section's end) may pass.
            assert read_all(path) == expected
        except DamagedError:
            seen += 1
    assert seen > 0.9 * len(places)


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"", "empty"),
        (b"#ROSBAG V2.0\n" + b"x" * 100, "ROS 1 bag"),
        (b"SQLite format 3\0" + b"x" * 100, "SQLite"),
        (b"hello" * 100, "not an MCAP"),
        (b"\x89MCAP0\r\n" * 2, "too early"),
    ],
)
def test_other_files_are_named(tmp_path: Path, content: bytes, what: str) -> None:
    path = tmp_path / "other.mcap"
    path.write_bytes(content)
    with pytest.raises(DamagedError, match=what):
        DriveLog(path)


def test_an_unindexed_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "plain.mcap"
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=False)
        writer.start()
        channel = writer.register_channel(
            "/a", "cdr", writer.register_schema("a/msg/A", "ros2msg", b"uint8 a")
        )
        writer.add_message(channel, 1, b"\0\1\0\0\1", 1)
        writer.finish()
    with pytest.raises(DamagedError, match="no chunk in the index"):
        DriveLog(path)


def forge(path: Path, compression: str, data: bytes, declared: int, records_crc: int = 0) -> Path:
    """A file of one chunk that says what it is told to say."""
    magic = b"\x89MCAP0\r\n"
    name = compression.encode()

    def record(opcode: int, body: bytes) -> bytes:
        return struct.pack("<BQ", opcode, len(body)) + body

    def text(value: bytes) -> bytes:
        return struct.pack("<I", len(value)) + value

    head = magic + record(1, text(b"ros2") + text(b"forged"))
    body = (
        struct.pack("<QQQI", 0, 10, declared, records_crc) + text(name) + struct.pack("<Q", len(data)) + data
    )
    chunk = record(6, body)
    end = record(15, struct.pack("<I", 0))
    start = len(head) + len(chunk) + len(end)
    index = struct.pack("<QQQQIQ", 0, 10, len(head), len(chunk), 0, 0) + text(name)
    index += struct.pack("<QQ", len(data), declared)
    summary = record(3, struct.pack("<H", 1) + text(b"a/msg/A") + text(b"ros2msg") + text(b"uint8 a"))
    summary += record(4, struct.pack("<HH", 1, 1) + text(b"/a") + text(b"cdr") + text(b""))
    summary += record(8, index)
    footer = struct.pack("<BQQQ", 2, 20, start, 0)
    crc = zlib.crc32(footer, zlib.crc32(summary))
    path.write_bytes(head + chunk + end + summary + footer + struct.pack("<I", crc) + magic)
    return path


def message(size: int = 5, declared: int | None = None, log_time_ns: int = 5, channel: int = 1) -> bytes:
    head = struct.pack("<HIQQ", channel, 0, log_time_ns, 0)
    return struct.pack("<BQ", 5, 22 + size if declared is None else declared) + head + b"\0\1\0\0\1"[:size]


@pytest.mark.parametrize(
    ("compression", "data", "declared", "what"),
    [
        ("", message(), 36, None),
        ("", message(), 37, "another number"),
        ("zstd", zstandard.compress(bytes(50_000_000)), 100, "zstd frame"),
        ("zstd", zstandard.ZstdCompressor().compressobj().compress(b"") + b"garbage", 100, "zstd"),
        ("zstd", zstandard.compress(message()), 1 << 40, "512 MiB"),
        ("lz4", lz4.frame.compress(bytes(50_000_000)), 100, "another number"),
        ("lz4", b"garbage", 100, "lz4"),
        ("brotli", message(), 36, "brotli"),
        ("", message(declared=1 << 60), 36, "declares"),
        ("", message(declared=3), 36, "message of 3 bytes"),
        ("", message(log_time_ns=99), 36, "outside the times"),
        ("", message(channel=7), 36, "channel 7"),
        ("", message()[:5], 5, "cut short"),
    ],
)
def test_chunks_that_lie_are_refused(
    tmp_path: Path, compression: str, data: bytes, declared: int, what: str | None
) -> None:
    path = forge(tmp_path / "forged.mcap", compression, data, declared)
    if what is None:
        assert read_all(path) == 1
        return
    with pytest.raises(DamagedError, match=what) as caught:
        read_all(path)
    assert "forged.mcap: byte" in caught.value.message


def test_a_streamed_bomb_makes_no_more_than_it_declares(tmp_path: Path) -> None:
    compressor = zstandard.ZstdCompressor(level=19).compressobj()
    bomb = b"".join(compressor.compress(bytes(1 << 24)) for _ in range(64)) + compressor.flush()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(ValueError, match="another number"):
        decompress("zstd", memoryview(bomb), 1000)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000  # KiB


def test_a_message_that_is_not_of_its_type_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with DriveLogWriter(path) as log:
        text = messages.definition("geometry_msgs/msg/PoseStamped")
        channel = log.mcap.add_channel(INS_POSE_TOPIC, "geometry_msgs/msg/PoseStamped", text)
        log.mcap.add_message(channel, 7, b"\0\1\0\0" + b"\xff" * 20, 7, 0)
    with DriveLog(path) as log_, pytest.raises(DamagedError, match=r"/ins/pose at 7 ns"):
        log_.trajectory()


def test_topics_that_are_not_ros_are_counted_but_not_decoded(tmp_path: Path) -> None:
    path = tmp_path / "json.mcap"
    with DriveLogWriter(path) as log:
        channel = log.mcap.add_channel("/j", "", b"", message_encoding="json")
        log.mcap.add_message(channel, 7, b"{}", 7, 0)
    with DriveLog(path) as log_:
        assert log_.channels["/j"].count == 1
        record = next(log_.messages())
        assert bytes(record.raw) == b"{}"
        with pytest.raises(InputError, match="json"):
            _ = record.message


def test_a_topic_of_another_type_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with DriveLogWriter(path) as log:
        log.write_message(INS_POSE_TOPIC, "std_msgs/msg/Header", messages.to_header(7, "x"), 7)
        bad = messages.to_odometry(9, a_pose(0), None)
        bad.pose.pose.position.x = float("nan")
        log.write_message("/ins/odometry", "nav_msgs/msg/Odometry", bad, 9)
        fix = to_fix(T0, np.zeros(3), None, ORIGIN, "gps")
        fix.latitude = 1e9
        log.write_message("/gps/fix", "sensor_msgs/msg/NavSatFix", fix, 11)
        log.metadata("scpf_frame", {"latitude_deg": "43", "longitude_deg": "-80", "height_m": "0"})
    with DriveLog(path) as log_:
        with pytest.raises(DamagedError, match=r"/ins/pose at 7 ns, a std_msgs/msg/Header"):
            log_.trajectory()
        with pytest.raises(DamagedError, match="latitude 1000000000"):
            log_.gps()
