"""The estimation protocol: a simulated drive past poles, and what a camera would have measured of them.

Everything that the Monte Carlo runs share; their own is the noise of GPS, first state and particles. The cases
differ in how wrong the ranges are, whether their errors last, and whether the map is right.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.geodesy import wrap_angle
from scpf.models.road_map import Landmark, RoadMap
from scpf.replay.protocol_drive import (
    FRAME_INTERVAL_S,
    RING_LENGTH_M,
    Drive,
    Ring,
    make_drive,
    make_ring,
)

Array = NDArray[np.float64]

FRAMES: Final = 4000
MOST_DETECTIONS: Final = 3
SIGHT_HALF_ANGLE_RAD: Final = float(np.radians(40.0))
NEAREST_M: Final = 4.0
CLOSE_M: Final = 13.6
"""Up to here the close expert measures."""
BEARING_DEVIATION_RAD: Final = float(np.radians(0.5))
CORRELATION_TIME_S: Final = 1.0
DROP_SHARE: Final = 0.03


@dataclass(frozen=True)
class Case:
    """One case: mean absolute range errors close and far, how they run in time, how far off the map is."""

    name: str
    mean_absolute_error_m: tuple[float, float] = (0.65, 0.98)
    correlated: bool = False
    map_error_m: tuple[float, float] = (0.0, 0.0)
    poles: int = 99
    farthest_m: float = 62.0


CASES: Final = {
    "P": Case("P", (0.36, 0.74), poles=140, farthest_m=50.0),
    "S0": Case("S0"),
    "S1": Case("S1", correlated=True),
    "S2": Case("S2", correlated=True, map_error_m=(1.0, 2.0)),
}


@dataclass(frozen=True)
class Detection:
    """What one frame measured of one pole; ``landmark`` is the pole's true index in the map, −1 where unknown."""

    landmark: int
    distance_m: float
    variance_m2: float
    bearing_rad: float


@dataclass(frozen=True, eq=False)
class Scenario:
    """A case of the protocol, made: the ring, the map that filters see, the truth, the detections of each frame.

    ``times_s`` (K,) of the frames, since the first one. Of a recording also: the first frame's stamp, the place in
    ``map`` that positions are relative to, and how many frames were left out, since they have no reference.
    """

    case: Case
    ring: Ring
    road_map: RoadMap
    drive: Drive
    detections: tuple[tuple[Detection, ...], ...]
    times_s: Array
    start_ns: int = 0
    middle_m: tuple[float, float] = (0.0, 0.0)
    left_out: int = 0


def make_scenario(case: Case, seed: int, frames: int = FRAMES, again: int = 0) -> Scenario:
    """The scenario of a case; ``seed`` numbers the drive, ``again`` further drives past the same poles on that map."""
    rng = np.random.default_rng([seed, 7])
    ring = make_ring()
    drive = make_drive(ring, frames, rng)
    poles = _poles(ring, case.poles, rng)
    off, turn = rng.uniform(*case.map_error_m, case.poles), rng.uniform(0, 2 * np.pi, case.poles)
    mapped = poles + off[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    landmarks = tuple(Landmark(f"P{k}", (float(x), float(y), 0.0)) for k, (x, y) in enumerate(mapped))
    road_map = RoadMap(landmarks, np.vstack([ring.line_m, ring.line_m[:1]]))
    if again:
        rng = np.random.default_rng([seed, 7, again])
        drive = make_drive(ring, frames, rng)
    times_s: Array = FRAME_INTERVAL_S * np.arange(len(drive.positions_m), dtype=np.float64)
    return Scenario(case, ring, road_map, drive, _detections(case, drive, poles, rng), times_s)


def gps_fixes(drive: Drive, sigma_m: float, rng: np.random.Generator) -> Array:
    """Rough positions (K, 2): the truth with white noise of ``sigma_m`` an axis."""
    fixes: Array = drive.positions_m + sigma_m * rng.standard_normal(drive.positions_m.shape)
    return fixes


def _poles(ring: Ring, count: int, rng: np.random.Generator) -> Array:
    """Poles (count, 2), alternately left and right of the road, about 6 m from its centre line."""
    along = (np.arange(count) + rng.uniform(-0.4, 0.4, count)) * RING_LENGTH_M / count
    side = np.where(np.arange(count) % 2 == 0, 1.0, -1.0)
    points, direction = ring.at(along)
    offset = side * (6.0 + rng.uniform(-0.5, 0.5, count))
    poles: Array = points + offset[:, None] * np.column_stack([-np.sin(direction), np.cos(direction)])
    return poles


def _detections(
    case: Case, drive: Drive, poles: Array, rng: np.random.Generator
) -> tuple[tuple[Detection, ...], ...]:
    """The detections of each frame, nearest first.

    A pole that comes into sight draws its error; where errors are correlated it then follows a first-order
    autoregression of a second. Found or not is a Markov chain as well: far poles drop out more often.
    """
    to_pole = poles[None] - drive.positions_m[:, None]
    range_m = np.hypot(to_pole[..., 0], to_pole[..., 1])
    bearing = wrap_angle(np.arctan2(to_pole[..., 1], to_pole[..., 0]) - drive.headings_rad[:, None])
    in_sight = (np.abs(bearing) < SIGHT_HALF_ANGLE_RAD) & (range_m > NEAREST_M) & (range_m < case.farthest_m)
    close_m, far_m = (float(mae * np.sqrt(np.pi / 2)) for mae in case.mean_absolute_error_m)
    keep = float(np.exp(-FRAME_INTERVAL_S / CORRELATION_TIME_S)) if case.correlated else 0.0
    count = len(poles)
    error, found, before = np.zeros(count), np.zeros(count, bool), np.zeros(count, bool)
    frames = []
    for distance, angle, sight in zip(range_m, bearing, in_sight, strict=True):
        fresh, new = rng.standard_normal(count), sight & ~before
        error = np.where(new, fresh, keep * error + np.sqrt(1 - keep**2) * fresh)
        fading = np.clip(1 - DROP_SHARE - (distance - 20) / (case.farthest_m - 20) * 0.75, 0.05, 1)
        share = np.where(distance < 20, 1 - 0.4 * DROP_SHARE, fading)
        redrawn = new | (rng.uniform(size=count) >= 0.93)
        found = np.where(redrawn, rng.uniform(size=count) < share, found)
        bearing_error = BEARING_DEVIATION_RAD * rng.standard_normal(count)
        before = sight
        seen = np.flatnonzero(sight & found)
        seen = seen[np.argsort(distance[seen])][:MOST_DETECTIONS]
        rows = []
        for pole in seen:
            deviation = close_m if distance[pole] < CLOSE_M else far_m
            measured = float(distance[pole] + deviation * error[pole])
            rows.append(
                Detection(int(pole), measured, deviation**2, float(angle[pole] + bearing_error[pole]))
            )
        frames.append(tuple(rows))
    return tuple(frames)
