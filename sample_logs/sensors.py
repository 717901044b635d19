"""What the INS and a plain GPS receiver say of a simulated drive.

Errors of an INS that RTK corrects are small and change slowly: Gauss-Markov processes of first order, whose standard
deviations are those that the unit reports as its RMS, in their order of magnitude those of a POS LVX or LV with RTK.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from scpf.models.errors import InputError
from scpf.models.geodesy import R_ENU_NED, R_FLU_FRD, Origin, ecef_from_enu, geodetic_from_enu
from scpf.sample_logs.vehicle import VehicleDrive

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

INS_RATE_HZ = 200
MARGIN_NS = 500_000_000
"""The INS begins before the first picture and ends after the last."""
POSITION_RMS_M = np.array([0.015, 0.015, 0.03])
VELOCITY_RMS_MPS = np.array([0.006, 0.006, 0.008])
ATTITUDE_RMS_DEG = np.array([0.008, 0.008, 0.03])
CORRELATION_S = 60.0
RMS_CHANGE = 0.2
"""Relative standard deviation of the RMS, as satellites come and go."""


@dataclass(frozen=True, eq=False)
class InsLog:
    """What an Applanix unit knows at N moments, in its own conventions.

    Attitude of a body x forward, y right, z down in local North-East-Down; columns (N, 3).
    """

    stamps_ns: Stamps
    """UTC (N,), whole multiples of the INS's step."""
    latitude_deg: Array
    longitude_deg: Array
    height_m: Array
    """Above the ellipsoid."""
    velocity_ned_mps: Array
    attitude_deg: Array
    """Roll, pitch, heading; the heading clockwise from true North, 0 to 360."""
    rates_degps: Array
    """About body x forward, y right, z down."""
    accelerations_mps2: Array
    """Along the same axes, without gravity."""
    position_rms_m: Array
    """North, east, down."""
    velocity_rms_mps: Array
    """North, east, down."""
    attitude_rms_deg: Array
    """Roll, pitch, heading."""

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def at_rate(self, rate_hz: int) -> InsLog:
        """Every so many rows: those at whole multiples of 1/``rate_hz`` s. InputError for a rate above the log's."""
        if not 0 < rate_hz <= INS_RATE_HZ or INS_RATE_HZ % rate_hz:
            raise InputError(f"{rate_hz} Hz of an INS of {INS_RATE_HZ} Hz", "give a divisor of its rate")
        rows = self.stamps_ns % (10**9 // rate_hz) == 0
        return replace(self, **{field.name: getattr(self, field.name)[rows] for field in fields(self)})


def simulate_ins(drive: VehicleDrive, origin: Origin, *, seed: int, noise: float = 1.0) -> InsLog:
    """The INS's log of a drive in ``map`` at ``origin``, 200 Hz, errors times ``noise`` (0: the truth).

    It always reports an RMS; with ``noise`` 0 that of ``noise`` 1.
    """
    step_ns = 10**9 // INS_RATE_HZ
    first = (int(drive.stamps_ns[0]) - MARGIN_NS) // step_ns
    last = (int(drive.stamps_ns[-1]) + MARGIN_NS) // step_ns
    state = drive.motion.at(np.arange(first, last + 1, dtype=np.int64) * step_ns)
    rng = np.random.default_rng([seed, 21])
    count, scale = len(state.stamps_ns), noise if noise > 0 else 1.0
    change = np.exp(RMS_CHANGE * _markov(rng, (count, 1), CORRELATION_S))
    rms = [
        scale * change * level for level in (POSITION_RMS_M, VELOCITY_RMS_MPS, np.radians(ATTITUDE_RMS_DEG))
    ]
    off = [
        np.sign(noise) * deviation * _markov(rng, (count, 3), CORRELATION_S) for deviation in rms
    ]  # north, east, down; north, east, down; roll, pitch, heading

    position = state.T_map_body[:, :3, 3] + off[0] @ R_ENU_NED.T
    place = geodetic_from_enu(position, origin)
    # North and East are those of the place, not of the origin: they turn by 3″ a hundred metres east.
    here = ecef_from_enu(place[0], place[1])
    there = ecef_from_enu(np.array([origin.latitude_deg]), np.array([origin.longitude_deg]))[0]
    R_ned_map = R_ENU_NED.T @ np.swapaxes(here, 1, 2) @ there
    R_ned_body = R_ned_map @ state.T_map_body[:, :3, :3] @ R_FLU_FRD
    heading, pitch, roll = Rotation.from_matrix(R_ned_body).as_euler("ZYX").T
    attitude = np.degrees(np.column_stack([roll, pitch, heading]) + off[2])
    attitude[:, 2] %= 360.0
    velocity = np.einsum("nij,nj->ni", R_ned_map, state.velocity_map_mps) + off[1]
    R_frd_map = R_FLU_FRD @ np.swapaxes(state.T_map_body[:, :3, :3], 1, 2)
    accelerations = np.einsum("nij,nj->ni", R_frd_map, state.acceleration_map_mps2)
    rates = np.degrees(state.rates_body_radps @ R_FLU_FRD)
    return InsLog(
        state.stamps_ns, *place, velocity, attitude, rates, accelerations, rms[0], rms[1], np.degrees(rms[2])
    )


class GpsLog(NamedTuple):
    """A plain receiver's positions (N, 2) in ``map`` at ``stamps_ns`` (N,), each axis with ``variance_m2``."""

    stamps_ns: Stamps
    positions_m: Array
    variance_m2: float


def simulate_gps(
    drive: VehicleDrive, *, sigma_m: float = 3.0, seed: int, correlation_s: float = 0.0
) -> GpsLog:
    """A rough GPS position at each picture of the drive, ``sigma_m`` a axis.

    Errors are white, or with ``correlation_s`` last about that long, as those of real receivers do.
    """
    if not sigma_m > 0.0:
        raise InputError(f"a GPS with a standard deviation of {sigma_m} m", "give a positive one")
    rng = np.random.default_rng([seed, 22])
    if correlation_s > 0.0:
        seconds = (drive.stamps_ns - drive.stamps_ns[0]) * 1e-9
        steady = _markov(rng, (int(seconds[-1] * INS_RATE_HZ) + 2, 2), correlation_s)
        errors = steady[np.rint(seconds * INS_RATE_HZ).astype(np.int64)]
    else:
        errors = rng.standard_normal((len(drive), 2))
    positions = drive.T_map_body[:, :2, 3] + sigma_m * errors
    return GpsLog(drive.stamps_ns, positions, sigma_m**2)


def _markov(rng: np.random.Generator, shape: tuple[int, int], correlation_s: float) -> Array:
    """Gauss-Markov processes of first order in columns, variance 1, a row each step of the INS."""
    keep = np.exp(-1.0 / (INS_RATE_HZ * correlation_s))
    steps = rng.standard_normal(shape) * np.sqrt(1.0 - keep**2)
    steps[0] = rng.standard_normal(shape[1])  # begins in its steady state
    process: Array = lfilter([1.0], [1.0, -keep], steps, axis=0)
    return process
