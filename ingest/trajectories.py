"""Trajectories that people have: TUM (read and written) and KITTI odometry poses (read)."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.images import parse_time
from scpf.models.camera import looking_ahead
from scpf.models.errors import InputError, MissingError
from scpf.models.trajectory import Trajectory, from_poses

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

MAX_TEXT_BYTES: Final = 1 << 30
ROTATION_TOLERANCE: Final = 1e-3
"""KITTI writes seven digits; a file of something else misses a rotation by far more."""


def read_trajectory(
    path: Path, *, stamps_ns: Stamps | None = None, T_body_camera: Array | None = None
) -> Trajectory:
    """The trajectory of a TUM file (8 columns) or a KITTI pose file (12 columns), told apart by the columns.

    KITTI poses have no times: ``stamps_ns`` (N,), one a row, are those of the images. Raises InputError
    naming the line, MissingError for KITTI poses without stamps.
    """
    rows = _rows(path)
    columns = len(rows[0][1])
    if columns == 8:
        return _tum(path, rows)
    if columns == 12:
        if stamps_ns is None:
            hint = "give the images' times (--timestamps, or --rate) as well"
            raise MissingError(f"{path} holds KITTI poses, which carry no times", hint)
        return _kitti(path, rows, stamps_ns, T_body_camera)
    hint = "known: TUM (t tx ty tz qx qy qz qw) and KITTI (12 numbers, a 3×4 matrix by rows)"
    raise InputError(f"{path}:{rows[0][0]}: {columns} columns: not a known trajectory", hint)


def poses_from_kitti(poses_camera: Array, T_body_camera: Array | None = None) -> Array:
    """``T_map_body`` (N, 4, 4) of KITTI poses T_cam0_camk (N, 4, 4).

    ``map`` is the body frame of the first pose: T_map_body = T_body_camera · P_k · T_body_camera⁻¹. Without
    ``T_body_camera`` the camera looks ahead from the body's origin.
    """
    mount = looking_ahead() if T_body_camera is None else T_body_camera
    poses: Array = mount @ poses_camera @ np.linalg.inv(mount)
    return poses


def write_tum(path: Path, trajectory: Trajectory, *, overwrite: bool = False) -> None:
    """Write a trajectory as TUM: seconds with nine digits, positions (m), quaternion x y z w."""
    if path.exists() and not overwrite:
        raise InputError(f"{path} exists", "choose another name, or give --overwrite")
    lines = ["# stamp_s tx ty tz qx qy qz qw"]
    columns = (trajectory.stamps_ns, trajectory.positions_m, trajectory.quaternions_xyzw)
    for stamp, position, quaternion in zip(*columns, strict=True):
        numbers = " ".join(f"{value:.9f}" for value in (*position, *quaternion))
        sign, size = "-" if stamp < 0 else "", abs(int(stamp))
        lines.append(f"{sign}{size // 10**9}.{size % 10**9:09d} {numbers}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Line numbers and columns of a table of numbers, comments left out."""
    try:
        if path.stat().st_size > MAX_TEXT_BYTES:
            raise InputError(f"{path} is larger than 1 GiB", "is this a trajectory?")
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not a text file ({error})") from error
    split = ((number, line.replace(",", " ").split()) for number, line in enumerate(lines, 1))
    rows = [(number, cells) for number, cells in split if cells and not cells[0].startswith("#")]
    if not rows:
        raise InputError(f"{path} holds no pose")
    for number, cells in rows:
        if len(cells) != len(rows[0][1]):
            raise InputError(
                f"{path}:{number}: {len(cells)} columns, where the rows before have {len(rows[0][1])}"
            )
    return rows


def _numbers(path: Path, rows: list[tuple[int, list[str]]], first: int) -> Array:
    """The columns from ``first`` on, as finite numbers."""
    table = np.empty((len(rows), len(rows[0][1]) - first))
    for k, (number, cells) in enumerate(rows):
        try:
            table[k] = [float(cell) for cell in cells[first:]]
        except ValueError as error:
            raise InputError(f"{path}:{number}: {error}") from error
        if not np.isfinite(table[k]).all():
            raise InputError(f"{path}:{number}: a value is not finite")
    return table


def _tum(path: Path, rows: list[tuple[int, list[str]]]) -> Trajectory:
    stamps = np.array([parse_time(cells[0], f"{path}:{number}") for number, cells in rows], dtype=np.int64)
    table = _numbers(path, rows, 1)
    backwards = np.flatnonzero(np.diff(stamps) <= 0)
    if len(backwards):
        number = rows[int(backwards[0]) + 1][0]
        raise InputError(f"{path}:{number}: the time does not increase ({len(backwards)} such lines)")
    lengths = np.linalg.norm(table[:, 3:], axis=1)
    wrong = np.flatnonzero(np.abs(lengths - 1.0) > 1e-2)
    if len(wrong):
        k = int(wrong[0])
        raise InputError(f"{path}:{rows[k][0]}: a quaternion of length {lengths[k]:.3f}, not 1")
    return Trajectory(stamps, table[:, :3].copy(), table[:, 3:] / lengths[:, None])


def _kitti(
    path: Path, rows: list[tuple[int, list[str]]], stamps_ns: Stamps, T_body_camera: Array | None
) -> Trajectory:
    if len(rows) != len(stamps_ns):
        hint = "KITTI poses and images belong together one by one"
        raise InputError(f"{path} holds {len(rows)} poses for {len(stamps_ns)} images", hint)
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3] = _numbers(path, rows, 0).reshape(-1, 3, 4)
    rotations = poses[:, :3, :3]
    misses = np.abs(rotations @ rotations.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    wrong = np.flatnonzero((misses > ROTATION_TOLERANCE) | (np.linalg.det(rotations) < 0))
    if len(wrong):
        raise InputError(f"{path}:{rows[int(wrong[0])][0]}: the first three columns are no rotation")
    return from_poses(stamps_ns, poses_from_kitti(poses, T_body_camera))
