"""Trajectories that people have: TUM, EuRoC CSV, KITTI odometry poses and KITTI raw OXTS folders, read."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.images import parse_time
from scpf.ingest.oxts import is_oxts, read_oxts
from scpf.ingest.trajectory_writers import write_tum
from scpf.models.camera import looking_ahead
from scpf.models.errors import InputError, MissingError
from scpf.models.geodesy import Origin
from scpf.models.trajectory import Trajectory, from_poses

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
Rows = list[tuple[int, list[str]]]
"""Line number and columns of each row of a file."""

EUROC_STATE_COLUMNS: Final = 17
MAX_TEXT_BYTES: Final = 1 << 30
ROTATION_TOLERANCE: Final = 1e-3
"""KITTI writes seven digits; a file of something else misses a rotation by far more."""


def read_trajectory(
    path: Path,
    *,
    stamps_ns: Stamps | None = None,
    T_body_camera: Array | None = None,
    origin: Origin | None = None,
) -> Trajectory:
    """The trajectory of a TUM, EuRoC or KITTI pose file, told apart by the columns, or of a KITTI OXTS folder.

    TUM and EuRoC poses are taken as those of the body. KITTI poses have no times: ``stamps_ns`` (N,), one a row,
    are those of the images. OXTS positions are geodetic: ``origin`` is that of ``map``, by default the first
    position. Raises InputError naming the line, MissingError for KITTI poses without stamps.
    """
    if is_oxts(path):
        return read_oxts(path, origin).trajectory
    rows, commas = _rows(path)
    columns = len(rows[0][1])
    if columns == EUROC_STATE_COLUMNS or (columns == 8 and commas and all(c[0].isdigit() for _, c in rows)):
        return _euroc(path, rows)
    if columns == 8:
        return _tum(path, rows)
    if columns == 12:
        if stamps_ns is None:
            hint = "give the images' times (--timestamps, or --rate) as well"
            raise MissingError(f"{path} holds KITTI poses, which carry no times", hint)
        return _kitti(path, rows, stamps_ns, T_body_camera)
    hint = (
        "known: TUM (t tx ty tz qx qy qz qw), EuRoC CSV (ns, position, quaternion w x y z), "
        "KITTI (12 numbers, a 3×4 matrix by rows), and KITTI raw's oxts folder"
    )
    raise InputError(f"{path}:{rows[0][0]}: {columns} columns: not a known trajectory", hint)


def poses_from_kitti(poses_camera: Array, T_body_camera: Array | None = None) -> Array:
    """``T_map_body`` (N, 4, 4) of KITTI poses T_cam0_camk (N, 4, 4).

    ``map`` is the body frame of the first pose: T_map_body = T_body_camera · P_k · T_body_camera⁻¹. Without
    ``T_body_camera`` the camera looks ahead from the body's origin.
    """
    mount = looking_ahead() if T_body_camera is None else T_body_camera
    poses: Array = mount @ poses_camera @ np.linalg.inv(mount)
    return poses


def _rows(path: Path) -> tuple[Rows, bool]:
    """Line numbers and columns of a table of numbers, comments left out, and whether commas part the columns."""
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
    return rows, "," in lines[rows[0][0] - 1]


def _numbers(path: Path, rows: Rows, first: int) -> Array:
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


def _tum(path: Path, rows: Rows) -> Trajectory:
    table = _numbers(path, rows, 1)
    stamps = [parse_time(cells[0], f"{path}:{number}") for number, cells in rows]
    return _timed(path, rows, stamps, table[:, :3].copy(), table[:, 3:])


def _euroc(path: Path, rows: Rows) -> Trajectory:
    """Time in ns, position, quaternion w x y z; velocity and biases of a state estimate may follow."""
    for number, cells in rows:
        if not (cells[0].isdigit() and len(cells[0]) <= 19):
            raise InputError(f"{path}:{number}: {cells[0][:40]!r} is no time in ns, as EuRoC writes it")
    table = _numbers(path, rows, 1)
    stamps = [int(cells[0]) for _, cells in rows]
    return _timed(path, rows, stamps, table[:, :3].copy(), table[:, [4, 5, 6, 3]])


def _timed(
    path: Path, rows: Rows, stamps_ns: list[int], positions_m: Array, quaternions_xyzw: Array
) -> Trajectory:
    try:
        stamps = np.array(stamps_ns, dtype=np.int64)
    except OverflowError as error:
        raise InputError(f"{path}: a time after the year 2262") from error
    backwards = np.flatnonzero(np.diff(stamps) <= 0)
    if len(backwards):
        number = rows[int(backwards[0]) + 1][0]
        raise InputError(f"{path}:{number}: the time does not increase ({len(backwards)} such lines)")
    lengths = np.linalg.norm(quaternions_xyzw, axis=1)
    wrong = np.flatnonzero(np.abs(lengths - 1.0) > 1e-2)
    if len(wrong):
        k = int(wrong[0])
        raise InputError(f"{path}:{rows[k][0]}: a quaternion of length {lengths[k]:.3f}, not 1")
    return Trajectory(stamps, positions_m, quaternions_xyzw / lengths[:, None])


def _kitti(path: Path, rows: Rows, stamps_ns: Stamps, T_body_camera: Array | None) -> Trajectory:
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


__all__ = ["poses_from_kitti", "read_trajectory", "write_tum"]
