"""A trajectory: time-stamped poses of the body in the map frame, interpolated at any time in between."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

MAX_GAP_NS: Final = 1_000_000_000
"""Poses further apart than this are not interpolated: what happened in between is not known."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Poses of the body in ``map``.

    ``stamps_ns`` (N,), strictly increasing; ``positions_m`` (N, 3); ``quaternions_xyzw`` (N, 4), unit.
    """

    stamps_ns: Stamps
    positions_m: Array
    quaternions_xyzw: Array

    def __post_init__(self) -> None:
        n = len(self.stamps_ns)
        if self.positions_m.shape != (n, 3) or self.quaternions_xyzw.shape != (n, 4):
            raise InputError(f"a trajectory of {n} stamps, {len(self.positions_m)} positions")
        if not (np.diff(self.stamps_ns) > 0).all():
            raise InputError("the stamps of a trajectory must increase")

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def poses(self) -> Array:
        """``T_map_body`` (N, 4, 4) of every stamp."""
        return _matrices(self.positions_m, self.quaternions_xyzw)

    def at(self, stamp_ns: int, max_gap_ns: int = MAX_GAP_NS) -> Array | None:
        """``T_map_body`` (4, 4) at a time: position linear, attitude by slerp; None outside, or in a gap."""
        from scipy.spatial.transform import Rotation, Slerp

        right = int(np.searchsorted(self.stamps_ns, stamp_ns))
        if right < len(self) and self.stamps_ns[right] == stamp_ns:
            exact: Array = _matrices(
                self.positions_m[right : right + 1], self.quaternions_xyzw[right : right + 1]
            )[0]
            return exact
        if right == 0 or right == len(self):
            return None
        left = right - 1
        gap = int(self.stamps_ns[right] - self.stamps_ns[left])
        if gap > max_gap_ns:
            return None
        share = float(stamp_ns - self.stamps_ns[left]) / gap
        pose = np.eye(4)
        pose[:3, 3] = (1.0 - share) * self.positions_m[left] + share * self.positions_m[right]
        slerp = Slerp([0.0, 1.0], Rotation.from_quat(self.quaternions_xyzw[left : right + 1]))
        pose[:3, :3] = slerp(share).as_matrix()
        return pose


def from_poses(stamps_ns: Stamps, poses: Array) -> Trajectory:
    """The trajectory of ``T_map_body`` (N, 4, 4) at ``stamps_ns`` (N,)."""
    from scipy.spatial.transform import Rotation

    quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    return Trajectory(np.asarray(stamps_ns, dtype=np.int64), poses[:, :3, 3].copy(), quaternions)


def _matrices(positions_m: Array, quaternions_xyzw: Array) -> Array:
    from scipy.spatial.transform import Rotation

    poses = np.tile(np.eye(4), (len(positions_m), 1, 1))
    poses[:, :3, :3] = Rotation.from_quat(quaternions_xyzw).as_matrix()
    poses[:, :3, 3] = positions_m
    return poses


def yaw_of(T_map_body: Array) -> float:
    """Yaw (rad, counter-clockwise from East) of a pose (4, 4)."""
    return float(np.arctan2(T_map_body[1, 0], T_map_body[0, 0]))
