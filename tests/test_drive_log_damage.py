"""The drive log: damage, lies and other files have a name and a place."""

from __future__ import annotations

import resource
import struct
import zlib
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from damaged_logs import MAGIC, record, text
from mcap.writer import Writer
from small_logs import ORIGIN, T0, a_pose

from scpf.ingest import messages
from scpf.ingest.drive_log import INS_POSE_TOPIC, DriveLog, DriveLogWriter
from scpf.ingest.gps_messages import to_fix
from scpf.ingest.mcap_decompress import decompress
from scpf.models.errors import DamagedError, InputError


def read_all(path: Path) -> int:
    with DriveLog(path) as log:
        count = sum(record.message is not None for record in log.messages())
        log.attachments(), log.metadata()
        return count


@pytest.mark.parametrize("share", [0.0, 0.0001, 0.3, 0.9, 0.9999])
def test_a_truncated_log_is_refused(tmp_path: Path, small_log: Path, share: float) -> None:
    data = small_log.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: int(share * len(data))])
    with pytest.raises(DamagedError, match=r"cut\.mcap: byte \d+"):
        read_all(tmp_path / "cut.mcap")


def test_no_flipped_byte_goes_unseen(tmp_path: Path, small_log: Path) -> None:
    data = small_log.read_bytes()
    rng = np.random.default_rng(3)
    expected = read_all(small_log)
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
    name = compression.encode()
    head = MAGIC + record(1, text(b"ros2") + text(b"forged"))
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
    path.write_bytes(head + chunk + end + summary + footer + struct.pack("<I", crc) + MAGIC)
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
        definition = messages.definition("geometry_msgs/msg/PoseStamped")
        channel = log.mcap.add_channel(INS_POSE_TOPIC, "geometry_msgs/msg/PoseStamped", definition)
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
