"""NMEA 0183, as an Applanix unit sends it: GGA, RMC, ZDA, VTG, HDT and PASHR, at 10 Hz.

A sentence is ``$``, talker and kind, fields between commas, ``*``, the XOR of all between the two as two hex digits,
and a line's end. Minutes have seven decimals (0.2 mm), times milliseconds, angles three decimals of a degree.
"""

from __future__ import annotations

from datetime import UTC, datetime
from functools import reduce
from operator import xor

import numpy as np

from scpf.sample_logs.sensors import InsLog

RATE_HZ = 10
GEOID_M = -36.0
"""The ellipsoid's height of the geoid in Waterloo, to a metre."""
RTK_FIXED, SATELLITES, HDOP, CORRECTION_AGE_S, STATION = 4, 17, 0.6, 1.0, 1
MPS_PER_KNOT = 1852 / 3600


def nmea(ins: InsLog, rate_hz: int = RATE_HZ, talker: str = "IN") -> bytes:
    """The sentences of an INS log: all six of a moment, one moment after the other."""
    ins = ins.at_rate(rate_hz)
    return "".join(_sentence(body) for k in range(len(ins)) for body in _bodies(ins, k, talker)).encode(
        "ascii"
    )


def _bodies(ins: InsLog, k: int, talker: str) -> list[str]:
    seconds, nanoseconds = divmod(int(ins.stamps_ns[k]), 10**9)
    moment = datetime.fromtimestamp(seconds, UTC)
    clock = f"{moment:%H%M%S}.{nanoseconds // 10**6:03d}"
    place = f"{_minutes(ins.latitude_deg[k], 2, 'NS')},{_minutes(ins.longitude_deg[k], 3, 'EW')}"
    north, east, _ = ins.velocity_ned_mps[k]
    speed, track = float(np.hypot(north, east)), _compass(float(np.degrees(np.arctan2(east, north))))
    knots, kmh = speed / MPS_PER_KNOT, speed * 3.6
    roll, pitch, heading = ins.attitude_deg[k]
    accuracy = ",".join(f"{value:.3f}" for value in ins.attitude_rms_deg[k])
    height = f"{ins.height_m[k] - GEOID_M:.4f},M,{GEOID_M:.4f},M"
    return [
        f"{talker}GGA,{clock},{place},{RTK_FIXED},{SATELLITES},{HDOP},{height},{CORRECTION_AGE_S},{STATION:04d}",
        f"{talker}RMC,{clock},A,{place},{knots:.4f},{track},{moment:%d%m%y},,,R",
        f"{talker}ZDA,{clock},{moment:%d,%m,%Y},00,00",
        f"{talker}VTG,{track},T,,M,{knots:.4f},N,{kmh:.4f},K,D",
        f"{talker}HDT,{_compass(heading)},T",
        f"PASHR,{clock},{_compass(heading)},T,{roll:+.3f},{pitch:+.3f},+0.00,{accuracy},2,1",
    ]


def _compass(angle_deg: float) -> str:
    """An angle from 0 to below 360°, also after rounding."""
    return f"{round(angle_deg % 360.0, 3) % 360.0:.3f}"


def _minutes(angle_deg: float, width: int, sides: str) -> str:
    """(d)ddmm.mmmmmmm and the side; counted in whole last decimals, so that no minute is 60."""
    degrees, rest = divmod(round(abs(float(angle_deg)) * 60e7), 60 * 10**7)
    minutes, decimals = divmod(rest, 10**7)
    return f"{degrees:0{width}d}{minutes:02d}.{decimals:07d},{sides[int(angle_deg < 0)]}"


def _sentence(body: str) -> str:
    return f"${body}*{reduce(xor, body.encode('ascii')):02X}\r\n"
