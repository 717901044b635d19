"""Landmark matching without an answer: every particle weighs every candidate for itself.

A single match made at the estimate is wrong for all particles at once when it is wrong, and a false constraint
costs more than a missing one. Here each particle takes, for each detection, the landmark that fits it best, one
to one; the floor ε for "none of them" bounds what a false detection can do to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.matched_kernels import measure_matched

Array = NDArray[np.float64]

CANDIDATE_RANGE_M: Final = 90.0
CANDIDATE_BEHIND_M: Final = 15.0
"""Landmarks this near, and no further behind, are candidates: others cannot be in sight, whatever the error."""


@dataclass(frozen=True)
class Sighting:
    """One detection: range (m) and bearing (rad) with the deviations to weigh them by."""

    distance_m: float
    distance_deviation_m: float
    bearing_rad: float
    bearing_deviation_rad: float


def rows_of(sightings: Sequence[Sighting]) -> Array:
    """Sightings as rows (M, 4): distance, its deviation, bearing, its deviation."""
    rows = [(s.distance_m, s.distance_deviation_m, s.bearing_rad, s.bearing_deviation_rad) for s in sightings]
    return np.array(rows, dtype=float).reshape(-1, 4)


@dataclass(frozen=True, eq=False)
class MatchedLandmarks:
    """All detections of a frame against candidate ``positions_m`` (L, 2), for states with a heading.

    For a particle and a detection, log((1 − ε)·S + ε): S is the product of the half-normal survivals of range and
    bearing for the best candidate. Where two detections take one candidate, the worse one takes its second best,
    or the floor if that is taken too. ``variances_m2`` (L,) of the candidates' places, of each axis, widen range and
    bearing; None for a map that is exact. ``exponent`` tempers the sum.
    """

    positions_m: Array
    sightings: Sequence[Sighting]
    floor: float = 0.001
    exponent: float = 1.0
    variances_m2: Array | None = None
    name: str = "landmarks"

    def violation(self, states: Array) -> Array:
        """Σ over detections of the range error (m) to the landmark that the particle takes; 0 for none."""
        return self.both(states)[0]

    def log_probability(self, states: Array) -> Array:
        """Σ over detections of the tempered log of floor and best fit (N,)."""
        return self.both(states)[1]

    def both(self, states: Array) -> tuple[Array, Array]:
        """Violation and log-probability (N,) by one matching, in single precision about the states' middle."""
        none = np.zeros(len(states))
        if not len(self.positions_m) or not self.sightings or not len(states):
            return none, none
        middle = states[:, :2].mean(axis=0)
        local = np.empty((3, len(states)), np.float32)
        local[:2], local[2] = (states[:, :2] - middle).T, states[:, 4]
        marks = np.zeros((len(self.positions_m), 3), np.float32)
        marks[:, :2] = self.positions_m - middle
        marks[:, 2] = 0.0 if self.variances_m2 is None else self.variances_m2
        violation, log_probability = np.empty((2, len(states)), np.float32)
        rows = rows_of(self.sightings)
        measure_matched(local, marks, rows, self.floor, self.exponent, violation, log_probability)
        return violation.astype(float), log_probability.astype(float)
