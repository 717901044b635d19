"""How much of the detections' errors lasts: found out from what the filter itself sees, run by run.

Two kinds of errors come again frame after frame and teach nothing new then: a distance model errs alike on like
views of a pole for about a second, and a pole that is mapped off its place is off for ever. Innovations of white
errors are white. Those of one landmark that are alike in the next frame show the first kind; those that are still
alike a few metres on, where the first kind is gone and the view another, show the second.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class LastingSettings:
    """What is believed at first, and how it is learnt from.

    Ranges: errors last for ``correlation_time_s``; ``first_share`` of their variance is believed to last at first, as
    if ``first_detections`` had shown it; ``memory`` detections are averaged over, each compared with its landmark's
    last one if that is no older than ``longest_gap_s``.

    Places: ``first_offset_m2`` is the variance (m² an axis) that is believed at first, as if ``first_landmarks`` had
    shown it. Bearings are compared that lie ``apart_s`` and ``apart_m`` of the way apart; ``few`` such comparisons
    give a landmark half its say, since it has but one place. ``leftover``: the share of the filter's own variance that
    comes again all the same, since no vehicle moves quite as a motion model says.

    ``largest`` and ``farthest_m`` bound what a single detection can say: squared deviations, displacement.
    """

    correlation_time_s: float = 1.0
    first_share: float = 0.5
    first_detections: float = 100.0
    memory: float = 1000.0
    longest_gap_s: float = 0.5
    first_offset_m2: float = 0.02
    first_landmarks: float = 0.5
    apart_s: float = 1.0
    apart_m: float = 4.0
    few: float = 1.0
    leftover: float = 0.07
    largest: float = 9.0
    farthest_m: float = 3.0


@dataclass(frozen=True)
class LastingTempering:
    """The exponent of landmark constraints: ``white`` where errors do not last, ``lasting`` where all of a range's do.

    Landmarks whose places are off by a variance of ``offset_m2`` an axis count half of that.
    """

    white: float = 0.5
    lasting: float = 0.2
    offset_m2: float = 0.5

    def exponent(self, share: Array, offset_m2: Array) -> Array:
        """Exponents (R,) where a ``share`` (R,) of ranges' variance lasts and places are off by ``offset_m2`` (R,)."""
        repeats = 1.0 / self.white + share * (1.0 / self.lasting - 1.0 / self.white)
        exponent: Array = 1.0 / (repeats * (1.0 + offset_m2 / self.offset_m2))
        return exponent


class LastingErrors:
    """Running estimates for R runs: ``share`` (R,) of a range's variance, ``offset_m2`` (R,) of places, an axis."""

    def __init__(self, settings: LastingSettings, runs: int, landmarks: int) -> None:
        self.settings = settings
        self.share = np.full(runs, settings.first_share)
        self._rows = np.arange(runs)
        self._detections = np.full(runs, settings.first_detections)
        self._products = np.full(runs, settings.first_share)
        self._squares = np.ones(runs)
        self._range_miss = np.zeros((runs, landmarks))
        self._range_s = np.full((runs, landmarks), -np.inf)
        self._displacement_m = np.zeros((runs, landmarks))
        self._seen_s = np.full((runs, landmarks), -np.inf)
        self._seen_m = np.full((runs, landmarks), -np.inf)
        self._offsets = np.zeros((runs, landmarks))
        self._weights = np.zeros((runs, landmarks))
        self.offset_m2 = self._mean_offset_m2()

    def observe_range(self, now_s: float, which: Indices, misses: Array) -> None:
        """Take in innovations (R,) of a range, in its deviations, of landmark ``which`` (R,; −1 for none)."""
        settings, rows = self.settings, self._rows
        seen, mark = which >= 0, np.maximum(which, 0)
        before, gap_s = self._range_miss[rows, mark], now_s - self._range_s[rows, mark]
        again = seen & (gap_s <= settings.longest_gap_s)
        if again.any():
            age = np.exp(-np.where(again, gap_s, 0.0) / settings.correlation_time_s)
            product = np.clip(misses * before, -settings.largest, settings.largest)
            square = np.minimum(0.5 * (misses**2 + before**2), settings.largest)
            self._detections = np.minimum(self._detections + again, settings.memory)
            news = again / self._detections
            self._products = self._products + news * (product - self._products)
            self._squares = self._squares + news * (age * square - self._squares)
            self.share = np.clip(self._products / self._squares, 0.0, 1.0)
        self._range_miss[rows[seen], mark[seen]] = misses[seen]
        self._range_s[rows[seen], mark[seen]] = now_s

    def observe_bearing(
        self, now_s: float, travelled_m: Array, which: Indices, misses_rad: Array, variances: Array
    ) -> None:
        """Take in innovations (R,) of a bearing of landmark ``which`` (R,; −1 for none), ``travelled_m`` (R,) on.

        ``variances`` (R, 2): of the innovation on a perfect map (rad²), and what each m² of the landmarks' places
        adds to it (rad²/m²).
        """
        settings, rows, mark = self.settings, self._rows, np.maximum(which, 0)
        own, placed = np.maximum(variances, 1e-12).T
        displacement = np.clip(misses_rad / np.sqrt(placed), -settings.farthest_m, settings.farthest_m)
        due = (which >= 0) & (now_s - self._seen_s[rows, mark] >= settings.apart_s)
        due &= travelled_m - self._seen_m[rows, mark] >= settings.apart_m
        # Where the filter itself is less certain than a metre, its own error is what comes again.
        again = due & np.isfinite(self._seen_s[rows, mark]) & (own < placed)
        if again.any():
            weight = again * (placed / (own + placed)) ** 2
            product = displacement * self._displacement_m[rows, mark] - settings.leftover * own / placed
            self._offsets[rows, mark] += weight * product
            self._weights[rows, mark] += weight
            self.offset_m2 = self._mean_offset_m2()
        self._displacement_m[rows[due], mark[due]] = displacement[due]
        self._seen_s[rows[due], mark[due]] = now_s
        self._seen_m[rows[due], mark[due]] = travelled_m[due]

    def _mean_offset_m2(self) -> Array:
        """The mean over landmarks, and a share for what so few of them leave unsaid."""
        first, say = self.settings.first_landmarks, 1.0 / (self._weights + self.settings.few)
        landmarks = first + (self._weights * say).sum(1)
        mean = (first * self.settings.first_offset_m2 + (self._offsets * say).sum(1)) / landmarks
        offset: Array = np.maximum(mean, 0.0) * (1.0 + 1.0 / (landmarks + 1.0))
        return offset
