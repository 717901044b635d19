"""CSV poses as the Boreas dataset publishes them (post-processed Applanix POS LV).

Layout (FORMATS, Boreas-style CSV): ``GPSTime,easting,northing,altitude,vel_east,vel_north,vel_up,roll,pitch,
heading,angvel_z,angvel_y,angvel_x``; GPSTime is Unix time (UTC) in µs, or s; eastings and northings are UTM with no
zone inside; angles in rad are of the SENSOR that the file is about: rotation to East-North-Up = Rx(roll)ᵀ·Ry(pitch)ᵀ·
Rz(heading)ᵀ. Velocities and attitude refer to the grid's North, not true North: the directions of motion in the
published drives say so.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest import velocity_frame
from scpf.ingest.navigation import NativeColumn, NativeTable, Navigation, make_navigation
from scpf.ingest.read_report import ReadOptions, ReadReport
from scpf.ingest.text_tables import header_lines, read_head, read_rows
from scpf.models import grids
from scpf.models.camera import R_BODY_OPTICAL
from scpf.models.errors import DamagedError, MissingError, UsageError
from scpf.models.geodesy import R_ENU_NED, R_FLU_FRD, wrap_angle

Array = NDArray[np.float64]

_NEEDED: Final = ("GPSTime", "easting", "northing", "altitude", "roll", "pitch", "heading")
_UNITS: Final = {
    "easting": "m",
    "northing": "m",
    "altitude": "m",
    "roll": "rad",
    "pitch": "rad",
    "heading": "rad",
}
SENSORS: Final = {
    "camera": R_BODY_OPTICAL.T,
    "body": np.eye(3),
    "applanix": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
}
"""Sensor ← body (x forward, y left, z up) of a camera that looks ahead, of such a body, and of y forward, x right."""
_MAX_UNIX_S: Final = 8e9


def probe(head: bytes, size: int) -> str | None:
    """Why the beginning of a file looks like such a CSV, or None."""
    names = _names(head)
    return f"columns {', '.join(_NEEDED)} in the first line" if set(_NEEDED) <= set(names) else None


def read(path: Path, options: ReadOptions) -> Navigation:
    """The poses of a CSV. Raises DamagedError naming the line, MissingError without the UTM zone.

    Which sensor's poses they are is told by ``options.sensor``, else by which axis points up and which ahead.
    """
    names = _names(read_head(path))
    if not set(_NEEDED) <= set(names) or len(set(names)) != len(names):
        missing = ", ".join(sorted(set(_NEEDED) - set(names))) or "none, but one comes twice"
        raise DamagedError(f"{path}:1: the first line lacks columns: {missing}", "is this a CSV of poses?")
    if options.utm_zone is None:
        hint = "give the UTM zone of the drive, such as 17N (Toronto)"
        raise MissingError(f"{path}: eastings and northings without a UTM zone", hint)
    grid = grids.utm(options.utm_zone)
    rows = read_rows(path, 1, len(names), ",")
    report = ReadReport(str(path), "boreas", total_bytes=path.stat().st_size, records=len(rows))
    columns = {name: np.ascontiguousarray(rows[:, k]) for k, name in enumerate(names)}
    stamps, unit = _stamps(str(path), columns["GPSTime"])
    native = {
        "boreas": NativeTable(
            stamps,
            {name: NativeColumn(values, _unit(name, unit)) for name, values in columns.items()},
        )
    }
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):  # damaged numbers are left out below
        latitude, longitude, convergence = grids.to_geodetic(grid, columns["easting"], columns["northing"])
        R_grid_sensor = _rotations(columns["roll"], columns["pitch"], columns["heading"])
        velocity = _columns(columns, "vel_east", "vel_north", "vel_up")
        sensor = options.sensor or _sensor(str(path), R_grid_sensor, velocity, report)
        if sensor not in SENSORS:
            raise UsageError(f"{sensor!r} is not a kind of sensor frame", f"known: {', '.join(SENSORS)}")
        R_ned_frd = R_ENU_NED.T @ R_grid_sensor @ SENSORS[sensor] @ R_FLU_FRD
        rates = _columns(columns, "angvel_x", "angvel_y", "angvel_z") @ (SENSORS[sensor] @ R_FLU_FRD)
        heading = np.arctan2(R_ned_frd[:, 1, 0], R_ned_frd[:, 0, 0])
        standard = {
            "velocity_enu_mps": grids.from_grid_north(velocity, convergence),
            "roll_rad": np.arctan2(R_ned_frd[:, 2, 1], R_ned_frd[:, 2, 2]),
            "pitch_rad": -np.arcsin(np.clip(R_ned_frd[:, 2, 0], -1.0, 1.0)),
            "heading_rad": wrap_angle(heading + convergence),
            "rates_radps": rates,
        }
        return make_navigation(report, stamps, (latitude, longitude, columns["altitude"]), native, standard)


def _rotations(roll: Array, pitch: Array, heading: Array) -> Array:
    """Grid East-North-Up ← sensor (N, 3, 3): the transposed turns about x, y, z, in this order."""
    (sr, sp, sy), (cr, cp, cy) = np.sin([roll, pitch, heading]), np.cos([roll, pitch, heading])
    rows = [
        [cp * cy, cp * sy, -sp],
        [sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp],
        [cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _sensor(path: str, R_grid_sensor: Array, velocity: Array, report: ReadReport) -> str:
    """The kind of sensor: a camera's y points down; of the others, the axis along the motion is ahead."""
    up = np.nanmedian(R_grid_sensor[:, 2], axis=0) if len(R_grid_sensor) else np.zeros(3)
    speed = np.linalg.norm(velocity, axis=1)
    moving = speed > velocity_frame.MIN_SPEED_MPS
    sensor = ""
    if up[1] < -0.7:
        sensor = "camera"
    elif up[2] > 0.7 and moving.any():
        ahead = velocity[moving] / speed[moving, None]
        along = np.nanmedian(np.einsum("nij,ni->nj", R_grid_sensor[moving], ahead), axis=0)
        sensor = "body" if along[0] > 0.9 else "applanix" if along[1] > 0.9 else ""
    if not sensor:
        hint = f"say whose poses they are: {', '.join(SENSORS)}"
        raise MissingError(f"{path}: which axis of the sensor is ahead, the rows do not tell", hint)
    report.notes.append(
        f"the poses are those of a sensor with axes as {sensor!r}, by which axes are up and ahead"
    )
    return sensor


