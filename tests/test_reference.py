"""``scpf ingest`` with an Applanix log: camera and reference in one drive log, native fields beside them."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from applanix_encoders import LEAP, drive, gsof, sbet
from navigation_text_encoders import nmea

from scpf.ingest.calibration import to_yaml
from scpf.ingest.drive_log import DriveLog
from scpf.ingest.maps import write_map
from scpf.models.camera import Camera
from scpf.models.geodesy import Origin, enu_from_geodetic
from scpf.models.road_map import Landmark, RoadMap
from scpf.replay.cli import run

DRIVE = drive(60)
START_NS = int(DRIVE.unix_s[0]) * 10**9
ORIGIN = Origin(43.4720, -80.5450, 300.0)


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """Ten images in the middle of the drive, a calibration, a map, and the drive as SBET, GSOF and NMEA."""
    images = tmp_path / "images"
    images.mkdir()
    stamps = START_NS + 2 * 10**9 + np.arange(10) * 77_000_000
    for k in range(10):
        cv2.imwrite(str(images / f"{k}.png"), np.full((24, 32, 3), 20 * k, np.uint8))
    (tmp_path / "times.txt").write_text("\n".join(map(str, stamps)) + "\n")
    camera = Camera(32, 24, np.array([[30.0, 0, 16], [0, 30, 12], [0, 0, 1]]))
    (tmp_path / "camera.yaml").write_bytes(to_yaml(camera))
    line = np.column_stack([np.linspace(-20, 80, 6), np.linspace(-10, 40, 6)])
    write_map(tmp_path / "map.geojson", RoadMap((Landmark("P1", (40.0, 12.0, 0.0)),), line, 4.0, ORIGIN))
    (tmp_path / "drive.sbet").write_bytes(sbet(DRIVE))
    (tmp_path / "drive.gsof").write_bytes(gsof(DRIVE))
    (tmp_path / "drive.nmea").write_bytes(nmea(DRIVE))
    return tmp_path


def ingest(folder: Path, *options: str) -> int:
    tokens = [
        "ingest",
        str(folder / "images"),
        "-o",
        str(folder / "drive.mcap"),
        "--overwrite",
        "--format",
        "json",
    ]
    tokens += ["--calibration", str(folder / "camera.yaml"), "--timestamps", str(folder / "times.txt")]
    return run([*tokens, *options])


@pytest.mark.parametrize(
    ("name", "options"),
    [("drive.sbet", ["--gps-date", "2021-06-15"]), ("drive.gsof", []), ("drive.nmea", [])],
)
def test_every_format_gives_the_same_drive(
    files: Path, name: str, options: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    code = ingest(files, "--trajectory", str(files / name), "--map", str(files / "map.geojson"), *options)
    report = json.loads(capsys.readouterr().out)
    assert code == 0, report
    assert report["frames"] == 10
    assert report["frames_without_pose"] == 0
    assert name.split(".")[1] in report["reference"]["notes"][0]
    with DriveLog(files / "drive.mcap") as log:
        assert log.origin() == ORIGIN
        trajectory = log.trajectory()
        assert trajectory is not None
        expected = enu_from_geodetic(DRIVE.latitude, DRIVE.longitude, DRIVE.height, ORIGIN)
        for stamp, position in zip(trajectory.stamps_ns, trajectory.positions_m, strict=True):
            k = round((int(stamp) - START_NS) / 1e8)
            np.testing.assert_allclose(position, expected[k], atol=0.03)
        heading = np.degrees(np.arctan2(*trajectory.poses()[0][:2, 0][::1]))
        assert heading == pytest.approx(70.0, abs=0.1)
        assert log.channels["/ins/native"].count >= len(trajectory)
        native = next(log.messages(["/ins/native"])).message
        assert len(native.names) == len(native.units) == len(native.values)
        assert [image.stamp_ns for image in log.images()] == sorted(image.stamp_ns for image in log.images())


def test_a_local_map_and_a_mistaken_clock_are_refused(
    files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (files / "local.geojson").unlink(missing_ok=True)
    write_map(files / "local.geojson", RoadMap((Landmark("P1", (4.0, 1.0, 0.0)),), np.zeros((0, 2))))
    gsof_file = str(files / "drive.gsof")
    assert ingest(files, "--trajectory", gsof_file, "--map", str(files / "local.geojson")) == 1
    assert "local frame" in capsys.readouterr().err
    assert ingest(files, "--trajectory", gsof_file, "--leap-seconds", str(LEAP + 3600)) == 1
    assert "share no time" in capsys.readouterr().err
    assert ingest(files, "--trajectory", str(files / "drive.sbet")) == 1
    assert "week" in capsys.readouterr().err


def test_damage_is_reported_and_is_exit_3(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = bytearray((files / "drive.gsof").read_bytes())
    data[len(data) // 2] ^= 0xFF
    (files / "damaged.gsof").write_bytes(data)
    assert ingest(files, "--trajectory", str(files / "damaged.gsof")) == 3
    report = json.loads(capsys.readouterr().out)
    assert report["reference"]["bad_checksums"] or report["reference"]["skipped_bytes"]
    assert not report["lossless"]


def test_without_images_the_reference_alone_becomes_a_log(
    files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = files / "reference.mcap"
    assert run(["ingest", "-o", str(output), "--trajectory", str(files / "drive.gsof")]) == 0
    assert "60 reference poses" in capsys.readouterr().out
    with DriveLog(output) as log:
        assert log.count("/ins/pose") == 60
    assert run(["ingest", "-o", str(output)]) == 2
    assert run(["ingest", str(files / "images"), "-o", str(output)]) == 2
