"""The raw files of ``scpf simulate``: ingested or converted, each gives the drive that was written directly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scpf.ingest.drive_log import DriveLog
from scpf.replay.cli import run
from scpf.sample_logs import simulated_raw
from scpf.sample_logs.drive_frames import SimulatedDrive
from scpf.sample_logs.finished_frames import FinishedFrame, encode_jpeg

Poses = NDArray[np.float64]

INS_LOGS = {
    # options, and how far the pose at a frame may be from that of the direct log, in m and degrees
    "sbet.out": (["--gps-date", "2022-08-18", "--smrmsg", "smrmsg.out"], 1e-3, 0.01),
    "lvx.gsof": ([], 1e-5, 1e-5),
    "poslv.pcap": ([], 1e-5, 1e-5),
    "ins.nmea": ([], 5e-3, 0.05),
}
"""GSOF and $GRP have the direct log's own moments; NMEA has ten a second and few decimals, SBET 200 a second."""


def poses_at_frames(log: DriveLog) -> Poses:
    """Poses (N, 4, 4) of the reference at the pictures."""
    trajectory = log.trajectory()
    assert trajectory is not None
    found = [trajectory.at(image.stamp_ns) for image in log.images()]
    assert all(pose is not None for pose in found)
    return np.array(found)


def assert_same_drive(
    path: Path, direct: Path, metres: float, degrees: float, rectified: bool = False
) -> None:
    with DriveLog(path) as found, DriveLog(direct) as expected:
        camera, mine = found.camera(), expected.camera()
        assert camera is not None and mine is not None
        np.testing.assert_allclose(camera.matrix, mine.matrix, rtol=1e-12)
        np.testing.assert_allclose(camera.T_body_camera, mine.T_body_camera, atol=1e-9)
        np.testing.assert_allclose(camera.distortion, 0.0 if rectified else mine.distortion, atol=1e-12)
        images = [(image.stamp_ns, b"" if rectified else bytes(image.data)) for image in found.images()]
        originals = [(image.stamp_ns, b"" if rectified else bytes(image.data)) for image in expected.images()]
        assert images == originals and len(images) == 27
        assert found.origin() == expected.origin()
        assert found.attachments()["map.geojson"] == expected.attachments()["map.geojson"]
        poses, truth = poses_at_frames(found), poses_at_frames(expected)
    assert np.linalg.norm(poses[:, :3, 3] - truth[:, :3, 3], axis=1).max() < metres
    turned = Rotation.from_matrix(np.swapaxes(truth[:, :3, :3], 1, 2) @ poses[:, :3, :3]).magnitude()
    assert np.degrees(turned).max() < degrees


@pytest.mark.parametrize(("trajectory", "given"), INS_LOGS.items())
@pytest.mark.parametrize("pictures", ["basler", "drive.mp4"])
def test_ingested_raw_files_are_the_direct_drive(
    simulated: Path, tmp_path: Path, trajectory: str, given: tuple[list[str], float, float], pictures: str
) -> None:
    raw, (more, metres, degrees) = simulated / "raw", given
    command = ["ingest", str(raw / pictures), "-o", str(tmp_path / "a.mcap"), "-q"]
    command += ["--calibration", str(raw / "camera.yaml"), "--map", str(raw / "map.geojson")]
    command += ["--timestamps", str(raw / f"{Path(pictures).stem}_times.csv")]
    command += ["--trajectory", str(raw / trajectory)]
    command += [str(raw / word) if word.endswith(".out") else word for word in more]
    assert run(command) == 0
    assert_same_drive(tmp_path / "a.mcap", simulated / "drive.mcap", metres, degrees)


@pytest.mark.parametrize("bag", ["drive.bag", "drive_ros2"])
def test_converted_bags_are_the_direct_drive_but_for_the_lens(
    simulated: Path, tmp_path: Path, bag: str
) -> None:
    raw = simulated / "raw"
    command = ["convert", str(raw / bag), "-o", str(tmp_path / "a.mcap"), "--map", str(raw / "map.geojson")]
    assert run([*command, "--verify", "-q"]) == 0
    assert_same_drive(tmp_path / "a.mcap", simulated / "drive.mcap", 1e-5, 1e-5, rectified=True)


def test_an_existing_folder_is_refused_before_anything_is_rendered(
    simulated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["simulate", "-o", str(tmp_path / "a.mcap"), "--width", "64", "--duration", "1", "-q"]
    assert run([*command, "--overwrite", "--raw", str(simulated / "raw")]) == 1
    assert "raw exists" in capsys.readouterr().err
    assert run([*command, "--raw", str(tmp_path / "none" / "raw")]) == 1
    assert "no folder" in capsys.readouterr().err
    assert not any(tmp_path.iterdir())
    assert (simulated / "raw" / "sbet.out").exists()


def test_without_pyav_the_video_alone_is_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    jpeg = encode_jpeg(np.zeros((48, 64, 3), np.uint8), 85)
    monkeypatch.setattr(simulated_raw, "find_spec", lambda name: None)
    monkeypatch.setattr(
        SimulatedDrive, "__call__", lambda drive: lambda index: FinishedFrame(jpeg, 64, 48, ())
    )
    raw = tmp_path / "raw"
    raw.mkdir()  # an empty folder is as good as none
    command = ["simulate", "-o", str(tmp_path / "a.mcap"), "--width", "64", "--duration", "1", "--seed", "1"]
    assert run([*command, "--workers", "1", "--raw", str(raw), "-q"]) == 3
    assert "left out: drive.mp4" in capsys.readouterr().out
    names = {path.name for path in raw.iterdir()}
    assert {"basler", "drive.bag", "drive_ros2", "ins.nmea", "camera.yaml"} < names
    assert not any(name.endswith(".mp4") for name in names) and "drive_times.csv" not in names
