"""Trajectories written as others read them: TUM, EuRoC CSV, KITTI poses."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.camera import looking_ahead
from scpf.models.errors import InputError, UsageError
from scpf.models.trajectory import Trajectory
from scpf.models.whole_files import whole

Array = NDArray[np.float64]

SUFFIXES: Final = {".tum": "tum", ".csv": "euroc", ".txt": "kitti"}
"""The format that a file's name asks for, where none is given."""
EUROC_HEADING: Final = (
    "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []"
)


def format_of(path: Path) -> str:
    """The format by a file's name; UsageError for an unknown ending."""
    found = SUFFIXES.get(path.suffix.lower())
    if found is None:
        known = ", ".join(f"{suffix} ({name})" for suffix, name in SUFFIXES.items())
        raise UsageError(
            f"{path.name}: no trajectory format has this ending", f"known: {known}; or give --format"
        )
    return found


def write_tum(path: Path, trajectory: Trajectory, *, overwrite: bool = False) -> None:
    """Write a trajectory as TUM: seconds with nine digits, positions (m), quaternion x y z w."""
    lines = ["# stamp_s tx ty tz qx qy qz qw"]
    for stamp, numbers in _rows(trajectory, trajectory.quaternions_xyzw):
        sign, size = "-" if stamp < 0 else "", abs(stamp)
        lines.append(f"{sign}{size // 10**9}.{size % 10**9:09d} {' '.join(numbers)}")
    _write(path, lines, overwrite)


def write_euroc(path: Path, trajectory: Trajectory, *, overwrite: bool = False) -> None:
    """Write a trajectory as EuRoC CSV: nanoseconds, positions (m), quaternion w x y z."""
    rows = _rows(trajectory, trajectory.quaternions_xyzw[:, [3, 0, 1, 2]])
    _write(path, [EUROC_HEADING, *(f"{stamp},{','.join(numbers)}" for stamp, numbers in rows)], overwrite)


def write_kitti(
    path: Path, trajectory: Trajectory, T_body_camera: Array | None = None, *, overwrite: bool = False
) -> None:
    """Write a trajectory as KITTI poses: 3×4 rows of the camera, without times.

    P_k = T_body_camera⁻¹ · T_map_body · T_body_camera, the way back of ``poses_from_kitti``: in axes of the
    camera, z ahead. Without ``T_body_camera`` the camera looks ahead from the body's origin.
    """
    mount = looking_ahead() if T_body_camera is None else T_body_camera
    poses = np.linalg.inv(mount) @ trajectory.poses() @ mount
    _write(path, [" ".join(f"{value:.12e}" for value in pose[:3].ravel()) for pose in poses], overwrite)


def write_trajectory(
    path: Path,
    trajectory: Trajectory,
    format: str,
    *,
    T_body_camera: Array | None = None,
    overwrite: bool = False,
) -> None:
    """Write a trajectory as ``tum``, ``euroc`` or ``kitti`` (that of the camera)."""
    if format == "tum":
        write_tum(path, trajectory, overwrite=overwrite)
    elif format == "euroc":
        write_euroc(path, trajectory, overwrite=overwrite)
    elif format == "kitti":
        write_kitti(path, trajectory, T_body_camera, overwrite=overwrite)
    else:
        raise UsageError(f"{format!r} is no trajectory format", "known: tum, euroc, kitti")


def _rows(trajectory: Trajectory, quaternions: Array) -> Iterable[tuple[int, list[str]]]:
    """Stamp (ns), and position and quaternion as text, of each pose."""
    for stamp, *row in zip(trajectory.stamps_ns, trajectory.positions_m, quaternions, strict=True):
        yield int(stamp), [f"{value:.9f}" for part in row for value in part]


def _write(path: Path, lines: list[str], overwrite: bool) -> None:
    if path.exists() and not overwrite:
        raise InputError(f"{path} exists", "choose another name, or give --overwrite")
    try:
        with whole(path) as partial:
            partial.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror})", "does its folder exist?") from error
