"""The motion of the simulated bus, as one continuous function of time that every sensor samples at its own rate."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from scpf.models.errors import InputError
from scpf.sample_logs.body_sway import sway
from scpf.sample_logs.centre_line import CentreLine
from scpf.sample_logs.speed_profile import (
    CRUISE_DEVIATION_MPS,
    CRUISE_WAVELENGTHS_M,
    greatest_speeds,
    travelled,
)
from scpf.sample_logs.wander import Wander

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

LANE_MIDDLE_M = -1.85
LANE_DEVIATION_M, LANE_WAVELENGTHS_M = 0.12, (60.0, 400.0)
ROAD_ROLL_RAD, ROAD_PITCH_RAD, ROAD_WAVELENGTHS_M = np.radians(0.25), np.radians(0.2), (5.0, 40.0)
MARGIN_M = 40.0
"""Planned before the start and beyond the end, so that neither is a special place."""
PLACE_STEP_M, TIME_STEP_S = 0.5, 0.005


class MotionState(NamedTuple):
    """The bus at N moments. ``map``: East-North-Up; ``body``: x forward, y left, z up, its origin on the road."""

    stamps_ns: Stamps
    s_m: Array
    """Along the centre line (N,), counted on from lap to lap."""
    T_map_body: Array
    """(N, 4, 4)."""
    velocity_map_mps: Array
    """(N, 3)."""
    acceleration_map_mps2: Array
    """(N, 3), without gravity."""
    rates_body_radps: Array
    """Angular rates (N, 3) about the body's axes."""

    @property
    def speed_mps(self) -> Array:
        """Speed (N,)."""
        speed: Array = np.linalg.norm(self.velocity_map_mps, axis=1)
        return speed

    @property
    def yaw_rate_radps(self) -> Array:
        """Rate of turn (N,) about the body's z axis, positive to the left."""
        return self.rates_body_radps[:, 2]


class VehicleMotion:
    """A drive along the right lane of ``centre_line`` from ``start_m`` to ``stop_m`` of its length.

    The first moment, at ``start_m``, is ``start_ns`` (UTC, ns); ``duration_s`` later the bus is at ``stop_m``. It
    stands for some seconds at ``halt_m``, if given. Two seconds more can be asked for on either side.
    """

    def __init__(
        self,
        centre_line: CentreLine,
        start_m: float,
        stop_m: float,
        start_ns: int,
        rng: np.random.Generator,
        halt_m: float | None = None,
    ) -> None:
        self.start_ns = start_ns
        offset = Wander(rng, LANE_DEVIATION_M, LANE_WAVELENGTHS_M)
        cruise = Wander(rng, CRUISE_DEVIATION_MPS, CRUISE_WAVELENGTHS_M)
        road_roll = Wander(rng, ROAD_ROLL_RAD, ROAD_WAVELENGTHS_M)
        road_pitch = Wander(rng, ROAD_PITCH_RAD, ROAD_WAVELENGTHS_M)

        s = np.arange(start_m - MARGIN_M, stop_m + MARGIN_M, PLACE_STEP_M)
        places, yaw = _in_lane(centre_line, offset, s)
        path = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(places[:, :2], axis=0).T))])
        halt = None if halt_m is None else int(np.argmin(np.abs(s - halt_m)))
        limits = greatest_speeds(path, np.gradient(yaw, path), halt, cruise)
        times, along, speed = travelled(path, limits, halt, TIME_STEP_S)

        s_then = CubicSpline(path, s)(np.minimum(along, path[-1]))
        begin, end = np.interp([start_m, stop_m], s_then, times)
        self.duration_s = float(end - begin)
        places, yaw = _in_lane(centre_line, offset, s_then)
        yaw_rate, forward = np.gradient(yaw, TIME_STEP_S), np.gradient(speed, TIME_STEP_S)
        roll, pitch = sway(
            speed * yaw_rate, forward, road_roll.at(s_then), road_pitch.at(s_then), TIME_STEP_S
        )
        self._spline = CubicSpline(times - begin, np.column_stack([s_then, places, yaw, pitch, roll]))

    def at(self, stamps_ns: Stamps) -> MotionState:
        """The state at N stamps (UTC, ns). InputError for one outside the drive and its two seconds of margin."""
        stamps = np.asarray(stamps_ns, dtype=np.int64)
        t = (stamps - self.start_ns) * 1e-9
        if len(t) and not (self._spline.x[0] <= t.min() and t.max() <= self._spline.x[-1]):
            raise InputError(f"a moment outside a drive of {self.duration_s:.1f} s")
        values, first, second = (self._spline(t, order) for order in (0, 1, 2))
        poses = np.tile(np.eye(4), (len(t), 1, 1))
        poses[:, :3, :3] = _rotations(*values[:, 4:].T)
        poses[:, :3, 3] = values[:, 1:4]
        rates = _body_rates(values[:, 5], values[:, 6], first[:, 4:])
        return MotionState(stamps, values[:, 0], poses, first[:, 1:4], second[:, 1:4], rates)


def _in_lane(centre_line: CentreLine, wander: Wander, s_m: Array) -> tuple[Array, Array]:
    """Positions (N, 3) and directions of travel (N,), rad and unwrapped, in the right lane at ``s_m`` (N,)."""
    offset = LANE_MIDDLE_M + wander.at(s_m)
    places, tangent, _ = centre_line.at(s_m, offset)
    across = np.arctan2(wander.slope(s_m), 1.0 - centre_line.curvature_per_m(s_m) * offset)
    return places, np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0])) + across


def _rotations(yaw: Array, pitch: Array, roll: Array) -> Array:
    """``R_map_body`` (N, 3, 3): first roll about x, then pitch about y, then yaw about z."""
    from scipy.spatial.transform import Rotation

    matrices: Array = Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll])).as_matrix()
    return matrices


def _body_rates(pitch: Array, roll: Array, angles_per_s: Array) -> Array:
    """Angular rates (N, 3) about body x, y, z of changing yaw, pitch and roll (N, 3), rad/s."""
    yaw_rate, pitch_rate, roll_rate = angles_per_s.T
    turn = np.cos(pitch) * yaw_rate
    return np.column_stack(
        [
            roll_rate - np.sin(pitch) * yaw_rate,
            np.cos(roll) * pitch_rate + np.sin(roll) * turn,
            -np.sin(roll) * pitch_rate + np.cos(roll) * turn,
        ]
    )
