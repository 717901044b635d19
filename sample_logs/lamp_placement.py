"""Where the light poles stand along the centre line, and where the map says that they stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scpf.sample_logs.centre_line import CentreLine
from scpf.sample_logs.ground import ground_height_m

OFFSET_M = 4.75
"""From the centre line: a metre outside the kerb."""
OFFSET_DEVIATION_M = 0.12
PAIR_SHARE, GAP_SHARE = 0.06, 0.05
JITTER = 0.2
"""Standard deviation along the road, as a share of the spacing."""
SMALLEST_STEP_M = 9.0
"""Between two poles that are not a pair."""


@dataclass(frozen=True)
class LightPole:
    """One light pole, numbered from 1 in the order of the road; positions in map_local, metres."""

    id: int
    s_m: float
    offset_m: float
    position_m: NDArray[np.float64]
    """(3,), where it stands."""
    mapped_position_m: NDArray[np.float64]
    """(2,), where the map has it."""


def place_poles(
    centre_line: CentreLine,
    count: int = 99,
    *,
    seed: int,
    mapped_error_m: tuple[float, float] = (1.0, 2.0),
) -> tuple[LightPole, ...]:
    """Place ``count`` poles over the whole centre line, evenly but for jitter, gaps, and pairs face to face.

    Sides change in runs of 6 to 14 poles. The map is wrong by a distance drawn from ``mapped_error_m``
    for each pole, in any direction, and stays so; (0, 0) makes an exact map.
    """
    rng = np.random.default_rng([seed, 2])
    places = _along_the_road(centre_line, count, rng)
    side, run_left, poles = 1.0, 0, []
    for k, (s_m, is_pair) in enumerate(places):
        if is_pair:
            side = -side
        elif run_left <= 0:
            side, run_left = float(rng.choice([-1.0, 1.0])), int(rng.integers(6, 15))
        run_left -= 1
        offset_m = side * (OFFSET_M + float(np.clip(rng.normal(0, OFFSET_DEVIATION_M), -0.3, 0.3)))
        if is_pair:
            side = -side
        poles.append(_pole(centre_line, k + 1, s_m, offset_m, mapped_error_m, rng))
    return tuple(poles)


def poles_of_a_map(
    centre_line: CentreLine,
    mapped_positions_m: ArrayLike,
    *,
    seed: int,
    mapped_error_m: tuple[float, float] = (1.0, 2.0),
) -> tuple[LightPole, ...]:
    """Poles that a map already has, mapped_positions_m (N, 2); they truly stand 1 to 2 m beside it.

    A pole that would stand in a lane is pushed out to the kerb.
    """
    rng = np.random.default_rng([seed, 2])
    mapped = np.asarray(mapped_positions_m, np.float64).reshape(-1, 2)
    true = mapped + [_error(mapped_error_m, rng) for _ in mapped]
    poles = []
    for k, (s_m, across_m) in enumerate(zip(*centre_line.project(true), strict=True)):
        offset_m = float(np.copysign(max(abs(across_m), OFFSET_M), across_m))
        stands = _standing_at(centre_line, float(s_m), offset_m)
        poles.append(LightPole(k + 1, float(s_m), offset_m, stands, mapped[k]))
    return tuple(poles)


def _along_the_road(
    centre_line: CentreLine, count: int, rng: np.random.Generator
) -> list[tuple[float, bool]]:
    """(s_m, whether it is the second of a pair) of each pole, rising."""
    second = rng.uniform(size=count) < PAIR_SHARE
    second[0] = False
    second[1:] &= ~second[:-1]
    steps = np.where(second, 0.0, np.where(rng.uniform(size=count) < GAP_SHARE, 2.0, 1.0))
    spacing_m = centre_line.length_m / steps.sum()
    middles = np.cumsum(steps) - steps / 2
    jitter = np.clip(rng.normal(0, JITTER, count), -0.33, 0.33)
    places: list[tuple[float, bool]] = []
    for k in range(count):
        if second[k]:
            places.append((places[-1][0] + float(rng.uniform(0.3, 2.0)), True))
        else:
            s_m = float((middles[k] + jitter[k]) * spacing_m)
            earliest = places[-1][0] + SMALLEST_STEP_M if places else 0.0
            places.append((max(s_m, min(earliest, centre_line.length_m)), False))
    return places


def _pole(
    centre_line: CentreLine,
    number: int,
    s_m: float,
    offset_m: float,
    mapped_error_m: tuple[float, float],
    rng: np.random.Generator,
) -> LightPole:
    stands = _standing_at(centre_line, s_m, offset_m)
    return LightPole(number, s_m, offset_m, stands, stands[:2] + _error(mapped_error_m, rng))


def _standing_at(centre_line: CentreLine, s_m: float, offset_m: float) -> NDArray[np.float64]:
    position, _, _ = centre_line.at(s_m, offset_m)
    return np.array([position[0], position[1], position[2] + ground_height_m(offset_m)])


def _error(mapped_error_m: tuple[float, float], rng: np.random.Generator) -> NDArray[np.float64]:
    distance, direction = rng.uniform(*mapped_error_m), rng.uniform(0, 2 * np.pi)
    return distance * np.array([np.cos(direction), np.sin(direction)])
