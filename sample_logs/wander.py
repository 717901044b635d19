"""Smooth noise along a road: the same at the same place, bounded, with as many derivatives as one likes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

WAVES = 8


class Wander:
    """A sum of ``WAVES`` sine waves of drawn lengths and phases, with standard deviation ``deviation``.

    Never beyond ``bound`` = 4 deviations. ``wavelengths_m``: the shortest and the longest.
    """

    def __init__(
        self, rng: np.random.Generator, deviation: float, wavelengths_m: tuple[float, float]
    ) -> None:
        shortest, longest = np.log(wavelengths_m)
        self._waves_per_m = 2 * np.pi / np.exp(rng.uniform(shortest, longest, WAVES))
        self._phases = rng.uniform(0.0, 2 * np.pi, WAVES)
        self._amplitude = deviation * np.sqrt(2 / WAVES)
        self.bound = float(WAVES * self._amplitude)

    def at(self, s_m: ArrayLike) -> Array:
        """The noise (...) at lengths ``s_m`` (...) along the road."""
        return self._sum(np.sin, s_m, np.ones(WAVES))

    def slope(self, s_m: ArrayLike) -> Array:
        """Its derivative (...) by length, per metre."""
        return self._sum(np.cos, s_m, self._waves_per_m)

    def _sum(self, wave: np.ufunc, s_m: ArrayLike, weights: Array) -> Array:
        angle = np.asarray(s_m, np.float64)[..., None] * self._waves_per_m + self._phases
        total: Array = self._amplitude * (wave(angle) @ weights)
        return total