def _stamps(path: str, times: Array) -> tuple[NDArray[np.int64], str]:
    """Unix ns, 0 where a value is no time, and the unit that the column has."""
    middle = float(np.median(times[np.isfinite(times)])) if np.isfinite(times).any() else 0.0
    for unit, per_second in (("s", 1.0), ("us", 1e6)):
        if 1e8 < middle / per_second < _MAX_UNIX_S:
            valid = (times > 0) & (times < _MAX_UNIX_S * per_second)
            whole = np.where(valid, np.rint(times * (1e6 / per_second)), 0).astype(np.int64)
            return whole * 1000, f"{unit} (Unix)"
    raise DamagedError(
        f"{path}: a GPSTime of {middle:.0f} is neither Unix µs nor s", "is this a CSV of poses?"
    )


def _columns(columns: dict[str, Array], *names: str) -> Array:
    absent = np.full(len(columns["GPSTime"]), np.nan)
    return np.column_stack([columns.get(name, absent) for name in names])


def _names(head: bytes) -> list[str]:
    return [name.strip() for name in header_lines(head)[0].split(",")]


def _unit(name: str, time_unit: str) -> str:
    if name == "GPSTime":
        return time_unit
    return _UNITS.get(name, "m/s" if name.startswith("vel") else "rad/s" if name.startswith("angvel") else "")
