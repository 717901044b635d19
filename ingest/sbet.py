"""SBET: the smoothed best estimate of trajectory that POSPac writes, and its accuracies (SMRMSG).

Layout (FORMATS, Applanix post-processed): no header, little-endian records of 17 f64 = 136 bytes; time of week
(s), latitude, longitude (rad), ellipsoid height (m), velocity x y z in the wander frame (m/s), roll, pitch,
platform heading, wander angle (rad), body accelerations (m/s²), body rates (rad/s). True heading = platform
heading − wander. The velocities are x North, y West, z Up, turned by the wander angle; their agreement with the
positions is checked. SMRMSG: 10 f64 = 80 bytes: time, N/E/D position RMS (m), N/E/D velocity RMS (m/s),
roll/pitch/heading RMS (arc-minutes), at 1 Hz.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest import gps_time, velocity_frame
from scpf.ingest.navigation import NativeColumn, NativeTable, Navigation, make_navigation, rms_at
from scpf.ingest.read_report import ReadOptions, ReadReport
from scpf.models.errors import DamagedError, InputError
from scpf.models.geodesy import wrap_angle

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
Records = NDArray[np.void]

SBET_UNITS: Final = (
    {"time": "s of GPS week", "latitude": "rad", "longitude": "rad", "altitude": "m"}
    | dict.fromkeys(("x_velocity", "y_velocity", "z_velocity"), "m/s")
    | dict.fromkeys(("roll", "pitch", "platform_heading", "wander_angle"), "rad")
    | dict.fromkeys(("x_acceleration", "y_acceleration", "z_acceleration"), "m/s²")
    | dict.fromkeys(("x_angular_rate", "y_angular_rate", "z_angular_rate"), "rad/s")
)
SMRMSG_UNITS: Final = (
    {"time": "s of GPS week"}
    | dict.fromkeys(("north_position_rms", "east_position_rms", "down_position_rms"), "m")
    | dict.fromkeys(("north_velocity_rms", "east_velocity_rms", "down_velocity_rms"), "m/s")
    | dict.fromkeys(("roll_rms", "pitch_rms", "heading_rms"), "arcmin")
)
SBET_DTYPE: Final = np.dtype([(name, "<f8") for name in SBET_UNITS])
SMRMSG_DTYPE: Final = np.dtype([(name, "<f8") for name in SMRMSG_UNITS])
_PROBE_RECORDS: Final = 50


def read(path: Path, options: ReadOptions) -> Navigation:
    """The navigation of an SBET, with the accuracies of ``options.smrmsg`` where given.

    The file is mapped, not loaded: what has the file's own unit is read from the disk where it is used. Raises
    DamagedError for a size that is no multiple of 136, MissingError where the week is not given.
    """
    records = _records(path, SBET_DTYPE, "SBET")
    report = ReadReport(str(path), "sbet", total_bytes=records.nbytes, records=len(records))
    times = records["time"]
    known = gps_time.in_week(times)
    if not known.any():
        raise DamagedError(f"{path}: byte 0: no record has a time of week", "is this an SBET?")
    week = options.needed_week(str(path), float(times[int(np.argmax(known))]))
    stamps = gps_time.stamps_of_week(week, times, options.leap_seconds)
    with np.errstate(invalid="ignore", over="ignore"):  # damaged numbers are left out below
        columns: dict[str, Array] = {
            "velocity_enu_mps": _wander_velocity(records),
            "roll_rad": records["roll"],
            "pitch_rad": records["pitch"],
            "heading_rad": wrap_angle(records["platform_heading"] - records["wander_angle"]),
            "accelerations_mps2": _triple(records, "x_acceleration"),
            "rates_radps": _triple(records, "x_angular_rate"),
        }
        place = (np.degrees(records["latitude"]), np.degrees(records["longitude"]), records["altitude"])
        velocity = _checked_velocity(stamps, place, records, report)
    if velocity is not None:
        columns["velocity_enu_mps"] = velocity
    native = {"sbet": _native(stamps, records, SBET_UNITS)}
    if options.smrmsg is not None:
        native["smrmsg"] = read_smrmsg(options.smrmsg, stamps, options)
        columns |= _accuracies(native["smrmsg"], stamps)
    return make_navigation(report, stamps, place, native, columns)


def read_smrmsg(path: Path, sbet_stamps_ns: Stamps, options: ReadOptions) -> NativeTable:
    """The accuracies of an SMRMSG file, in its own units; its week is that which comes closest to the SBET's.

    Raises DamagedError for a size that is no multiple of 80, InputError where the two share no time.
    """
    records = _records(path, SMRMSG_DTYPE, "SMRMSG")
    times = np.ascontiguousarray(records["time"])
    known = gps_time.in_week(times)
    if not known.any():
        raise DamagedError(f"{path}: byte 0: no record has a time of week", "is this an SMRMSG file?")
    start = int(sbet_stamps_ns[sbet_stamps_ns > 0][0])
    week = gps_time.week_near(gps_time.gps_seconds(start * 1e-9), float(times[int(np.argmax(known))]))
    stamps = gps_time.stamps_of_week(week, times, options.leap_seconds)
    valid, ends = stamps[stamps > 0], (start, int(sbet_stamps_ns.max()))
    if valid.min() > ends[1] or valid.max() < ends[0]:
        raise InputError(f"{path} and its SBET share no time", "do the two files belong together?")
    return _native(stamps, records, SMRMSG_UNITS)


def refuse_smrmsg(path: Path, options: ReadOptions) -> Navigation:
    """SMRMSG alone is no navigation: says so, after checking its size."""
    _records(path, SMRMSG_DTYPE, "SMRMSG")
    raise InputError(f"{path} holds accuracies (SMRMSG), not poses", "give it together with its SBET")


def probe(head: bytes, size: int) -> str | None:
    """Why the beginning of a file of ``size`` bytes looks like an SBET, or None."""
    records = np.frombuffer(head[: len(head) // 136 * 136][: 136 * _PROBE_RECORDS], dtype=SBET_DTYPE)
    if not len(records) or not _steady(records["time"], 1.0):
        return None
    angles = ("latitude", "longitude", "roll", "pitch", "platform_heading", "wander_angle")
    limits = (np.pi / 2, 2 * np.pi, np.pi, np.pi, 4 * np.pi, 2 * np.pi)
    if not all((np.abs(records[name]) <= limit).all() for name, limit in zip(angles, limits, strict=True)):
        return None
    if not (np.abs(records["altitude"]) < 1e5).all() or not (records["latitude"] != 0.0).any():
        return None
    return f"{len(records)} records of 17 f64 with times of week that increase and angles in radians"


def probe_smrmsg(head: bytes, size: int) -> str | None:
    """Why the beginning of a file of ``size`` bytes looks like an SMRMSG file, or None."""
    records = np.frombuffer(head[: len(head) // 80 * 80][: 80 * _PROBE_RECORDS], dtype=SMRMSG_DTYPE)
    if not len(records) or not _steady(records["time"], 60.0):
        return None
    values = np.stack([records[name] for name in list(SMRMSG_UNITS)[1:]])
    if not ((values > 0.0) & (values < 1e4)).all():
        return None
    return f"{len(records)} records of 10 f64 with times of week that increase and positive accuracies"


def _steady(times: Array, max_step_s: float) -> bool:
    steps = np.diff(gps_time.unrolled(times)) if gps_time.in_week(times).all() else np.array([-1.0])
    return bool(((steps > 0.0) & (steps < max_step_s)).all())


def _records(path: Path, dtype: np.dtype[Any], name: str) -> Records:
    """The file mapped as records; sizes are checked first."""
    try:
        size = path.stat().st_size
        rest = size % dtype.itemsize
        if size == 0 or rest:
            where = f"the last record breaks off at byte {size - rest}" if rest else "it is empty"
            text = f"{path} has {size} bytes, no multiple of the {dtype.itemsize} of a {name} record: {where}"
            raise DamagedError(text, "copy or export the file again")
        return np.memmap(path, dtype=dtype, mode="r").view(np.ndarray)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from error


def _native(stamps: Stamps, records: Records, units: dict[str, str]) -> NativeTable:
    return NativeTable(stamps, {name: NativeColumn(records[name], unit) for name, unit in units.items()})


def _triple(records: Records, first: str) -> Array:
    """Three neighbouring columns (N, 3), as a view of the file."""
    start = list(SBET_UNITS).index(first)
    triple: Array = records.view("<f8").reshape(len(records), len(SBET_UNITS))[:, start : start + 3]
    return triple


def _wander_velocity(records: Records) -> Array:
    """East-North-Up of velocities that are North-West-Up turned by the wander angle."""
    cos, sin = np.cos(records["wander_angle"]), np.sin(records["wander_angle"])
    x, y = records["x_velocity"], records["y_velocity"]
    velocity = np.empty((len(records), 3))
    velocity[:, 0] = -(sin * x + cos * y)
    velocity[:, 1] = cos * x - sin * y
    velocity[:, 2] = records["z_velocity"]
    return velocity


def _checked_velocity(
    stamps: Stamps, place: tuple[Array, Array, Array], records: Records, report: ReadReport
) -> Array | None:
    """Velocities of another convention, where the positions contradict the documented one; notes say so."""
    if len(records) < 2:
        return None
    rows = velocity_frame.sample_pairs(len(records))
    x, y, z = (records[name][rows] for name in ("x_velocity", "y_velocity", "z_velocity"))
    wander = "North-West-Up turned by the wander angle"
    candidates = {wander: _wander_velocity(records[rows]), "North-East-Down": np.column_stack([y, x, -z])}
    sample = (place[0][rows], place[1][rows], place[2][rows])
    misfit, speed = velocity_frame.misfits(stamps[rows], sample, candidates)
    said = ", ".join(f"{name}: {value:.3f} m/s" for name, value in misfit.items())
    if not speed >= velocity_frame.MIN_SPEED_MPS:
        report.notes.append("velocity frame not checked: the vehicle stands, or the rows have no times")
        return None
    if velocity_frame.agrees(misfit[wander], speed):
        report.notes.append(f"velocities agree with the positions ({said}; at {speed:.2f} m/s)")
        return None
    if velocity_frame.agrees(misfit["North-East-Down"], speed):
        report.notes.append(
            f"WARNING: velocities taken as North-East-Down, which the positions show ({said})"
        )
        return np.column_stack([records["y_velocity"], records["x_velocity"], -records["z_velocity"]])
    report.notes.append(f"WARNING: velocities disagree with the positions at {speed:.2f} m/s ({said})")
    return None


def _accuracies(table: NativeTable, stamps: Stamps) -> dict[str, Array]:
    values = {name: np.asarray(column.values, dtype=float) for name, column in table.columns.items()}

    def triple(*names: str) -> Array:
        return rms_at(stamps, table.stamps_ns, np.column_stack([values[name] for name in names]))

    arcmin = np.pi / (180.0 * 60.0)
    return {
        "position_rms_m": triple("east_position_rms", "north_position_rms", "down_position_rms"),
        "velocity_rms_mps": triple("east_velocity_rms", "north_velocity_rms", "down_velocity_rms"),
        "attitude_rms_rad": triple("roll_rms", "pitch_rms", "heading_rms") * arcmin,
    }
