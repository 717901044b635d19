"""KITTI raw OXTS folders: the GNSS/inertial records of a drive as a trajectory.

Layout (KITTI raw, dataformat.txt): ``timestamps.txt`` with a UTC time a line, ``data/0000000000.txt`` … with one line
of 30 numbers each; the first six are latitude, longitude (deg), altitude (m), roll, pitch, yaw (rad). The unit's
axes are forward, left, up; yaw is counter-clockwise from East, roll positive left side up, pitch positive front down:
exactly the drive log's ``base_link`` in East-North-Up, so attitude = Rz(yaw)·Ry(pitch)·Rx(roll).

KITTI's own tools map the positions by a Mercator projection of a sphere, which at 49° North makes distances wrong by
0.2 to 0.3 % (the ellipsoid is rounder there). The frame here is East-North-Up, tangent to the WGS 84 ellipsoid, as
everywhere else in scpf: true metres, and latitudes that agree with maps and fixes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.images import parse_time
from scpf.models.errors import InputError
from scpf.models.geodesy import Origin, ecef_from_enu, enu_from_geodetic
from scpf.models.trajectory import Trajectory

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

COLUMNS: Final = 30
MAX_RECORD_BYTES: Final = 10_000
MAX_TIMES_BYTES: Final = 64 << 20


class Oxts(NamedTuple):
    """The trajectory of the OXTS unit in ``map``, and the origin of ``map``."""

    trajectory: Trajectory
    origin: Origin


def is_oxts(path: Path) -> bool:
    """Whether a path is an OXTS folder, or a drive's folder that holds one."""
    return _folder(path) is not None


def read_oxts(path: Path, origin: Origin | None = None, *, cut_times: bool = False) -> Oxts:
    """The records of an OXTS folder, or of a drive that holds one, in East-North-Up at ``origin``.

    Without an origin it is the first position. ``cut_times``: times without a record are left out, where the
    last records of the drive are missing. Raises InputError naming file and line.
    """
    folder = _folder(path)
    if folder is None:
        raise InputError(f"{path} is no OXTS folder", "it holds timestamps.txt and data/0000000000.txt …")
    files = _files(folder)
    rows = np.array([_record(file) for file in files])
    stamps_ns = _stamps(folder / "timestamps.txt", files, cut_times)
    latitude, longitude, height = rows[:, :3].T
    if origin is None:
        origin = Origin(float(latitude[0]), float(longitude[0]), float(height[0]))
    positions = enu_from_geodetic(latitude, longitude, height, origin)
    return Oxts(Trajectory(stamps_ns, positions, _quaternions(rows, origin)), origin)


def _quaternions(rows: Array, origin: Origin) -> Array:
    from scipy.spatial.transform import Rotation

    local = Rotation.from_euler("ZYX", rows[:, [5, 4, 3]]).as_matrix()
    # East and North turn with the place: the attitude is of the place, the frame of the origin.
    here = ecef_from_enu(rows[:, 0], rows[:, 1])
    there = ecef_from_enu(np.array([origin.latitude_deg]), np.array([origin.longitude_deg]))[0]
    quaternions: Array = Rotation.from_matrix(there.T @ here @ local).as_quat()
    return quaternions


def _folder(path: Path) -> Path | None:
    for folder in (path, path / "oxts"):
        records = (folder / "data").glob("*.txt")
        if (folder / "timestamps.txt").is_file() and next(records, None) is not None:
            return folder
    return None


def _files(folder: Path) -> list[Path]:
    files = sorted((folder / "data").glob("*.txt"))
    for number, file in enumerate(files):
        if not file.stem.isdigit():
            raise InputError(f"{file}: its name is no number", "records are called 0000000000.txt, …")
        if int(file.stem) != number:
            hint = (
                "the times are counted with the records: copy the missing ones, or renumber files and lines"
            )
            raise InputError(f"{folder / 'data'}: record {number} is missing, {file.name} follows", hint)
    return files


def _record(path: Path) -> list[float]:
    try:
        if path.stat().st_size > MAX_RECORD_BYTES:
            raise InputError(f"{path} is larger than a record")
        words = path.read_text(encoding="ascii").split()
        values = [float(word) for word in words]
    except (OSError, ValueError) as error:
        raise InputError(f"{path}:1: {error}") from error
    if len(values) != COLUMNS:
        raise InputError(f"{path}:1: {len(values)} numbers, where an OXTS record has {COLUMNS}")
    if not np.isfinite(values[:6]).all() or abs(values[0]) > 90.0 or abs(values[1]) > 180.0:
        raise InputError(f"{path}:1: latitude {values[0]}, longitude {values[1]} is no position")
    return values[:6]


def _stamps(path: Path, files: list[Path], cut_times: bool) -> Stamps:
    try:
        if path.stat().st_size > MAX_TIMES_BYTES:
            raise InputError(f"{path} is larger than 64 MiB", "is this a file of times?")
        lines = path.read_text(encoding="ascii").splitlines()
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: {error}") from error
    while lines and not lines[-1].strip():
        lines.pop()
    count = len(files)
    if len(lines) < count or (len(lines) > count and not cut_times):
        hint = "copy the missing records"
        if len(lines) > count:
            hint += (
                f"; where the last ones are left out on purpose, keep the first {count} lines of the times"
            )
        raise InputError(f"{path} holds {len(lines)} times for {count} records", hint)
    texts = [line.strip() for line in lines[:count]]
    stamps = np.array([parse_time(text, f"{path}:{k}") for k, text in enumerate(texts, 1)], dtype=np.int64)
    backwards = np.flatnonzero(np.diff(stamps) <= 0)
    if len(backwards):
        raise InputError(f"{path}:{int(backwards[0]) + 2}: the time does not increase")
    return stamps
