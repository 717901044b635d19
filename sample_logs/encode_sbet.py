"""SBET and SMRMSG, as POSPac writes them: no header, little-endian, one f64 a value.

Layouts: 17 values = 136 bytes (time of week s, latitude and longitude rad, height m, velocities x y z m/s, roll, pitch,
platform heading and wander angle rad, accelerations m/s², rates rad/s), and 10 values = 80 bytes (time, position RMS
north east down m, velocity RMS m/s, attitude RMS arc-minutes). Platform heading is true heading plus wander angle; x, y
and z are North, West and Up turned by it.
"""

from __future__ import annotations

import numpy as np

from scpf.sample_logs.gps_week import weeks_of
from scpf.sample_logs.sensors import InsLog

WANDER_RAD = -0.0173
"""A wander-azimuth mechanisation drifts by a degree or so: never quite 0, so that nobody may forget it."""
DEG = np.pi / 180.0
ARC_MINUTES_PER_DEG = 60.0


def sbet(ins: InsLog, wander_rad: float = WANDER_RAD) -> bytes:
    """The SBET of an INS log."""
    north, east, down = ins.velocity_ned_mps.T
    cos, sin = np.cos(wander_rad), np.sin(wander_rad)
    roll, pitch, heading = (ins.attitude_deg * DEG).T
    columns = [
        weeks_of(ins.stamps_ns)[1] * 1e-9,
        ins.latitude_deg * DEG,
        ins.longitude_deg * DEG,
        ins.height_m,
        cos * north - sin * east,
        -sin * north - cos * east,
        -down,
        roll,
        pitch,
        heading + wander_rad,
        np.full(len(ins), wander_rad),
        *ins.accelerations_mps2.T,
        *(ins.rates_degps * DEG).T,
    ]
    return np.column_stack(columns).astype("<f8").tobytes()


def smrmsg(ins: InsLog) -> bytes:
    """The SMRMSG that belongs to the SBET: accuracies once a second."""
    slow = ins.at_rate(1)
    columns = [
        weeks_of(slow.stamps_ns)[1] * 1e-9,
        *slow.position_rms_m.T,
        *slow.velocity_rms_mps.T,
        *(slow.attitude_rms_deg * ARC_MINUTES_PER_DEG).T,
    ]
    return np.column_stack(columns).astype("<f8").tobytes()
