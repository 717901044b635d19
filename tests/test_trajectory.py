"""Interpolation of poses."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scpf.models.errors import InputError
from scpf.models.trajectory import Trajectory, from_poses, yaw_of


def turning(stamps_ns: list[int]) -> Trajectory:
    """Ten metres and a tenth of a radian a second."""
    seconds = np.array(stamps_ns) * 1e-9
    poses = np.tile(np.eye(4), (len(stamps_ns), 1, 1))
    poses[:, 0, 3] = 10.0 * seconds
    poses[:, :3, :3] = Rotation.from_euler("z", 0.1 * seconds[:, None]).as_matrix()
    return from_poses(np.array(stamps_ns), poses)


def test_positions_are_linear_and_attitudes_slerped() -> None:
    pose = turning([0, 500_000_000, 900_000_000]).at(620_000_000)
    assert pose is not None
    np.testing.assert_allclose(pose[:3, 3], [6.2, 0.0, 0.0], atol=1e-9)
    assert yaw_of(pose) == pytest.approx(0.062)


def test_poses_come_back_at_their_stamps() -> None:
    trajectory = turning([0, 100_000_000, 200_000_000])
    for stamp, expected in zip(trajectory.stamps_ns, trajectory.poses(), strict=True):
        np.testing.assert_allclose(trajectory.at(int(stamp)), expected, atol=1e-12)


def test_outside_and_in_gaps_nothing_is_invented() -> None:
    trajectory = turning([0, 100_000_000, 2_000_000_000])
    assert trajectory.at(-1) is None
    assert trajectory.at(2_000_000_001) is None
    assert trajectory.at(1_000_000_000) is None
    assert trajectory.at(1_000_000_000, max_gap_ns=3_000_000_000) is not None


def test_stamps_must_increase() -> None:
    with pytest.raises(InputError):
        Trajectory(np.array([5, 5]), np.zeros((2, 3)), np.tile([0, 0, 0, 1.0], (2, 1)))
