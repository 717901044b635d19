"""What all landmarks' residuals tell of errors: how large they are, how much lasts, what directions have in common."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.survey_fit import FitSettings, Lasting, Located, Sights, jacobian, misses, shares

Array = NDArray[np.float64]
Seen = tuple[Sights, Located]
"""The sightings of a landmark, and where they place it."""

MEDIAN_TO_DEVIATION: Final = 1.4826
"""Of a normal distribution's median absolute value."""
FEWEST_PAIRS: Final = 100
LARGEST: Final = 3.0
"""In deviations: a single outlier says nothing about how long the others last."""


def common_bearing(seen: Sequence[Seen], settings: FitSettings, deviation_rad: float) -> tuple[float, float]:
    """The error (rad) that all directions share, and its deviation, by the landmarks' sightings and fits.

    Where a landmark is seen from far and near, an error of every direction leaves residuals that no position removes.
    With rows J, weights w and residuals e of a landmark, the residuals of its best position follow e − b·g, g = 1/σ for
    directions and 0 for ranges; so gᵀPe = b·gᵀPg, P = W − WJ(JᵀWJ)⁻¹JᵀW. ``deviation_rad`` is believed of b beforehand.
    """
    told, known = 0.0, deviation_rad**-2
    for sights, located in seen:
        mine = sights.rows(located.kept)
        rows = jacobian(mine, located.position_m, settings).reshape(-1, 2)
        weights = shares(mine, settings).ravel()
        information = rows.T @ (weights[:, None] * rows)
        if np.linalg.cond(information) > 1e12:
            continue
        g = np.tile([0.0, 1.0 / settings.bearing_deviation_rad], len(mine))
        shown = rows @ np.linalg.solve(information, rows.T @ (weights * g))
        left = weights * (g - shown)
        told -= float(left @ misses(mine, located.position_m, settings).ravel())
        known += float(left @ g)
    return told / known, float(known**-0.5)


def scales(seen: Sequence[Seen]) -> tuple[float, float]:
    """How many times as large as stated the deviations of ranges and directions are; at least 1."""
    if not seen:
        return 1.0, 1.0
    sizes = np.abs(np.concatenate([located.residuals for _, located in seen]))
    found = np.maximum(MEDIAN_TO_DEVIATION * np.median(sizes, axis=0), 1.0)
    return float(found[0]), float(found[1])


def lasting(seen: Sequence[Seen], scale: tuple[float, float], settings: FitSettings) -> FitSettings:
    """``settings`` with the shares that last, out of pairs of residuals half that time apart.

    ``scale``: as ``scales`` finds. With few such pairs the shares stay.
    """
    times = [sights.times_s for sights, _ in seen]
    ranges, bearings = ([located.residuals[:, k] / scale[k] for _, located in seen] for k in (0, 1))
    return replace(
        settings,
        ranges=_measured(times, ranges, settings.ranges),
        bearings=_measured(times, bearings, settings.bearings),
    )


def _measured(times_s: Sequence[Array], residuals: Sequence[Array], stated: Lasting) -> Lasting:
    pairs, product, expected = 0, 0.0, 0.0
    for times, values in zip(times_s, residuals, strict=True):
        later = np.searchsorted(times, times + 0.5 * stated.time_s)
        first = np.flatnonzero(later < len(times))
        second = later[first]
        gap_s = times[second] - times[first]
        near = gap_s < stated.time_s
        bounded = np.clip(values, -LARGEST, LARGEST)
        a, b = bounded[first[near]], bounded[second[near]]
        pairs += len(a)
        product += float(a @ b)
        expected += float(0.5 * (a**2 + b**2) @ np.exp(-gap_s[near] / stated.time_s))
    if pairs < FEWEST_PAIRS or expected <= 0.0:
        return stated
    return replace(stated, share=float(np.clip(product / expected, 0.0, 1.0)))
