"""Doctor: every fault that is put into a log is found, named with a remedy, and the others are, too."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scpf.ingest import messages
from scpf.ingest.doctor import Examination, examine
from scpf.ingest.drive_log import GPS_POSE_TOPIC, IMAGE_TOPIC, INS_POSE_TOPIC, DriveLog, DriveLogWriter
from scpf.ingest.maps import encode_map
from scpf.models.camera import Camera
from scpf.models.errors import DamagedError
from scpf.models.road_map import Landmark, RoadMap
from scpf.replay import cli, machine

T0 = 1_660_847_613_000_000_000
STEP = 100_000_000
MATRIX = np.array([[70.0, 0, 32], [0, 70, 24], [0, 0, 1]])


def picture(k: int, size: tuple[int, int] = (64, 48)) -> bytes:
    out = io.BytesIO()
    pixels = np.random.default_rng(k).integers(0, 255, (size[1], size[0], 3), dtype=np.uint8)
    Image.fromarray(pixels).save(out, "JPEG")
    return out.getvalue()


def pose(x: float, y: float = 0.0) -> np.ndarray:
    transform = np.eye(4)
    transform[:2, 3] = x, y
    return transform


def build(
    path: Path,
    fault: Callable[[DriveLogWriter, int], bool] = lambda log, k: False,
    landmark: tuple[float, float, float] = (10.0, 5.0, 0.0),
    without: tuple[str, ...] = (),
) -> Path:
    """A sound log of 30 frames; ``fault`` writes something else at a frame and says so, ``without`` leaves out."""
    with DriveLogWriter(path) as log:
        if "camera" not in without:
            log.write_camera(T0, Camera(64, 48, MATRIX))
        for k in range(30):
            if fault(log, k):
                continue
            if "images" not in without:
                log.write_image(T0 + k * STEP, picture(k), "jpeg")
            if "reference" not in without:
                log.write_pose(T0 + k * STEP, pose(k))
            log.write_gps(T0 + k * STEP, np.array([k, 0.0]), 4.0)
        if "map" not in without:
            road_map = RoadMap((Landmark("a", landmark),), np.zeros((0, 2)))
            log.attach("map.geojson", "application/geo+json", encode_map(road_map))
    return path


def found(examination: Examination, severity: str, about: str, what: str) -> bool:
    return any(
        (finding.severity, finding.about) == (severity, about) and what in finding.message and finding.remedy
        for finding in examination.findings
    )


def test_a_sound_log_is_fine(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = build(tmp_path / "a.mcap")
    assert examine(path, deep=True).findings == []
    assert cli.run(["doctor", str(path)]) == 0
    assert "nothing found" in capsys.readouterr().out


def test_the_sample_drive_has_one_dropped_frame() -> None:
    sample = Path(__file__).parent.parent / "sample_logs" / "ring_road.mcap"
    findings = [finding for finding in examine(sample, deep=True).findings if finding.severity != "note"]
    assert all("gap" in finding.message for finding in findings)


@pytest.mark.parametrize(
    ("missing", "severity", "about", "what"),
    [
        ("camera", "error", "calibration", "no calibration"),
        ("map", "error", "map.geojson", "no map"),
        ("images", "error", IMAGE_TOPIC, "no images"),
        ("reference", "warning", INS_POSE_TOPIC, "no reference"),
    ],
)
def test_what_is_missing(tmp_path: Path, missing: str, severity: str, about: str, what: str) -> None:
    examination = examine(build(tmp_path / "a.mcap", without=(missing,)))
    assert found(examination, severity, about, what)
    assert not examination.fine


def write_frame(log: DriveLogWriter, k: int, *, at_ns: int | None = None, data: bytes | None = None) -> None:
    at_ns = T0 + k * STEP if at_ns is None else at_ns
    log.write_image(at_ns, picture(k) if data is None else data, "jpeg")
    log.write_pose(T0 + k * STEP, pose(k))
    log.write_gps(T0 + k * STEP, np.array([k, 0.0]), 4.0)


def header_back(log: DriveLogWriter, k: int) -> bool:
    """Frame 12 bears the time of 10.5, in its header alone."""
    if k != 12:
        return False
    header = messages.to_header(T0 + 10 * STEP + STEP // 2, "camera")
    data = np.frombuffer(picture(k), dtype=np.uint8)
    image = messages.make("sensor_msgs/msg/CompressedImage", header=header, format="jpeg", data=data)
    log.write_message(IMAGE_TOPIC, "sensor_msgs/msg/CompressedImage", image, T0 + k * STEP)
    log.write_pose(T0 + k * STEP, pose(k))
    return True


def numbers_back(log: DriveLogWriter, k: int) -> bool:
    if k == 12:
        log._sequences[IMAGE_TOPIC] = 3
    return False


def numbers_missing(log: DriveLogWriter, k: int) -> bool:
    if k == 12:
        log._sequences[IMAGE_TOPIC] += 5
    return False


def at_12(**options: object) -> Callable[[DriveLogWriter, int], bool]:
    def fault(log: DriveLogWriter, k: int) -> bool:
        if k == 12:
            write_frame(log, k, **options)  # type: ignore[arg-type]
        return k == 12

    return fault


def jump(log: DriveLogWriter, k: int) -> bool:
    if k == 12:
        log.write_image(T0 + k * STEP, picture(k), "jpeg")
        log.write_pose(T0 + k * STEP, pose(k, 7.0))
        log.write_gps(T0 + k * STEP, np.array([k, 0.0]), 4.0)
    return k == 12


@pytest.mark.parametrize(
    ("fault", "severity", "about", "what"),
    [
        (lambda log, k: k in (11, 12), "warning", IMAGE_TOPIC, "1 gap, about 2 messages missing"),
        (lambda log, k: k in (11, 12, 13), "warning", GPS_POSE_TOPIC, "1 gap, about 3 messages"),
        (header_back, "warning", IMAGE_TOPIC, "the time goes backwards at 1 place, by 0.050"),
        (numbers_back, "warning", IMAGE_TOPIC, "do not increase at 1 place"),
        (numbers_missing, "warning", IMAGE_TOPIC, "5 sequence numbers missing"),
        (at_12(at_ns=T0 + 11 * STEP), "warning", IMAGE_TOPIC, "1 time given to more than one image"),
        (at_12(data=picture(11)), "warning", IMAGE_TOPIC, "1 image the same as the one before"),
        (at_12(data=b"no image"), "error", IMAGE_TOPIC, "1 image cannot be read"),
        (at_12(data=picture(12, (32, 24))), "error", IMAGE_TOPIC, "several sizes"),
        (at_12(at_ns=T0 + 31 * STEP), "warning", INS_POSE_TOPIC, "1 of 30 images lie outside the reference"),
        (jump, "warning", INS_POSE_TOPIC, "the reference jumps at 2 places; by 7.07 m"),
    ],
)
def test_each_fault_is_found(
    tmp_path: Path, fault: Callable[[DriveLogWriter, int], bool], severity: str, about: str, what: str
) -> None:
    examination = examine(build(tmp_path / "a.mcap", fault))
    assert found(examination, severity, about, what), examination.findings


def test_a_truncated_image_needs_a_deep_look(tmp_path: Path) -> None:
    path = build(tmp_path / "a.mcap", at_12(data=picture(12)[:900]))
    assert examine(path).fine
    assert found(examine(path, deep=True), "error", IMAGE_TOPIC, "1 image cannot be read")


def test_another_size_and_a_map_elsewhere(tmp_path: Path) -> None:
    path = build(tmp_path / "a.mcap", landmark=(5e5, 5e6, 0.0), without=("camera",))
    assert found(examine(path), "error", "map.geojson", "never comes nearer than")

    def small(log: DriveLogWriter, k: int) -> bool:
        write_frame(log, k, data=picture(k, (32, 24)))
        return True

    path = build(tmp_path / "b.mcap", small)
    assert found(examine(path), "error", IMAGE_TOPIC, "the calibration is for 64×48 px")


def test_clocks_that_share_no_time(tmp_path: Path) -> None:
    def late(log: DriveLogWriter, k: int) -> bool:
        write_frame(log, k, at_ns=T0 + (k + 10**5) * STEP)
        return True

    assert found(examine(build(tmp_path / "a.mcap", late)), "error", INS_POSE_TOPIC, "30 of 30 images")


def test_damage_and_unknown_types_do_not_hide_the_rest(tmp_path: Path) -> None:
    def strange(log: DriveLogWriter, k: int) -> bool:
        if k == 5:
            odd = log.mcap.add_channel("/odd", "odd_msgs/msg/Odd", b"no such type x\n")
            log.mcap.add_message(odd, T0, b"\0\1\0\0\1", T0, 0)
            plain = log.mcap.add_channel("/json", "", b"", message_encoding="json")
            log.mcap.add_message(plain, T0, b"{}", T0, 0)
            wrong = log.mcap.add_channel("/wrong", "std_msgs/msg/String", b"string data\n")
            log.mcap.add_message(wrong, T0, b"\0\1\0\0\xff\xff\xff\xff", T0, 0)
        return k in (20, 21, 22)

    path = build(tmp_path / "a.mcap", strange)
    data = bytearray(path.read_bytes())
    place = data.index(b'"FeatureCollection"')
    data[place + 3] ^= 1
    data[data.index(picture(3)[300:400])] ^= 1
    path.write_bytes(data)
    examination = examine(path)
    assert found(examination, "error", IMAGE_TOPIC, "checksum")
    assert found(examination, "error", "map.geojson", "checksum")
    assert found(examination, "warning", "/odd", "definition of odd_msgs/msg/Odd")
    assert found(examination, "warning", "/wrong", "1 of 1 messages cannot be decoded")
    assert found(examination, "note", "/json", "not read")
    assert found(examination, "warning", GPS_POSE_TOPIC, "1 gap, about 3 messages")
    assert [finding.severity for finding in examination.findings] == sorted(
        (finding.severity for finding in examination.findings), key=["error", "warning", "note"].index
    )
    told = [(finding.about, finding.message) for finding in examination.findings]
    assert len(told) == len(set(told))


def test_the_exit_codes_and_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = build(tmp_path / "a.mcap", without=("map",))
    assert cli.run(["doctor", str(path), "--format", "json"]) == 3
    report = json.loads(capsys.readouterr().out)
    assert report["findings"][0]["severity"] == "error"
    assert report["fine"] is False
    path.write_bytes(path.read_bytes()[:-50])
    assert cli.run(["doctor", str(path)]) == 1
    assert "scpf recover" in capsys.readouterr().err
    with pytest.raises(DamagedError):
        examine(tmp_path / "nowhere.mcap")


def test_the_machine(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "_load_polenet", lambda folder: None)
    monkeypatch.setattr(machine, "_load_distance", lambda folder: None)
    assert cli.run(["doctor", "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["versions"]["numpy"]
    versions = {"numpy": "1.0.0", "mcap": "", "av": ""}
    monkeypatch.setattr(machine, "_version", lambda name: versions.get(name, machine.TESTED.get(name, "")))
    assert cli.run(["doctor"]) == 3
    text = capsys.readouterr().out
    assert "error    mcap: not installed" in text
    assert "note     numpy: 1.0.0, tested is" in text
    assert "scpf[video]" in text


def test_the_tested_versions_are_of_packages_that_are_required() -> None:
    import re
    import tomllib

    project = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text())["project"]
    names = {re.split(r"[<>=~\[;]", line)[0].strip() for line in project["dependencies"]}
    assert names == set(machine.TESTED)
    for name, (_, remedy) in machine.OPTIONAL.items():
        extra = re.search(r"scpf\[(\w+)\]", remedy)
        assert extra is not None
        assert any(line.startswith(name) for line in project["optional-dependencies"][extra[1]])


def test_a_log_is_not_changed_by_looking(tmp_path: Path) -> None:
    path = build(tmp_path / "a.mcap")
    before = path.read_bytes()
    examine(path, deep=True)
    assert path.read_bytes() == before
    with DriveLog(path) as log:
        assert log.count(IMAGE_TOPIC) == 30
