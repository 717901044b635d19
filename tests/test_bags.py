"""Bags to MCAP: every message arrives, in order, and what cannot arrive has a name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from scpf.ingest.bag_report import Encoding, Options
from scpf.ingest.bags import convert
from scpf.ingest.drive_log import DriveLog, DriveLogWriter
from scpf.ingest.mcap_read import McapFile
from scpf.models.errors import DamagedError, InputError
from scpf.replay import convert_command

ROS1 = get_typestore(Stores.ROS1_NOETIC)
ROS2 = get_typestore(Stores.ROS2_HUMBLE)
CUSTOM = "Header header\nfloat64[] values\nstring name\nuint8 flag\n"
ROS1.register(get_types_from_msg(CUSTOM, "my_msgs/msg/Custom"))
T0 = 1_600_000_000_000_000_000


def header(store: Any, seq: int, stamp_ns: int) -> Any:
    time = store.types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return store.types["std_msgs/msg/Header"](seq=seq, stamp=time, frame_id="cam")


def camera_info(seq: int, stamp_ns: int) -> Any:
    roi = ROS1.types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    matrix = np.array([700.0, 0, 320, 0, 701, 240, 0, 0, 1])
    return ROS1.types["sensor_msgs/msg/CameraInfo"](
        header(ROS1, seq, stamp_ns), 480, 640, "plumb_bob", np.zeros(5), matrix, np.eye(3).ravel(),
        np.zeros(12), 0, 0, roi,
    )  # fmt: skip


@pytest.fixture
def ros1_bag(tmp_path: Path) -> Path:
    path = tmp_path / "a.bag"
    with Writer1(path) as bag:
        info = bag.add_connection("/camera/camera_info", "sensor_msgs/msg/CameraInfo", typestore=ROS1)
        own = bag.add_connection("/own", "my_msgs/msg/Custom", typestore=ROS1)
        for k in range(30):
            stamp_ns = T0 + k * 10**8
            bag.write(info, stamp_ns, ROS1.serialize_ros1(camera_info(1000 + k, stamp_ns), info.msgtype))
            custom = ROS1.types["my_msgs/msg/Custom"](
                header(ROS1, 7 * k, stamp_ns), np.arange(float(k)), "x" * k, k
            )
            bag.write(own, stamp_ns, ROS1.serialize_ros1(custom, own.msgtype))
    return path


def rosbag2(path: Path, storage: StoragePlugin, count: int = 20) -> Path:
    with Writer2(path, version=9, storage_plugin=storage) as bag:
        text = bag.add_connection("/text", "std_msgs/msg/String", typestore=ROS2)
        number = bag.add_connection("/number", "std_msgs/msg/Int32", typestore=ROS2)
        for k in range(count):
            message = ROS2.types["std_msgs/msg/String"](data=f"message {k}")
            bag.write(text, T0 + k, ROS2.serialize_cdr(message, text.msgtype))
            bag.write(number, T0 + k, ROS2.serialize_cdr(ROS2.types["std_msgs/msg/Int32"](k), number.msgtype))
    return path


def test_ros1_arrives_as_ros2(tmp_path: Path, ros1_bag: Path) -> None:
    output = tmp_path / "a.mcap"
    report = convert([ros1_bag], output)
    assert report.lossless
    assert report.messages == 60
    with DriveLog(output) as log:
        camera = log.camera()
        assert camera is not None
        assert camera.matrix[1, 1] == 701.0
        infos = list(log.messages(["/camera/camera_info"]))
        assert [record.sequence for record in infos] == [1000 + k for k in range(30)]
        assert [record.stamp_ns for record in infos] == [T0 + k * 10**8 for k in range(30)]
        for k, record in enumerate(log.messages(["/own"])):
            message = record.message
            np.testing.assert_array_equal(message.values, np.arange(float(k)))
            assert (message.name, message.flag, record.sequence, record.sensor_ns) == (
                "x" * k,
                k,
                7 * k,
                record.stamp_ns,
            )
    with AnyReader([output]) as reader:
        assert {topic: info.msgcount for topic, info in reader.topics.items()} == {
            "/camera/camera_info": 30,
            "/own": 30,
        }


@pytest.mark.parametrize("storage", list(StoragePlugin))
@pytest.mark.parametrize("lone", [False, True])
def test_rosbag2_is_copied(tmp_path: Path, storage: StoragePlugin, lone: bool) -> None:
    folder = rosbag2(tmp_path / "bag", storage)
    source = next(path for path in folder.iterdir() if path.suffix != ".yaml") if lone else folder
    report = convert([source], tmp_path / "a.mcap")
    assert (report.lossless, report.messages) == (True, 40)
    with DriveLog(tmp_path / "a.mcap") as log:
        assert [record.message.data for record in log.messages(["/text"])] == [
            f"message {k}" for k in range(20)
        ]
        assert [record.stamp_ns for record in log.messages(["/number"])] == [T0 + k for k in range(20)]


def test_mcap_keeps_publish_times_sequences_and_order(tmp_path: Path) -> None:
    with DriveLogWriter(tmp_path / "in.mcap") as log:
        channel = log.mcap.add_channel("/a", "std_msgs/msg/Int32", b"int32 data\n")
        for k in range(50):  # equal log times: only their place orders them
            data = ROS2.serialize_cdr(ROS2.types["std_msgs/msg/Int32"](k), "std_msgs/msg/Int32")
            log.mcap.add_message(channel, T0 + k // 10, data, T0 - k, 3 * k)
    convert([tmp_path / "in.mcap"], tmp_path / "out.mcap")
    with DriveLog(tmp_path / "out.mcap") as out:
        got = [(r.message.data, r.stamp_ns, r.publish_time_ns, r.sequence) for r in out.messages(["/a"])]
    assert got == [(k, T0 + k // 10, T0 - k, 3 * k) for k in range(50)]


def test_topics_and_times_can_be_chosen(tmp_path: Path, ros1_bag: Path) -> None:
    chosen = Options(include=("re:/cam.*", "/nobody"), start_s=1.0, end_s=2.0)
    report = convert([ros1_bag], tmp_path / "a.mcap", chosen)
    assert (report.messages, report.left_out, report.lossless) == (10, ["/own"], True)
    assert report.notes == ["no topic matches /nobody"]
    with pytest.raises(InputError, match="no message lies between"):
        convert([ros1_bag], tmp_path / "a2.mcap", Options(start_s=1000.0))
    report = convert([ros1_bag], tmp_path / "b.mcap", Options(exclude=("/own",)))
    assert report.messages == 30
    for include, exclude in ((("/nobody",), ()), ((), ("*",))):
        with pytest.raises(InputError, match="no topic matches") as caught:
            convert([ros1_bag], tmp_path / "c.mcap", Options(include=include, exclude=exclude))
        assert "/camera/camera_info, /own" in caught.value.hint
    assert not (tmp_path / "c.mcap").exists()


def test_several_recordings_are_merged_by_time(tmp_path: Path, ros1_bag: Path) -> None:
    folder = rosbag2(tmp_path / "bag", StoragePlugin.SQLITE3)
    report = convert([ros1_bag, folder], tmp_path / "a.mcap")
    assert report.messages == 100
    with DriveLog(tmp_path / "a.mcap") as log:
        stamps = [record.stamp_ns for record in log.messages()]
        assert stamps == sorted(stamps)
        assert len(log.channels) == 4


def test_one_bad_topic_costs_that_topic(
    tmp_path: Path, ros1_bag: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = ros1_bag.read_bytes()
    ros1_bag.write_bytes(data.replace(b"float64[] values", b"float32[] values"))
    report = convert([ros1_bag], tmp_path / "a.mcap")
    assert not report.lossless
    assert "md5" in report.topics["/own"].problem
    assert (report.topics["/camera/camera_info"].written, report.topics["/own"].written) == (30, 0)
    assert convert_command.convert([ros1_bag], output=tmp_path / "b.mcap") == 3
    assert "30 messages left out" in capsys.readouterr().out


def test_undefined_types_are_copied(tmp_path: Path) -> None:
    path = tmp_path / "in.mcap"
    with DriveLogWriter(path) as log:
        lying = log.mcap.add_channel("/lying", "a_msgs/msg/Lying", b"string[100] much\n")
        text = log.mcap.add_channel("/text", "std_msgs/msg/Int32", b"Nowhere data\n")
        odd = log.mcap.add_channel("/json", "x", b"{}", message_encoding="json", schema_encoding="jsonschema")
        for channel in (lying, text, odd):
            log.mcap.add_message(channel, T0, b"\0\1\0\0\5\0\0\0", T0, 0)
    report = convert([path], tmp_path / "out.mcap", Options(verify=True))
    assert report.lossless
    assert report.verified
    assert any("json, not ROS" in note for note in report.notes)
    assert [report.topics[topic].written for topic in ("/lying", "/text", "/json")] == [1, 1, 1]
    assert any("copied without a definition" in note for note in report.notes)
    assert any("Humble's definition is used" in note for note in report.notes)
    with DriveLog(tmp_path / "out.mcap") as log_:
        assert next(log_.messages(["/text"])).message.data == 5
        assert bytes(next(log_.messages(["/lying"])).raw) == b"\0\1\0\0\5\0\0\0"


def test_a_recording_without_messages(tmp_path: Path) -> None:
    with Writer1(tmp_path / "a.bag"):
        pass
    report = convert([tmp_path / "a.bag"], tmp_path / "a.mcap")
    assert (report.messages, report.lossless) == (0, True)
    with DriveLog(tmp_path / "a.mcap") as log:
        assert list(log.messages()) == []


def test_damaged_recordings_are_named(tmp_path: Path) -> None:
    for name, content in {
        "none.bag": b"",
        "odd.bag": b"x" * 500,
        "x.db3": b"x" * 5000,
        "x.mcap": b"y" * 99,
    }.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(DamagedError, match=name):
            convert([tmp_path / name], tmp_path / "a.mcap")
    (tmp_path / "notes.txt").write_text("x")
    for path in (tmp_path / "nowhere.bag", tmp_path / "notes.txt"):
        with pytest.raises(InputError, match=path.name):
            convert([path], tmp_path / "a.mcap")
    assert not (tmp_path / "a.mcap").exists()


def test_the_real_bags(tmp_path: Path, shared_data: Path) -> None:
    bags = shared_data / "bags"
    folders = [path for kind in ("mcap", "sqlite3") for path in sorted((bags / "rosbag2" / kind).iterdir())]
    for number, path in enumerate([*sorted(bags.glob("*.bag")), *folders]):
        if path.name == "reindex_test_bags":
            path = path / "multiple_files"
        expected: dict[str, int] | None = None
        if path.is_file() or (path / "metadata.yaml").exists():
            with AnyReader([path], default_typestore=ROS2) as reader:
                expected = {topic: info.msgcount for topic, info in reader.topics.items()}
        encodings: tuple[Encoding, ...] = ("ros2", "ros1") if path.suffix == ".bag" else ("ros2",)
        for encoding in encodings:
            output = tmp_path / f"{number}.{encoding}.mcap"
            report = convert([path], output, Options(encoding, verify=True))
            assert report.lossless, path
            assert report.verified, path
            with McapFile(output) as file:
                counts: dict[str, int] = {channel.topic: 0 for channel in file.index.channels.values()}
                for record in file.messages():
                    counts[record.channel.topic] += 1
            assert expected is None or counts == expected, path
            assert report.messages > 0 or path.name == "no-messages.bag"


def test_the_same_recording_compressed_in_three_ways(tmp_path: Path, shared_data: Path) -> None:
    sums = []
    for name in ("example", "example-bz2", "example-lz4"):
        for encoding in ("ros1", "ros2"):
            options = Options(encoding, verify=True)  # type: ignore[arg-type]
            report = convert(
                [shared_data / "bags" / f"{name}.bag"], tmp_path / f"{name}.{encoding}.mcap", options
            )
            sums.append({found.topic: found.sha256 for found in report.comparisons or ()})
    assert len(sums[0]) == 9
    assert sums[0] == sums[2] == sums[4]
    assert sums[1] == sums[3] == sums[5]


def test_raw_bytes_are_those_that_another_reader_finds(tmp_path: Path, shared_data: Path) -> None:
    path = shared_data / "bags" / "example-lz4.bag"
    convert([path], tmp_path / "a.mcap", Options("ros1"))
    theirs: dict[str, list[tuple[int, bytes]]] = {}
    with Reader1(path) as bag:
        for connection, stamp_ns, raw in bag.messages():
            theirs.setdefault(connection.topic, []).append((stamp_ns, bytes(raw)))
    ours: dict[str, list[tuple[int, bytes]]] = {}
    with McapFile(tmp_path / "a.mcap") as file:
        assert file.index.profile == "ros1"
        channels = list(file.index.channels.values())
        assert {(c.encoding, c.schema.encoding) for c in channels if c.schema} == {("ros1", "ros1msg")}
        assert all(len(c.metadata["md5sum"]) == 32 for c in channels)
        for record in file.messages():
            ours.setdefault(record.channel.topic, []).append((record.log_time_ns, bytes(record.data)))
    assert ours == theirs


def test_a_database_with_a_damaged_page_gives_the_others(tmp_path: Path) -> None:
    source = next(rosbag2(tmp_path / "bag", StoragePlugin.SQLITE3, count=2000).glob("*.db3"))
    data = source.read_bytes()
    for word, least in ((b"message 1000", 1800), (b"message 0", 1800), (b"message 1999", 1800)):
        page = data.index(word) // 4096 * 4096
        source.write_bytes(data[:page] + b"\xff" * 4096 + data[page + 4096 :])
        report = convert([source], tmp_path / "a.mcap", Options(overwrite=True, verify=True))
        assert report.verified
        assert any("damaged pages" in loss for loss in report.losses)
        with DriveLog(tmp_path / "a.mcap") as log:
            found = {record.message.data for record in log.messages(["/number"])}
            texts = [record.message.data for record in log.messages(["/text"])]
        assert least <= len(found) < 2000
        assert len(texts) == len(set(texts))


def test_messages_that_are_not_ros_pass_as_they_are(tmp_path: Path, shared_data: Path) -> None:
    source = shared_data / "bags" / "custom-camera-model.mcap"
    report = convert([source], tmp_path / "a.mcap", Options(verify=True))
    assert (report.messages, report.lossless, report.verified) == (30, True, True)
    with DriveLog(source) as before, DriveLog(tmp_path / "a.mcap") as after:
        assert after.channels == before.channels
        assert {c.schema.encoding for c in after.mcap_channels if c.schema} == {"jsonschema"}
    with pytest.raises(InputError, match="not ROS 1 messages"):
        convert([source], tmp_path / "b.mcap", Options(encoding="ros1"))
