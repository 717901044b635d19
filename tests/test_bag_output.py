"""What a conversion leaves: parts, compression, what the command prints, and that other tools read it."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from pathlib import Path

import pytest
import zstandard
from bag_builders import T0, numbers_bag
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from scpf.ingest.bag_output import Split
from scpf.ingest.bag_report import Encoding, Options
from scpf.ingest.bags import convert
from scpf.ingest.drive_log import DriveLog, DriveLogWriter
from scpf.ingest.mcap_read import McapFile
from scpf.ingest.topics import LATCHED_QOS
from scpf.models.errors import DamagedError, InputError, UsageError
from scpf.replay import convert_command
from scpf.replay.cli import run
from scpf.replay.convert_report import parse_size

ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)


@pytest.mark.parametrize("encoding", ["ros1", "ros2"])
@pytest.mark.parametrize("split", [Split(duration_s=20e-6), Split(size_bytes=1 << 16)])
def test_parts(tmp_path: Path, encoding: Encoding, split: Split) -> None:
    count = 200 if split.duration_s else 3000
    source = numbers_bag(tmp_path / "a.bag", count=count)
    report = convert([source], tmp_path / "a.mcap", Options(encoding, split=split, verify=True))
    assert (report.lossless, report.verified) == (True, True)
    names = [f"a_{k:03d}.mcap" for k in range(len(report.paths))]
    assert [Path(path).name for path in report.paths] == names
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.bag", *names]
    assert len(names) == 5 if split.duration_s else len(names) > 2
    last_ns = 0
    for path in report.paths:
        with McapFile(Path(path)) as file:
            stamps = [record.log_time_ns for record in file.messages()]
        assert stamps[0] >= last_ns
        assert not split.duration_s or stamps[-1] - stamps[0] < 20_000
        assert split.duration_s or Path(path).stat().st_size < 200_000
        last_ns = stamps[-1]
    with pytest.raises(InputError, match=r"a_000\.mcap exists"):
        convert([source], tmp_path / "a.mcap", Options(encoding, split=split))
    again = Options(encoding, split=Split(duration_s=1.0), overwrite=True)
    report = convert([source], tmp_path / "a.mcap", again)
    assert report.notes == [f"{name} is left from an earlier run" for name in names[1:]]


def test_sizes() -> None:
    assert [parse_size(text) for text in ("70000", "500MB", "2GiB", "1.5 kb")] == [
        70000,
        500 * 10**6,
        2 << 30,
        1500,
    ]
    for text in ("", "MB", "5 apples", "-1"):
        with pytest.raises(UsageError, match="is not a size"):
            parse_size(text)
    for split in ({"size_bytes": 5}, {"duration_s": 0.0}, {"duration_s": float("nan")}):
        with pytest.raises(UsageError):
            Split(**split)  # type: ignore[arg-type]


@pytest.mark.parametrize("compression", ["auto", "zstd", "none"])
def test_compression(tmp_path: Path, compression: str) -> None:
    source = numbers_bag(tmp_path / "a.bag")
    convert([source], tmp_path / "a.mcap", Options(compression=compression, verify=True))  # type: ignore[arg-type]
    with McapFile(tmp_path / "a.mcap") as file:
        assert {chunk.compression for chunk in file.index.chunks} == {"" if compression == "none" else "zstd"}
    with (tmp_path / "a.mcap").open("rb") as stream:
        assert sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages()) == 400


def latched_bag(path: Path) -> Path:
    with Writer1(path) as bag:
        channel = bag.add_connection(
            "/map", "std_msgs/msg/String", typestore=ROS1, callerid="/node", latching=1
        )
        bag.write(channel, T0, ROS1.serialize_ros1(ROS1.types["std_msgs/msg/String"]("x"), channel.msgtype))
    return path


def test_latching_and_callers_survive(tmp_path: Path) -> None:
    source = latched_bag(tmp_path / "a.bag")
    convert([source], tmp_path / "ros1.mcap", Options("ros1"))
    convert([source], tmp_path / "ros2.mcap")
    convert([tmp_path / "ros1.mcap"], tmp_path / "twice.mcap", Options(verify=True))
    with McapFile(tmp_path / "ros1.mcap") as file:
        (channel,) = file.index.channels.values()
        assert {"callerid": "/node", "latching": "1"}.items() <= channel.metadata.items()
        assert channel.schema is not None
        assert (channel.schema.name, channel.schema.encoding) == ("std_msgs/String", "ros1msg")
    for name in ("ros2.mcap", "twice.mcap"):
        with McapFile(tmp_path / name) as file:
            (channel,) = file.index.channels.values()
            assert channel.metadata["offered_qos_profiles"] == LATCHED_QOS
        with AnyReader([tmp_path / name]) as reader:
            assert reader.connections[0].ext.offered_qos_profiles[0].durability.value == 1  # type: ignore[union-attr]


def test_attachments_and_metadata_of_a_drive_log_survive(tmp_path: Path) -> None:
    with DriveLogWriter(tmp_path / "a.mcap") as log:
        channel = log.mcap.add_channel("/a", "std_msgs/msg/Int32", b"int32 data\n")
        log.mcap.add_message(channel, T0, b"\0\1\0\0\5\0\0\0", T0, 0)
        log.attach("map.geojson", "application/geo+json", b"{}")
        log.metadata("scpf", {"origin": "here"})
    convert([tmp_path / "a.mcap"], tmp_path / "b.mcap")
    with DriveLog(tmp_path / "b.mcap") as copy:
        assert copy.attachments() == {"map.geojson": b"{}"}
        assert copy.metadata()["scpf"] == {"origin": "here"}


@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_compressed_rosbag2(tmp_path: Path, mode: CompressionMode) -> None:
    writer = Writer2(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer as bag:
        channel = bag.add_connection("/n", "std_msgs/msg/Int32", typestore=ROS2)
        for k in range(20):
            bag.write(
                channel, T0 + k, ROS2.serialize_cdr(ROS2.types["std_msgs/msg/Int32"](k), channel.msgtype)
            )
    report = convert([tmp_path / "bag"], tmp_path / "a.mcap", Options(verify=True))
    assert (report.lossless, report.verified) == (True, True)
    with DriveLog(tmp_path / "a.mcap") as log:
        assert [record.message.data for record in log.messages(["/n"])] == list(range(20))


def test_a_compressed_file_that_unpacks_to_gigabytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("scpf.ingest.rosbag2_zstd.SPARE_BYTES", 0)
    (tmp_path / "a.db3.zstd").write_bytes(zstandard.compress(bytes(300_000_000)))
    with pytest.raises(DamagedError, match="unpacks to more than"):
        convert([tmp_path / "a.db3.zstd"], tmp_path / "a.mcap")


def test_verify_finds_a_difference(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("scpf.ingest.bags.header_sequence", lambda raw: 0)
    source = numbers_bag(tmp_path / "a.bag")
    assert convert([source], tmp_path / "a.mcap", Options(verify=True)).verified
    from scpf.ingest import bag_output

    add = bag_output.BagOutput.write

    def forge(self, channel, stamp, data, *rest):  # type: ignore[no-untyped-def]
        data = bytes(data)[:-4] + struct.pack("<i", 7) if channel.topic == "/number" else data
        add(self, channel, stamp, data, *rest)

    monkeypatch.setattr(bag_output.BagOutput, "write", forge)
    for encoding in ("ros1", "ros2"):
        report = convert([source], tmp_path / f"{encoding}.mcap", Options(encoding, verify=True))  # type: ignore[arg-type]
        assert {c.topic: c.equal for c in report.comparisons or ()} == {"/number": False, "/text": True}
        assert not report.lossless


def test_one_topic_of_a_ros1_bag_and_a_rosbag2(tmp_path: Path) -> None:
    with Writer2(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        channel = bag.add_connection("/number", "std_msgs/msg/Int32", typestore=ROS2)
        for k in range(20):
            message = ROS2.types["std_msgs/msg/Int32"](1000 + k)
            bag.write(channel, T0 + k * 1000, ROS2.serialize_cdr(message, channel.msgtype))
    sources = [numbers_bag(tmp_path / "a.bag"), tmp_path / "bag"]
    report = convert(sources, tmp_path / "a.mcap", Options(verify=True))
    assert (report.lossless, report.verified, report.messages) == (True, True, 420)
    with DriveLog(tmp_path / "a.mcap") as log:
        found = [record.message.data for record in log.messages(["/number"])]
    assert found[:6] == [0, 1, 1000, 2, 3, 1001]  # on equal times, the first input comes first


def test_text_that_is_not_utf_8_is_kept_and_said_not_to_be_compared(tmp_path: Path) -> None:
    source = numbers_bag(tmp_path / "a.bag")
    source.write_bytes(source.read_bytes().replace(b"00150", b"\xff0150"))
    report = convert([source], tmp_path / "a.mcap", Options(verify=True))
    assert (report.messages, report.verified, report.lossless) == (400, True, False)
    assert report.losses[0].startswith("/text: 1 messages cannot be compared")
    with McapFile(tmp_path / "a.mcap") as file:
        assert sum(bytes(record.data[8:-1]) == b"\xff0150" for record in file.messages({"/text"})) == 1
    assert convert([source], tmp_path / "b.mcap", Options("ros1", verify=True)).lossless


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = numbers_bag(tmp_path / "a.bag")
    words = ["convert", str(source), "-o", str(tmp_path / "a.mcap"), "-t", "re:/n.*", "--verify", "-q"]
    assert run(words) == 0
    assert (
        "verified: 200 messages of 1 topics equal their source (decoded content)" in capsys.readouterr().out
    )
    assert run([*words, "--overwrite", "--format", "json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["messages"], found["verified"], found["left_out"]) == (200, True, ["/text"])
    assert run(["convert", str(source), "-o", str(tmp_path / "b.mcap"), "-t", "re:("]) == 2
    assert run(["convert", str(source), "-o", str(tmp_path / "b.mcap"), "-t", "/nobody"]) == 1
    assert run(["convert", str(source), "-o", str(tmp_path / "b.mcap"), "--start", "5", "--end", "2"]) == 2
    assert not list(tmp_path.glob("b.mcap*"))
    (tmp_path / "cut.bag").write_bytes(source.read_bytes()[:20_000])
    assert convert_command.convert([tmp_path / "cut.bag"], output=tmp_path / "c.mcap", quiet=True) == 3


def test_rerun_opens_the_results(tmp_path: Path) -> None:
    tool = Path(sys.executable).with_name("rerun")
    if not tool.exists():
        pytest.skip("the rerun command is not installed beside python")
    for encoding in ("ros1", "ros2"):
        path = tmp_path / f"{encoding}.mcap"
        convert([numbers_bag(tmp_path / "a.bag")], path, Options(encoding))  # type: ignore[arg-type]
        for words in (["info", str(path)], ["convert", str(path), "-o", str(tmp_path / f"{encoding}.rrd")]):
            subprocess.run([tool, "mcap", *words], check=True, capture_output=True, timeout=60)
