"""Recover: what a damaged log still holds is saved, and what it does not hold is said."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from damaged_logs import (
    MAGIC,
    by_library,
    cases,
    channel,
    chunk,
    message,
    messages,
    record,
    schema,
    text,
    whole,
)
from mcap.writer import CompressionType

from scpf.ingest.drive_log import IMAGE_TOPIC, INS_POSE_TOPIC, DriveLog, DriveLogWriter
from scpf.ingest.recover import RECOVERY_METADATA, recover
from scpf.models.camera import Camera
from scpf.models.errors import DamagedError, InputError, UsageError
from scpf.models.geodesy import Origin
from scpf.replay import cli

T0 = 1_660_847_613_000_000_000
STEP = 77_000_000
PIECE = 2_000_000
MAP = b'{"type": "FeatureCollection", "features": []}'


def write(path: Path, frames: int = 12, image_bytes: int = PIECE) -> Path:
    """A drive log with several chunks of images and one of the rest."""
    with DriveLogWriter(path, origin=Origin(43.0, -80.0, 300.0)) as log:
        log.write_camera(T0, Camera(640, 480, np.array([[700.0, 0, 320], [0, 700, 240], [0, 0, 1]])))
        for k in range(frames):
            log.write_image(T0 + k * STEP, np.random.default_rng(k).bytes(image_bytes), "jpeg")
            log.write_pose(T0 + k * STEP, np.eye(4))
        log.attach("map.geojson", "application/geo+json", MAP)
        log.metadata("scpf", {"made_by": "a test"})
    return path


def everything(path: Path) -> list[tuple[object, ...]]:
    with DriveLog(path) as log:
        found = [(m.topic, m.stamp_ns, m.sequence, m.publish_time_ns, bytes(m.raw)) for m in log.messages()]
    return sorted(found)


def test_a_sound_log_comes_back_whole(tmp_path: Path) -> None:
    source = write(tmp_path / "a.mcap")
    report = recover(source, tmp_path / "b.mcap")
    assert report.lossless
    assert report.damages == []
    assert everything(tmp_path / "b.mcap") == everything(source)
    with DriveLog(source) as old, DriveLog(tmp_path / "b.mcap") as new:
        assert new.attachments() == old.attachments() == {"map.geojson": MAP}
        assert new.metadata()["scpf"] == {"made_by": "a test"}
        assert new.origin() == old.origin()
        assert new.channels == old.channels
        assert json.loads(new.metadata()[RECOVERY_METADATA]["loss"])["complete"] is True
        assert (new.camera() is not None) and (new.trajectory() is not None)


@pytest.mark.parametrize("name", [name for name, case in cases().items() if case[1]])
def test_what_is_saved_reads(tmp_path: Path, name: str) -> None:
    data, saved, _ = cases()[name]
    (tmp_path / "a.mcap").write_bytes(data)
    recover(tmp_path / "a.mcap", tmp_path / "b.mcap")
    with DriveLog(tmp_path / "b.mcap") as log:
        payloads = [bytes(m.raw) for m in log.messages()]
    assert len(payloads) == saved
    for raw in payloads:  # each message is all of one letter
        assert len(set(raw[8:])) == 1


def test_a_damaged_chunk_costs_its_messages_and_no_others(tmp_path: Path) -> None:
    source = write(tmp_path / "a.mcap")
    data = bytearray(source.read_bytes())
    place = data.index(np.random.default_rng(5).bytes(PIECE)) + 777
    data[place] ^= 4
    source.write_bytes(data)
    report = recover(source, tmp_path / "b.mcap")
    lost = report.topics[IMAGE_TOPIC].lost
    assert 0 < lost <= 3
    assert report.messages_lost == lost
    assert (report.chunks_lost, report.lost_known, report.complete, report.lossless) == (1, True, True, False)
    assert report.topics[IMAGE_TOPIC].recovered == 12 - lost
    assert report.topics[INS_POSE_TOPIC].recovered == 12
    kept = recover(source, tmp_path / "c.mcap", keep_damaged=True)
    assert (kept.messages_lost, kept.unverified, kept.lossless) == (0, lost, False)
    with DriveLog(tmp_path / "c.mcap") as log:
        assert log.count(IMAGE_TOPIC) == 12


def test_every_chunk_explains_itself(tmp_path: Path) -> None:
    """The first chunk destroyed and the index cut off: the others still have their topics and types."""
    source = write(tmp_path / "a.mcap")
    data = bytearray(source.read_bytes())
    first = data.index(np.random.default_rng(0).bytes(PIECE))
    data[first - 300 : first + 2 * PIECE] = bytes(2 * PIECE + 300)
    source.write_bytes(data[: len(data) - 3000])
    report = recover(source, tmp_path / "b.mcap")
    assert not report.complete
    assert report.topics[IMAGE_TOPIC].recovered >= 9
    with DriveLog(tmp_path / "b.mcap") as log:
        assert next(iter(log.images())).format == "jpeg"


@pytest.mark.parametrize("share", [0.05, 0.3, 0.62, 0.97])
def test_a_log_cut_anywhere_gives_what_came_before(tmp_path: Path, share: float) -> None:
    source = write(tmp_path / "a.mcap", image_bytes=200_000)
    before = everything(source)
    data = source.read_bytes()
    source.write_bytes(data[: int(len(data) * share)])
    report = recover(source, tmp_path / "b.mcap")
    saved = everything(tmp_path / "b.mcap")
    assert set(saved) <= set(before)
    assert report.messages == len(saved) >= int(share * 12) - 1
    assert not report.complete
    assert not report.lost_known


def test_zeros_in_the_middle_are_passed_over(tmp_path: Path) -> None:
    data = bytearray(by_library(CompressionType.NONE, 200))
    data[20_000:30_000] = bytes(10_000)
    (tmp_path / "a.mcap").write_bytes(data)
    report = recover(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert report.messages + report.messages_lost == 200
    assert 20 <= report.messages_lost <= 30
    assert report.lost_known


def test_damage_everywhere_takes_no_longer_than_damage_somewhere(tmp_path: Path) -> None:
    """A bad byte after every message: each is found again, and the search for it does not go through the file."""
    head = MAGIC + record(1, text(b"ros2") + text(b"x")) + schema() + channel()
    (tmp_path / "a.mcap").write_bytes(head + (message(1, 5) + b"\xff") * 5000 + message(1, 5))
    begun_s = time.monotonic()
    report = recover(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert (report.messages, report.lost_bytes) == (5001, 5000)
    assert time.monotonic() - begun_s < 10.0


def test_records_of_others_and_several_files_in_one(tmp_path: Path) -> None:
    data, places = messages()
    one = whole([chunk(data, places)], before=record(0x90, b"private"))
    (tmp_path / "a.mcap").write_bytes(one + one)
    report = recover(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert report.messages == 10
    assert sum("kind 144" in damage.what for damage in report.damages) == 2


def test_what_is_refused(tmp_path: Path) -> None:
    source = write(tmp_path / "a.mcap", 1, 100)
    with pytest.raises(UsageError, match="the damaged file itself"):
        recover(source, source, overwrite=True)
    (tmp_path / "b.mcap").write_bytes(b"kept")
    with pytest.raises(InputError, match="exists"):
        recover(source, tmp_path / "b.mcap")
    for content, what in (
        (b"", "empty"),
        (b"#ROSBAG V2.0\n", "ROS 1 bag"),
        (bytes(5000), "not an MCAP file"),
    ):
        (tmp_path / "c.mcap").write_bytes(content)
        with pytest.raises(DamagedError, match=what):
            recover(tmp_path / "c.mcap", tmp_path / "b.mcap", overwrite=True)
    with pytest.raises(InputError, match="No such file"):
        recover(tmp_path / "nowhere.mcap", tmp_path / "d.mcap")
    assert (tmp_path / "b.mcap").read_bytes() == b"kept"
    assert not list(tmp_path.glob("*.recovering"))


def test_the_command_says_it_and_exits_3(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write(tmp_path / "a.mcap", 12, 400_000)
    assert cli.run(["recover", str(source), "-o", str(tmp_path / "b.mcap")]) == 0
    assert "nothing lost" in capsys.readouterr().out
    partial = tmp_path / "drive.mcap.partial"
    partial.write_bytes(source.read_bytes()[:3_000_000])
    assert cli.run(["recover", str(partial), "-o", str(tmp_path / "drive.mcap")]) == 3
    assert "the end of the file is missing" in capsys.readouterr().out
    assert partial.stat().st_size == 3_000_000
    arguments = [
        "recover",
        str(partial),
        "-o",
        str(tmp_path / "drive.mcap"),
        "--overwrite",
        "--format",
        "json",
    ]
    assert cli.run(arguments) == 3
    assert json.loads(capsys.readouterr().out)["topics"][IMAGE_TOPIC]["recovered"] >= 5


WRITER = """
import sys, time
from pathlib import Path
import numpy as np
from scpf.ingest.drive_log import DriveLogWriter
with DriveLogWriter(Path(sys.argv[1])) as log:
    for k in range(int(sys.argv[2])):
        log.write_image(k * 10**7, bytes([k % 256]) * 3000, "jpeg")
        log.write_pose(k * 10**7, np.eye(4))
        print(k, time.monotonic(), flush=True)
        time.sleep(0.01)
    time.sleep(60)
