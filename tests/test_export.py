"""Export: real drives become drive logs, and their trajectories come back as they went in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scpf.ingest.drive_log import DriveLogWriter
from scpf.ingest.oxts import read_oxts
from scpf.ingest.trajectories import read_trajectory
from scpf.ingest.trajectory_writers import write_euroc, write_kitti
from scpf.models.camera import Camera, looking_ahead
from scpf.models.errors import InputError
from scpf.models.geodesy import Origin
from scpf.models.trajectory import Trajectory
from scpf.replay import cli

T0 = 1_660_847_613_703_000_001


def same(one: Trajectory, other: Trajectory, metres: float = 1e-6) -> None:
    np.testing.assert_array_equal(one.stamps_ns, other.stamps_ns)
    np.testing.assert_allclose(one.positions_m, other.positions_m, rtol=0, atol=metres)
    np.testing.assert_allclose(one.poses(), other.poses(), rtol=0, atol=1e-6)


def a_trajectory(count: int = 6, start_ns: int = T0) -> Trajectory:
    rng = np.random.default_rng(3)
    stamps = start_ns + np.arange(count) * 100_000_000
    return Trajectory(
        stamps, rng.normal(size=(count, 3)) * 1e4, Rotation.random(count, random_state=rng).as_quat()
    )


@pytest.mark.parametrize("start_ns", [0, T0])
def test_euroc_round_trips(tmp_path: Path, start_ns: int) -> None:
    write_euroc(tmp_path / "a.csv", a_trajectory(start_ns=start_ns))
    same(a_trajectory(start_ns=start_ns), read_trajectory(tmp_path / "a.csv"), 1e-8)
    with pytest.raises(InputError, match="exists"):
        write_euroc(tmp_path / "a.csv", a_trajectory())


def test_euroc_s_own_state_estimates_are_read(tmp_path: Path) -> None:
    heading = "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], …\n"
    row = (
        "1403636580838555648,4.688319,-1.786938,0.783338,0.534108,-0.153029,-0.827383,-0.082152" + ",0.1" * 9
    )
    (tmp_path / "data.csv").write_text(heading + row + "\n", encoding="utf-8")
    found = read_trajectory(tmp_path / "data.csv")
    assert found.stamps_ns[0] == 1403636580838555648
    np.testing.assert_allclose(
        found.quaternions_xyzw[0], [-0.153029, -0.827383, -0.082152, 0.534108], atol=1e-6
    )
    (tmp_path / "data.csv").write_text(row.replace("1403636580838555648", "1403636580.8"), encoding="utf-8")
    with pytest.raises(InputError, match="no time in ns"):
        read_trajectory(tmp_path / "data.csv")


def test_kitti_poses_round_trip_through_any_mount(tmp_path: Path) -> None:
    mount = looking_ahead()
    mount[:3, 3] = 1.7, 0.2, 1.4
    write_kitti(tmp_path / "poses.txt", a_trajectory(), mount)
    back = read_trajectory(tmp_path / "poses.txt", stamps_ns=a_trajectory().stamps_ns, T_body_camera=mount)
    same(a_trajectory(), back)


@pytest.fixture
def log_path(tmp_path: Path) -> Path:
    path = tmp_path / "drive.mcap"
    with DriveLogWriter(path) as log:
        log.write_camera(T0, Camera(640, 480, np.array([[700.0, 0, 320], [0, 700, 240], [0, 0, 1]])))
        for k in range(5):
            log.write_pose(T0 + k * 10**8, np.diag([1.0, 1, 1, 1]) + np.eye(4, k=3) * k)
            log.write_image(T0 + k * 10**8 + 50_000_000, b"x", "jpeg")
    return path


def test_poses_at_the_images(log_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.tum"
    assert cli.run(["export", str(log_path), "--trajectory", str(out)]) == 0
    assert len(read_trajectory(out)) == 5
    assert cli.run(["export", str(log_path), "--trajectory", str(out), "--at-images"]) == 1
    assert "exists" in capsys.readouterr().err
    # The last image comes after the last pose.
    assert cli.run(["export", str(log_path), "--trajectory", str(out), "--at-images", "--overwrite"]) == 3
    assert "1 images without a reference pose" in capsys.readouterr().out
    np.testing.assert_allclose(read_trajectory(out).positions_m[:, 0], [0.5, 1.5, 2.5, 3.5], atol=1e-9)
    assert cli.run(["export", str(log_path), "--trajectory", str(tmp_path / "a.xyz")]) == 2
    assert "--format" in capsys.readouterr().err


def test_a_log_without_a_reference_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with DriveLogWriter(tmp_path / "a.mcap"):
        pass
    assert cli.run(["export", str(tmp_path / "a.mcap"), "--trajectory", str(tmp_path / "a.tum")]) == 1
    assert "no reference trajectory" in capsys.readouterr().err


def test_kitti_06_comes_back(shared_data: Path, tmp_path: Path) -> None:
    source, log = shared_data / "kitti_06", tmp_path / "kitti.mcap"
    arguments = ["ingest", source / "image_l", "-o", log, "--calibration", source / "calib.txt", "--rate", 10]
    arguments += ["--trajectory", source / "poses.txt", "-q"]
    assert cli.run([str(word) for word in arguments]) == 0
    for name in ("a.tum", "a.csv", "poses.txt"):
        assert cli.run(["export", str(log), "--trajectory", str(tmp_path / name)]) == 0
    stamps = np.arange(51) * 10**8
    truth = read_trajectory(source / "poses.txt", stamps_ns=stamps)
    same(truth, read_trajectory(tmp_path / "a.tum"))
    same(truth, read_trajectory(tmp_path / "a.csv"))
    rows, original = np.loadtxt(tmp_path / "poses.txt"), np.loadtxt(source / "poses.txt")
    np.testing.assert_allclose(rows[:, 3::4], original[:, 3::4], rtol=0, atol=1e-6)
    np.testing.assert_allclose(rows, original, rtol=0, atol=1e-6)


def test_kitti_raw_0002_comes_back(shared_data: Path, tmp_path: Path) -> None:
    source, log = shared_data / "kitti_raw_0002", tmp_path / "raw.mcap"
    for part in ("oxts", "image_02"):  # the first ten of 77
        (tmp_path / part).mkdir()
        lines = (source / part / "timestamps.txt").read_text().splitlines()[:10]
        (tmp_path / part / "timestamps.txt").write_text("\n".join(lines))
    (tmp_path / "oxts" / "data").symlink_to(source / "oxts" / "data")
    arguments = ["ingest", source / "image_02" / "data", "-o", log]
    arguments += ["--calibration", source / "calib_cam_to_cam.txt", "--calib-row", 2]
    arguments += [
        "--timestamps",
        tmp_path / "image_02" / "timestamps.txt",
        "--trajectory",
        tmp_path / "oxts",
        "-q",
    ]
    assert cli.run([str(word) for word in arguments]) == 0
    assert cli.run(["export", str(log), "--trajectory", str(tmp_path / "a.tum")]) == 0
    same(read_oxts(tmp_path).trajectory, read_trajectory(tmp_path / "a.tum"))


def test_boreas_comes_back(shared_data: Path, tmp_path: Path) -> None:
    from pyproj import Transformer

    from scpf.ingest.boreas import read
    from scpf.ingest.read_report import ReadOptions
    from scpf.models.geodesy import geodetic_from_enu

    folder = shared_data / "boreas" / "boreas-2021-08-05-13-34" / "applanix"
    lines = (folder / "camera_poses.csv").read_text().splitlines()[:2001]
    (tmp_path / "poses.csv").write_text("\n".join(lines) + "\n")
    navigation = read(tmp_path / "poses.csv", ReadOptions(utm_zone="17N"))
    origin: Origin = navigation.origin()
    truth = navigation.to_trajectory(origin)
    with DriveLogWriter(tmp_path / "boreas.mcap", origin=origin) as log:
        for stamp, pose in zip(truth.stamps_ns, truth.poses(), strict=True):
            log.write_pose(int(stamp), pose)
    assert cli.run(["export", str(tmp_path / "boreas.mcap"), "--trajectory", str(tmp_path / "a.tum")]) == 0
    back = read_trajectory(tmp_path / "a.tum")
    same(truth, back)
    # Also against the file itself: time, easting, northing, altitude.
    rows = np.loadtxt(tmp_path / "poses.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(back.stamps_ns, rows[:, 0].astype(np.int64) * 1000)
    latitude, longitude, height = geodetic_from_enu(back.positions_m, origin)
    east, north = Transformer.from_crs(4326, 32617, always_xy=True).transform(longitude, latitude)
    np.testing.assert_allclose(np.column_stack([east, north, height]), rows[:, 1:4], rtol=0, atol=1e-6)
