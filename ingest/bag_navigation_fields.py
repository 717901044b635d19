"""Where an Applanix driver's ROS messages keep what: GSOF 49 (navigation) and 50 (its RMS), driver by driver.

Read from the message definitions of autowarefoundation/applanix (applanix_msgs), trimble_driver_ros
(trimble_gsof_msgs), and from programs that use those of applanix_publisher (WATonoBus).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from difflib import get_close_matches
from typing import Any, Final

from scpf.models.errors import InputError

Read = Callable[[Any], float]

_AXES: Final = (("x", "long"), ("y", "trans"), ("z", "down"))
_NED: Final = ("north", "east", "down")

NAVIGATION_FIELDS: Final[dict[str, tuple[str, ...]]] = {
    "latitude_deg": ("lla.latitude", "latitude"),
    "longitude_deg": ("lla.longitude", "longitude"),
    "height_m": ("lla.altitude", "lla.height", "altitude", "height"),
    "roll_deg": ("roll",),
    "pitch_deg": ("pitch",),
    "heading_deg": ("heading",),
    **{
        f"velocity_{axis}_mps": (
            f"velocity.{axis}",
            f"ned.{axis}",
            f"vel_{axis}",
            f"{axis}_velocity",
            f"{axis}_vel",
        )
        for axis in _NED
    },
    **{f"rate_{axis}_degps": (f"ang_rate_{name}",) for axis, name in _AXES},
    **{f"acceleration_{axis}_mps2": (f"acc_{name}", f"{name}_accel") for axis, name in _AXES},
    "alignment": ("status.imu_alignment",),
    "gps_week": ("gps_time.week",),
    "gps_ms": ("gps_time.time",),
}
"""Values of a navigation message, and the fields where they are looked for. Attitude as Applanix gives it; rates and
accelerations along body x forward, y right, z down; velocities north, east, down."""
ACCURACY_FIELDS: Final[dict[str, tuple[str, ...]]] = {
    **{
        f"{axis}_rms_m": (f"pos_rms_error.{axis}", f"position_rms.{axis}", f"{axis}_pos_rms") for axis in _NED
    },
    "roll_rms_deg": ("attitude_rms_error_roll", "roll_rms"),
    "pitch_rms_deg": ("attitude_rms_error_pitch", "pitch_rms"),
    "heading_rms_deg": ("attitude_rms_error_heading", "heading_rms"),
}
REQUIRED: Final = ("latitude_deg", "longitude_deg", "height_m", "roll_deg", "pitch_deg", "heading_deg")
REQUIRED_ACCURACY: Final = ("north_rms_m", "east_rms_m", "down_rms_m")


def check_field(name: str, known: dict[str, tuple[str, ...]], place: str) -> None:
    """InputError where a mapping names a value that nobody asks for; angles may be given in radians (``_rad``)."""
    if _in_degrees(name) not in known:
        near = get_close_matches(name, known, 1)
        hint = f"did you mean {near[0]}?" if near else f"known: {', '.join(known) or 'none for this role'}"
        raise InputError(f"{place}: fields: {name!r} is not known", hint)


def readers(
    message: Any, known: dict[str, tuple[str, ...]], given: dict[str, str], required: tuple[str, ...]
) -> dict[str, Read]:
    """For each value, what reads it out of messages like this one. InputError where a required one is not there."""
    own = {_in_degrees(name): (path, name != _in_degrees(name)) for name, path in given.items()}
    found: dict[str, Read] = {}
    for name, paths in known.items():
        path, radians = own.get(name, ("", False))
        for candidate in (path,) if path else paths:
            if _get(message, candidate) is not None:
                found[name] = _reader(candidate, math.degrees(1.0) if radians else 1.0)
                break
        else:
            if path or name in required:
                where = path or " or ".join(paths)
                raise InputError(
                    f"no {name}: the message has no number {where}", "name it in a mapping, under fields"
                )
    return found


def _reader(path: str, scale: float) -> Read:
    def read(message: Any) -> float:
        value = _get(message, path)
        return float("nan") if value is None else value * scale

    return read


def _get(message: Any, path: str) -> float | None:
    for part in path.split("."):
        message = getattr(message, part, None)
    return float(message) if isinstance(message, int | float) else None


def _in_degrees(name: str) -> str:
    return name.replace("_rad", "_deg") if "_radps" not in name else name.replace("_radps", "_degps")
