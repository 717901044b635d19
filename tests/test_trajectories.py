"""Trajectory files: TUM both ways, KITTI poses into the body frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scpf.ingest.trajectories import poses_from_kitti, read_trajectory, write_tum
from scpf.models.camera import looking_ahead
from scpf.models.errors import InputError, MissingError
from scpf.models.trajectory import Trajectory

STAMPS = np.array([1_660_847_613_703_000_001, 1_660_847_613_780_000_000, 1_660_847_613_857_123_456])


def a_trajectory() -> Trajectory:
    quaternions = Rotation.from_euler("ZYX", [[10, 2, 3], [170, 0, 0], [-90, -5, 1]], degrees=True).as_quat()
    return Trajectory(STAMPS, np.array([[1.0, 2, 3], [4, 5, 6.5], [-7e5, 8, 9]]), quaternions)


def kitti_row(pose: np.ndarray) -> str:
    return " ".join(f"{value:.9e}" for value in pose[:3].ravel())


def test_tum_round_trips(tmp_path: Path) -> None:
    path = tmp_path / "a.tum"
    write_tum(path, a_trajectory())
    back = read_trajectory(path)
    np.testing.assert_array_equal(back.stamps_ns, STAMPS)
    np.testing.assert_allclose(back.poses(), a_trajectory().poses(), atol=1e-8)
    with pytest.raises(InputError, match="exists"):
        write_tum(path, a_trajectory())


def test_a_camera_that_moves_ahead_moves_the_body_along_x(tmp_path: Path) -> None:
    step = np.eye(4)
    step[2, 3] = 2.0  # z of the camera is ahead
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_euler(
        "y", -30, degrees=True
    ).as_matrix()  # about −y of the camera: to the left
    path = tmp_path / "poses.txt"
    path.write_text("\n".join([kitti_row(np.eye(4)), kitti_row(step), kitti_row(turn)]))
    poses = read_trajectory(path, stamps_ns=STAMPS).poses()
    np.testing.assert_allclose(poses[0], np.eye(4), atol=1e-9)
    np.testing.assert_allclose(poses[1][:3, 3], [2.0, 0.0, 0.0], atol=1e-9)
    assert np.degrees(np.arctan2(poses[2][1, 0], poses[2][0, 0])) == pytest.approx(30.0)


def test_the_mount_moves_the_body_not_the_camera() -> None:
    rng = np.random.default_rng(1)
    mount = looking_ahead()
    mount[:3, 3] = 1.7, 0.2, 1.4
    cameras = np.tile(np.eye(4), (5, 1, 1))
    cameras[:, :3, :3] = Rotation.random(5, random_state=rng).as_matrix()
    cameras[:, :3, 3] = rng.normal(size=(5, 3))
    cameras = np.linalg.inv(cameras[0]) @ cameras
    bodies = poses_from_kitti(cameras, mount)
    np.testing.assert_allclose(bodies[0], np.eye(4), atol=1e-12)
    # The camera's own motion, as seen from its first pose, is the one in the file.
    seen = np.linalg.inv(bodies[0] @ mount) @ (bodies @ mount)
    np.testing.assert_allclose(seen, cameras, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "holds no pose"),
        ("1 2 3\n", ":1: 3 columns"),
        ("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 1\n", ":2: 7 columns"),
        ("1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", ":2: the time does not increase"),
        ("1 0 0 0 0 0 0 2\n", ":1: a quaternion of length 2.000"),
        ("1 0 0 0 0 0 0 one\n", ":1: could not convert"),
        ("1 0 0 inf 0 0 0 1\n", ":1: a value is not finite"),
        ("1 0 0 0 0 0 0 nan\n", ":1: a value is not finite"),
        ("1 0 0 0 0 1 0 0 0 0 2 0\n" * 3, ":1: the first three columns are no rotation"),
        ("1 0 0 0 0 1 0 0 0 0 1 0\n" * 2, "2 poses for 3 images"),
    ],
)
def test_files_that_are_no_trajectory(tmp_path: Path, text: str, what: str) -> None:
    path = tmp_path / "poses"
    path.write_text(text)
    with pytest.raises(InputError, match=what):
        read_trajectory(path, stamps_ns=STAMPS)


def test_kitti_poses_need_times(tmp_path: Path) -> None:
    path = tmp_path / "poses"
    path.write_text(kitti_row(np.eye(4)))
    with pytest.raises(MissingError, match="carry no times"):
        read_trajectory(path)


def test_kitti_06_drives_ahead(shared_data: Path) -> None:
    stamps = (np.arange(51) * 10**8).astype(np.int64)
    trajectory = read_trajectory(shared_data / "kitti_06" / "poses.txt", stamps_ns=stamps)
    assert trajectory.positions_m[-1, 0] > 50.0
    assert abs(trajectory.positions_m[-1, 1]) < 3.0
