"""The simulated drive of the estimation protocol: 1.2 km of a 2.7 km ring in 4000 frames at 13 Hz, three stops."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.geodesy import wrap_angle

Array = NDArray[np.float64]

FRAME_INTERVAL_S: Final = 1.0 / 13.0
RING_LENGTH_M: Final = 2700.0
RING_POINTS: Final = 5400
DRIVE_LENGTH_M: Final = 1200.0
DRIVE_START_M: Final = 300.0
LANE_OFFSET_M: Final = -1.5
"""To the right of the centre line."""


@dataclass(frozen=True, eq=False)
class Ring:
    """A closed centre line (P, 2) in m, equally spaced, its direction (P,) of travel (rad, unwrapped)."""

    line_m: Array
    direction_rad: Array

    @property
    def spacing_m(self) -> float:
        """Distance between neighbouring points."""
        return RING_LENGTH_M / len(self.line_m)

    def at(self, length_m: Array) -> tuple[Array, Array]:
        """Points (N, 2) and directions (N,) at lengths along the ring."""
        grid = np.arange(len(self.line_m) + 1) * self.spacing_m
        closed = np.vstack([self.line_m, self.line_m[:1]])
        turned = np.append(self.direction_rad, self.direction_rad[0] + 2 * np.pi)
        around = length_m % RING_LENGTH_M
        points = np.column_stack([np.interp(around, grid, closed[:, k]) for k in (0, 1)])
        return points, np.interp(around, grid, turned)


@dataclass(frozen=True, eq=False)
class Drive:
    """The truth of K frames: ``positions_m`` (K, 2), ``velocities_mps`` (K, 2), ``headings_rad`` (K,)."""

    positions_m: Array
    velocities_mps: Array
    headings_rad: Array


def make_ring() -> Ring:
    """The protocol's ring: a circle bent by three harmonics, counter-clockwise."""
    angle = np.linspace(0, 2 * np.pi, 20001)
    radius = (
        1 + 0.18 * np.cos(2 * angle + 0.4) + 0.06 * np.cos(3 * angle + 1.3) + 0.025 * np.cos(5 * angle + 2)
    )
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    scale = RING_LENGTH_M / length[-1]
    at = np.linspace(0, RING_LENGTH_M, RING_POINTS, endpoint=False)
    line = np.column_stack([np.interp(at, length * scale, axis * scale) for axis in (x, y)])
    ahead = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    return Ring(line, np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0])))


def make_drive(ring: Ring, frames: int, rng: np.random.Generator) -> Drive:
    """A drive in the right lane that wanders by 0.3 m, at 3.9 m/s on average with three stops.

    Fewer frames are the beginning of the same drive.
    """
    whole = 4000
    time_s = np.arange(whole) * FRAME_INTERVAL_S
    speed = 4.6 + 1.6 * np.sin(2 * np.pi * time_s / 71 + 0.7) + 1.1 * np.sin(2 * np.pi * time_s / 29 + 2)
    speed += 0.5 * np.sin(2 * np.pi * time_s / 11)
    for middle_s, half_s in ((55, 9), (150, 11), (235, 8)):
        speed *= 1 / (1 + np.exp(-(np.abs(time_s - middle_s) - half_s) / 1.2))
    speed = np.clip(speed, 0, None)
    speed *= DRIVE_LENGTH_M / (speed.sum() * FRAME_INTERVAL_S)
    centre, direction = ring.at(DRIVE_START_M + np.cumsum(speed) * FRAME_INTERVAL_S)

    keep = np.exp(-FRAME_INTERVAL_S / 6.0)
    wander = np.zeros(whole)
    for k, kick in enumerate(0.3 * np.sqrt(1 - keep**2) * rng.standard_normal(whole - 1), start=1):
        wander[k] = keep * wander[k - 1] + kick
    offset = _smooth(_smooth(wander) * np.clip(speed / 3, 0, 1) + LANE_OFFSET_M)
    left = np.column_stack([-np.sin(direction), np.cos(direction)])
    positions = centre + offset[:, None] * left
    velocities = np.gradient(positions, FRAME_INTERVAL_S, axis=0)
    moving = np.hypot(*velocities.T) > 0.3
    headings = np.where(moving, np.arctan2(velocities[:, 1], velocities[:, 0]), wrap_angle(direction))
    return Drive(positions[:frames], velocities[:frames], headings[:frames])


def _smooth(values: Array) -> Array:
    window = np.hanning(39)
    smoothed: Array = np.convolve(np.pad(values, 19, "edge"), window / window.sum(), "valid")
    return smoothed