"""


@pytest.mark.parametrize(("count", "wait_s"), [(100_000, 2.6), (20, 1.5)], ids=["busy", "idle"])
def test_a_killed_writer_loses_at_most_its_last_second(tmp_path: Path, count: int, wait_s: float) -> None:
    path = tmp_path / "a.mcap"
    command = [sys.executable, "-c", WRITER, str(path), str(count)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        lines = [process.stdout.readline()]
        if count < 1000:
            lines += [process.stdout.readline() for _ in range(count - 1)]
        time.sleep(wait_s)
        process.send_signal(signal.SIGKILL)
        killed_s = time.monotonic()
        lines += process.stdout.readlines()
    written = [(int(line.split()[0]), float(line.split()[1])) for line in lines if line.endswith("\n")]
    report = recover(tmp_path / "a.mcap.partial", path)
    with DriveLog(path) as log:
        images = {image.stamp_ns // 10**7 for image in log.images()}
        poses = {m.stamp_ns // 10**7 for m in log.messages([INS_POSE_TOPIC])}
    due = {k for k, written_s in written if written_s < killed_s - 1.0}
    assert len(due) >= min(count, 50)
    assert due <= images
    assert due <= poses
    assert report.messages >= 3 * len(due)
    assert not report.complete


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads the peak of a child")
def test_memory_stays_bounded(tmp_path: Path) -> None:
    """400 MB in one chunk, plain and packed, take less than 300 MB."""
    source = tmp_path / "a.mcap"
    with DriveLogWriter(source) as log:
        log.mcap._streams["image"].limit_bytes = log.mcap._streams["small"].limit_bytes = 1 << 40
        log.mcap._flushed_s = time.monotonic() + 1e6
        for k in range(100):
            log.write_image(T0 + k * STEP, bytes(2_000_000), "jpeg")
            log.mcap.add_message(_raw(log), T0 + k * STEP, bytes(2_000_000), 0, k)
    code = "import sys; from pathlib import Path; from scpf.ingest.recover import recover; "
    code += "assert recover(Path(sys.argv[1]), Path(sys.argv[2])).messages == 200; "
    code += "print(Path('/proc/self/status').read_text())"
    command = [sys.executable, "-c", code, str(source), str(tmp_path / "b.mcap")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    peak = re.search(r"VmHWM:\s+(\d+) kB", done.stdout)
    assert peak is not None
    assert int(peak[1]) < 300_000


def _raw(log: DriveLogWriter) -> int:
    known = {channel.topic: key for key, channel in log.mcap._channels.items()}
    return known.get("/raw") or log.mcap.add_channel("/raw", "", b"", message_encoding="json")
