"""Drives past poles with what they saw of them, for the tests of surveys."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scpf.models.geodesy import wrap_angle
from scpf.models.road_map import Landmark, RoadMap
from scpf.models.survey_fit import Sights

POLES = np.array([[20.0 + 25.0 * k, 6.0 if k % 2 else -5.0] for k in range(8)])
CAMERA_AHEAD_M = 1.9
RATE_HZ = 10.0
RANGE_DEVIATION_M = 0.8
BEARING_DEVIATION_RAD = float(np.radians(0.5))


@dataclass(frozen=True)
class Noise:
    """Errors in their deviations; ``range_s`` and ``bearing_s``: how long they last, 0 for white ones."""

    range_s: float = 1.0
    bearing_s: float = 0.0
    scale: float = 1.0


def drive(
    poles: np.ndarray, noise: Noise | None, rng: np.random.Generator, speed_mps: float = 5.0
) -> tuple[Sights, np.ndarray]:
    """Sightings of ``poles`` (L, 2) on a slightly winding drive along x, and the pole (N,) that each shows."""
    times = np.arange(0.0, (poles[:, 0].max() + 10.0) / speed_mps, 1.0 / RATE_HZ)
    body = np.column_stack([speed_mps * times, np.sin(0.3 * times)])
    yaw = 0.06 * np.cos(0.3 * times)
    camera = body + CAMERA_AHEAD_M * np.column_stack([np.cos(yaw), np.sin(yaw)])
    parts, shown = [], []
    for k, pole in enumerate(poles):
        ahead = pole - camera
        bearing = np.arctan2(ahead[:, 1], ahead[:, 0])
        reach = np.hypot(*ahead.T)
        seen = (np.abs(wrap_angle(bearing - yaw)) < np.radians(40)) & (reach > 4) & (reach < 45)
        n = int(seen.sum())
        ranges, bearings = np.zeros(n), np.zeros(n)
        if noise is not None:
            ranges = noise.scale * lasting(n, noise.range_s, rng)
            bearings = noise.scale * lasting(n, noise.bearing_s, rng)
        parts.append(
            (
                times[seen],
                body[seen],
                np.hypot(*(pole - body[seen]).T) + RANGE_DEVIATION_M * ranges,
                np.full(n, RANGE_DEVIATION_M**2),
                camera[seen],
                bearing[seen] + BEARING_DEVIATION_RAD * bearings,
                np.full(n, "light_pole"),
            )
        )
        shown.append(np.full(n, k))
    sights = Sights(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    order = np.argsort(sights.times_s, kind="stable")
    return sights.rows(order), np.concatenate(shown)[order]


def lasting(count: int, time_s: float, rng: np.random.Generator) -> np.ndarray:
    """Normal errors (count,) that follow a first-order autoregression."""
    keep = np.exp(-1.0 / RATE_HZ / time_s) if time_s > 0.0 else 0.0
    errors = rng.standard_normal(count)
    for k in range(1, count):
        errors[k] = keep * errors[k - 1] + np.sqrt(1 - keep**2) * errors[k]
    return errors


def wrong_map(
    poles: np.ndarray, rng: np.random.Generator, off_m: tuple[float, float] = (1.0, 2.0)
) -> RoadMap:
    """A map whose poles are all off by so much, in any direction."""
    off, turn = rng.uniform(*off_m, len(poles)), rng.uniform(0, 2 * np.pi, len(poles))
    mapped = poles + off[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    marks = tuple(Landmark(f"P{k}", (float(x), float(y), 3.0)) for k, (x, y) in enumerate(mapped))
    return RoadMap(marks, np.array([[0.0, 0.0], [300.0, 0.0]]))


def moved(sights: Sights, turn_rad: float, shift_m: np.ndarray) -> Sights:
    """The same sightings in a frame that is turned and shifted."""
    return replace(
        sights,
        ranged_from_m=turned(sights.ranged_from_m, turn_rad) + shift_m,
        seen_from_m=turned(sights.seen_from_m, turn_rad) + shift_m,
        directions_rad=sights.directions_rad + turn_rad,
    )


def turned(points_m: np.ndarray, turn_rad: float) -> np.ndarray:
    """Points (N, 2) turned about the origin, counter-clockwise."""
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    return points_m @ np.array([[c, s], [-s, c]])
