"""What ``scpf info`` says of a log."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from scpf.ingest.drive_log import IMAGE_TOPIC, INS_POSE_TOPIC, DriveLogWriter
from scpf.ingest.inspect import inspect
from scpf.models.camera import Camera
from scpf.models.errors import DamagedError
from scpf.models.geodesy import Origin
from scpf.replay import ingest_commands

T0 = 1_660_847_613_000_000_000


@pytest.fixture
def log_path(tmp_path: Path) -> Path:
    path = tmp_path / "drive.mcap"
    with DriveLogWriter(path, origin=Origin(43.0, -80.0, 300.0)) as log:
        log.write_camera(T0, Camera(640, 480, np.array([[700.0, 0, 320], [0, 700, 240], [0, 0, 1]])))
        for k in range(21):
            stamp_ns = T0 + k * 10**8 + (10**9 if k > 10 else 0)
            log.write_image(stamp_ns, bytes([k]) * 1000, "jpeg")
            log.write_pose(stamp_ns, np.eye(4))
        log.attach("map.geojson", "application/geo+json", b'{"type": "FeatureCollection", "features": []}')
    return path


def test_counts_rates_and_gaps(log_path: Path) -> None:
    info = inspect(log_path)
    assert info.findings == []
    assert info.duration_s == pytest.approx(3.0)
    topic = next(topic for topic in info.topics if topic.topic == IMAGE_TOPIC)
    assert (topic.count, topic.first_ns, topic.last_ns) == (21, T0, T0 + 3 * 10**9)
    assert topic.rate_hz == pytest.approx(20 / 3)
    assert topic.largest_gap_s == pytest.approx(1.1)
    assert topic.largest_gap_at_ns == T0 + 10**9
    assert info.attachments == {"map.geojson": 45}
    assert (info.landmarks, info.origin) == (0, (43.0, -80.0, 300.0))
    assert info.camera.startswith("640×480 px")


def test_damage_inside_is_found_and_the_rest_is_shown(
    log_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = bytearray(log_path.read_bytes())
    place = data.index(bytes([5]) * 1000)
    data[place + 10] ^= 1
    log_path.write_bytes(data)
    info = inspect(log_path)
    assert any("checksum" in finding and IMAGE_TOPIC in finding for finding in info.findings)
    assert next(topic for topic in info.topics if topic.topic == INS_POSE_TOPIC).count == 21
    assert ingest_commands.info(log_path) == 3
    assert "damaged:" in capsys.readouterr().out


def test_text_and_json_say_the_same(log_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert ingest_commands.info(log_path, format="json") == 0
    document = json.loads(capsys.readouterr().out)
    assert document["messages"] == sum(topic["count"] for topic in document["topics"])
    assert ingest_commands.info(log_path) == 0
    text = capsys.readouterr().out
    for topic in document["topics"]:
        assert topic["topic"] in text


def test_what_is_no_log_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(DamagedError, match="cannot be opened"):
        inspect(tmp_path / "nowhere.mcap")


def test_a_log_of_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with DriveLogWriter(tmp_path / "a.mcap"):
        pass
    assert ingest_commands.info(tmp_path / "a.mcap") == 0
    assert "0 messages" in capsys.readouterr().out


def test_names_out_of_files_do_not_command_the_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with DriveLogWriter(tmp_path / "a.mcap") as log:
        log.mcap.add_channel("/\x1b[2J\x07" + "long" * 1000, "std_msgs/msg/Int32", b"int32 data\n")
    ingest_commands.info(tmp_path / "a.mcap")
    text = capsys.readouterr().out
    assert "\x1b" not in text
    assert "\x07" not in text
    assert len(text) < 3000
