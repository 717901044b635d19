"""ROS 1 bags that were not closed, were cut or are damaged: what is readable arrives, what is not is said."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import pytest
from bag_builders import T0, bag_header, fields, numbers_bag, record, time
from rosbags.rosbag1 import Reader

from scpf.ingest import ros1_bag
from scpf.ingest.bag_report import ConversionReport, Options
from scpf.ingest.bags import convert
from scpf.ingest.drive_log import DriveLog
from scpf.ingest.ros1_chunks import unpack_chunk
from scpf.replay import convert_command

COMPRESSIONS = ("none", "bz2", "lz4")


def numbers(path: Path) -> list[int]:
    with DriveLog(path) as log:
        return [record.message.data for record in log.messages(["/number"])]


def converted(source: Path, tmp_path: Path) -> tuple[ConversionReport, list[int]]:
    output = tmp_path / "out.mcap"
    report = convert([source], output, Options(overwrite=True, verify=True))
    assert report.verified
    return report, numbers(output)


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_sound_bag(tmp_path: Path, compression: str) -> None:
    source = numbers_bag(tmp_path / "a.bag", compression=compression)
    with Reader(source) as bag:  # the bag of the tests is one that others read
        assert bag.message_count == 400
    report, found = converted(source, tmp_path)
    assert report.lossless
    assert (report.messages, found) == (400, list(range(200)))


def test_recording_order_is_kept_on_equal_stamps(tmp_path: Path) -> None:
    convert([numbers_bag(tmp_path / "a.bag")], tmp_path / "a.mcap", Options("ros1"))
    from scpf.ingest.mcap_read import McapFile

    with McapFile(tmp_path / "a.mcap") as file:
        found = [(record.log_time_ns, record.channel.topic, bytes(record.data)) for record in file.messages()]
    for k in range(200):
        assert found[2 * k] == (T0 + k // 2 * 1000, "/text", struct.pack("<I", 5) + f"{k:05d}".encode())
        assert found[2 * k + 1] == (T0 + k // 2 * 1000, "/number", struct.pack("<i", k))


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_bag_that_was_not_closed(tmp_path: Path, compression: str) -> None:
    data = numbers_bag(tmp_path / "a.bag", compression=compression).read_bytes()
    end = int.from_bytes(data[data.index(b"index_pos=") + 10 :][:8], "little")
    active = tmp_path / "a.bag.active"
    active.write_bytes(data[:13] + bag_header(0, 0, 0) + data[4117:end])
    report, found = converted(active, tmp_path)
    assert found == list(range(200))
    assert not report.lossless
    assert "was not closed" in report.losses[0]
    assert convert_command.convert([active], output=tmp_path / "b.mcap", quiet=True) == 3


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_chunk_that_was_not_closed(tmp_path: Path, compression: str) -> None:
    """A recorder that was killed leaves a chunk of length 0, and its records, or a compressed stream, after it."""
    data = numbers_bag(tmp_path / "a.bag", compression=compression).read_bytes()
    last = data.rindex(b"compression=") - 8
    length = int.from_bytes(data[last : last + 4], "little")
    body = last + 8 + length
    stored = int.from_bytes(data[body - 4 : body], "little")
    head = fields(compression=compression.encode(), op=b"\5", size=struct.pack("<I", 0))
    active = tmp_path / "a.bag.active"
    active.write_bytes(
        data[:13] + bag_header(0, 0, 0) + data[4117:last] + record(head, b"") + data[body : body + stored]
    )
    report, found = converted(active, tmp_path)
    assert found == list(range(200))
    assert any("never closed" in loss for loss in report.losses)


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_bag_that_is_cut_short(tmp_path: Path, compression: str) -> None:
    data = numbers_bag(tmp_path / "a.bag", compression=compression).read_bytes()
    starts = [match.start() - 8 for match in re.finditer(b"compression=", data)]
    last = -1
    for size in range(starts[3], len(data) - 1, (len(data) - starts[3]) // 25):
        (tmp_path / "cut.bag").write_bytes(data[:size])
        report, found = converted(tmp_path / "cut.bag", tmp_path)
        assert not report.lossless
        assert any("cut short" in loss for loss in report.losses)
        assert found == list(range(len(found)))
        assert len(found) >= last
        last = len(found)
        whole = sum(start < size for start in starts) - 1
        assert len(found) >= whole * 200 // len(starts) - 1
    assert last == 200


def test_damage_in_between_costs_what_it_hits(tmp_path: Path) -> None:
    for compression in COMPRESSIONS:
        data = bytearray(numbers_bag(tmp_path / "a.bag", compression=compression).read_bytes())
        starts = [match.start() - 8 for match in re.finditer(b"compression=", data)]
        middle = starts[len(starts) // 2]
        data[middle : middle + 4] = b"\xff\xff\xff\xff"  # the length of a chunk's header
        (tmp_path / "bad.bag").write_bytes(data)
        report, found = converted(tmp_path / "bad.bag", tmp_path)
        assert not report.lossless
        assert any(f"byte {middle}" in loss and "left out" in loss for loss in report.losses)
        share = 200 / len(starts)
        assert 200 - 2 * share <= len(found) < 200
        assert found[-1] == 199


def test_a_damaged_chunk_gives_what_comes_before_the_damage(tmp_path: Path) -> None:
    data = bytearray(numbers_bag(tmp_path / "a.bag", chunk_bytes=100_000).read_bytes())
    place = data.index(b"00150")
    data[place - 8 : place - 4] = b"\xff\xff\xff\x7f"  # the length of message 150
    (tmp_path / "bad.bag").write_bytes(data)
    report, found = converted(tmp_path / "bad.bag", tmp_path)
    assert found == list(range(150))
    assert any("300 messages of this chunk are read" in loss for loss in report.losses)
    assert "counts 200 messages and holds 150" in report.topics["/number"].problem


@pytest.mark.parametrize("compression", ["bz2", "lz4"])
def test_a_chunk_never_unpacks_to_more_than_it_declares(compression: str) -> None:
    import bz2

    import lz4.frame

    bomb = {"bz2": bz2.compress, "lz4": lz4.frame.compress}[compression](bytes(50_000_000))
    found, problem = unpack_chunk(compression, memoryview(bomb), 1000)
    assert (len(found), problem) == (1000, "a chunk that declares 1000 bytes holds more")
    found, problem = unpack_chunk(compression, memoryview(bomb), 2**31)
    assert (len(found), "more than 512 MiB" in problem) == (0, True)
    found, problem = unpack_chunk(compression, memoryview(bomb)[: len(bomb) // 2], 50_000_000)
    assert problem
    assert len(found) < 50_000_000


def test_chunks_that_overlap_in_time_are_merged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = bytearray(numbers_bag(tmp_path / "a.bag").read_bytes())
    # The last message is given the first's time: its chunk now spans the whole recording.
    place = data.rindex(b"00199") - 4 - 4 - 8
    for at in [place, *(m.start() for m in re.finditer(re.escape(time(T0 + 99_000)), bytes(data)))]:
        if data[at : at + 8] == time(T0 + 99_000):
            data[at : at + 8] = time(T0)
    (tmp_path / "b.bag").write_bytes(data)
    _, found = converted(tmp_path / "b.bag", tmp_path)
    assert sorted(found) == list(range(200))
    assert found[2:4] == [198, 199]
    # Too much to hold: written as it comes, and read in order all the same.
    monkeypatch.setattr(ros1_bag, "HELD_BYTES", 1)
    _, again = converted(tmp_path / "b.bag", tmp_path)
    assert sorted(again) == list(range(200))
