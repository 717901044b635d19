"""How large errors of ranges and directions really are, and how much of them lasts: told by all residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.survey_fit import FitSettings, Lasting

Array = NDArray[np.float64]

MEDIAN_TO_DEVIATION: Final = 1.4826
"""Of a normal distribution's median absolute value."""
FEWEST_PAIRS: Final = 100
LARGEST: Final = 3.0
"""In deviations: a single outlier says nothing about how long the others last."""


def scales(residuals: Sequence[Array]) -> tuple[float, float]:
    """How many times as large as stated deviations of ranges and directions are; at least 1.

    ``residuals``: (N, 2) of each landmark, in the stated deviations.
    """
    if not residuals:
        return 1.0, 1.0
    found = np.maximum(MEDIAN_TO_DEVIATION * np.median(np.abs(np.concatenate(residuals)), axis=0), 1.0)
    return float(found[0]), float(found[1])


def lasting(times_s: Sequence[Array], residuals: Sequence[Array], settings: FitSettings) -> FitSettings:
    """``settings`` with the shares that last, out of pairs of residuals half that time apart.

    ``times_s``: (N,), ascending, and ``residuals``: (N, 2), in their deviations, of each landmark. With few such
    pairs the shares stay.
    """
    return replace(
        settings,
        ranges=_measured(times_s, [each[:, 0] for each in residuals], settings.ranges),
        bearings=_measured(times_s, [each[:, 1] for each in residuals], settings.bearings),
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
