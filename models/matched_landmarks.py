"""Landmark matching without an answer: every particle weighs every candidate for itself.

A single match made at the estimate is wrong for all particles at once when it is wrong, and a false constraint
costs more than a missing one. Here each particle takes, for each detection, the landmark that fits it best, one
to one; the floor ε for "none of them" bounds what a false detection can do to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scpf.models.constraints import half_normal_log_survival
from scpf.models.geodesy import wrap_angle

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sighting:
    """One detection: range (m) and bearing (rad) with the deviations to weigh them by."""

    distance_m: float
    distance_deviation_m: float
    bearing_rad: float
    bearing_deviation_rad: float


@dataclass(frozen=True, eq=False)
class MatchedLandmarks:
    """All detections of a frame against candidate ``positions_m`` (L, 2), for states with a heading.

    For a particle and a detection, log((1 − ε)·S + ε): S is the product of the half-normal survivals of range and
    bearing for the best candidate. Where two detections take one candidate, the worse one takes its second best,
    or the floor if that is taken too. ``exponent`` tempers the sum.
    """

    positions_m: Array
    sightings: Sequence[Sighting]
    floor: float = 0.001
    exponent: float = 1.0
    name: str = "landmarks"

    def violation(self, states: Array) -> Array:
        """Σ over detections of the range error (m) to the landmark that the particle takes; 0 for none."""
        if not len(self.positions_m) or not self.sightings:
            return np.zeros(len(states))
        range_m = np.hypot(*(self.positions_m[None] - states[:, None, :2]).transpose(2, 0, 1))
        total = np.zeros(len(states))
        rows = np.arange(len(states))
        for sighting, (_, taken) in zip(self.sightings, self._choices(states), strict=True):
            off = np.abs(range_m[rows, np.maximum(taken, 0)] - sighting.distance_m)
            total += np.where(taken >= 0, off, 0.0)
        return total

    def log_probability(self, states: Array) -> Array:
        """Σ over detections of the tempered log of floor and best fit (N,)."""
        total = np.zeros(len(states))
        if len(self.positions_m):
            for log_fit, _ in self._choices(states):
                total += np.log((1.0 - self.floor) * np.exp(log_fit) + self.floor)
        return self.exponent * total

    def _choices(self, states: Array) -> list[tuple[Array, NDArray[np.intp]]]:
        """For each detection: log S (N,) and the index (N,) of the candidate taken, −1 for none."""
        east, north = (self.positions_m[None] - states[:, None, :2]).transpose(2, 0, 1)
        range_m, direction = np.hypot(east, north), np.arctan2(north, east) - states[:, 4, None]
        fits = []
        for seen in self.sightings:
            fit = half_normal_log_survival(np.abs(range_m - seen.distance_m), seen.distance_deviation_m)
            off = np.abs(wrap_angle(direction - seen.bearing_rad))
            fits.append(fit + half_normal_log_survival(off, seen.bearing_deviation_rad))
        order = [np.argsort(-fit, axis=1, kind="stable")[:, :2] for fit in fits]
        rows = np.arange(len(states))
        best = [fit[rows, two[:, 0]] for fit, two in zip(fits, order, strict=True)]
        choices = []
        for m, (fit, two) in enumerate(zip(fits, order, strict=True)):
            second = two[:, -1]
            loses = np.zeros(len(states), dtype=bool)
            none_left = np.full(len(states), two.shape[1] < 2)
            for k, rival in enumerate(order):
                if k != m:
                    beaten = (best[k] > best[m]) | ((best[k] == best[m]) & (k < m))
                    loses |= (rival[:, 0] == two[:, 0]) & beaten
                    none_left |= rival[:, 0] == second
            taken = np.where(loses, np.where(none_left, -1, second), two[:, 0])
            log_fit = np.where(taken >= 0, fit[rows, np.maximum(taken, 0)], -np.inf)
            choices.append((log_fit, taken))
        return choices
