"""How well detections fit the map in the long run, and how much they should count.

A map that is off, or a camera that is, makes every detection fit worse than its variance says, for long. Errors
that last teach nothing anew from frame to frame, so that the worse the fit, the less a detection may count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scpf.models.geodesy import wrap_angle
from scpf.models.matched_landmarks import Sighting

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FitSettings:
    """``expected``: mean misfit where map and variances are right. ``memory``: detections averaged over.

    ``steepness``: the exponent falls with this power of the misfit. ``largest`` bounds a single misfit, since a
    false detection says nothing about the others.
    """

    expected: float = 0.5
    memory: float = 1000.0
    steepness: float = 2.0
    largest: float = 6.0


class FitMonitor:
    """The running mean misfit of R runs: half the squared deviations of range and bearing, for the best landmark."""

    def __init__(self, settings: FitSettings, runs: int) -> None:
        self.settings = settings
        self.misfit = np.full(runs, settings.expected)

    def observe(
        self, offsets_m: Array, headings_rad: Array, position_variances_m2: Array, seen: Sighting
    ) -> None:
        """Take in one detection, the landmarks ``offsets_m`` (R, L, 2) away from the runs, which head (R,).

        ``position_variances_m2`` (R,) are those of the runs' own positions, an axis.
        """
        east, north = offsets_m[..., 0], offsets_m[..., 1]
        range_m, own = np.hypot(east, north), position_variances_m2[:, None]
        off = wrap_angle(np.arctan2(north, east) - headings_rad[:, None] - seen.bearing_rad)
        squared = (range_m - seen.distance_m) ** 2 / (seen.distance_deviation_m**2 + own)
        squared += off**2 / (seen.bearing_deviation_rad**2 + own / np.maximum(range_m, 1.0) ** 2)
        misfit = np.minimum(0.5 * squared.min(axis=1), self.settings.largest)
        self.misfit = self.misfit + (misfit - self.misfit) / self.settings.memory

    @property
    def share(self) -> Array:
        """What share (R,) of its tempered weight a detection keeps: 1 where the fit is as expected or better."""
        ratio = self.settings.expected / np.maximum(self.misfit, self.settings.expected)
        share: Array = ratio**self.settings.steepness
        return share
