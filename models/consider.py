"""An honest covariance beside a particle filter: what its gains make of errors that last.

The spread of the particles answers for white errors alone, as large as the filter weighs them. This is the
covariance analysis of a filter whose gains are not made for its errors (Joseph's form of the update), with lasting
errors as Schmidt's consider parameters: a linear twin carries the covariance that the gains follow, and beside it
the one that the error really has, where ranges err alike for a while and landmarks are misplaced for ever. How much
of that there is, it learns from the innovations. The estimate itself stays as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models import consider_kernels as kernels
from scpf.models.consider_matching import look
from scpf.models.lasting_errors import LastingErrors, LastingSettings
from scpf.models.matched_landmarks import Sighting, rows_of
from scpf.models.motion import ConstantTurnRate

Array = NDArray[np.float64]

UPPER: Final = ((0, 0), (0, 1), (1, 1))
FLATTER: Final = 2.0 / 3.0
"""The variance of the likelihood that a half-normal survival function of deviation 1 makes."""


@dataclass(frozen=True)
class ConsiderSettings:
    """``bearing_noise_rad``: the detector's own, white from frame to frame; what weighs bearings may be wider.

    ``gate``: squared misfit beyond which a detection fits no landmark. ``forget_s``: how long a landmark out of
    sight is kept in mind. ``doubt``: particles that spread over more than so many times the claimed variance show
    more than noise, such as two matches that both fit: what goes beyond is added.
    """

    bearing_noise_rad: float = float(np.radians(0.5))
    gate: float = 25.0
    forget_s: float = 10.0
    doubt: float = 2.0
    lasting: LastingSettings = field(default_factory=LastingSettings)


class ConsiderCovariance:
    """The covariance of R filters' position errors, for states [x, y, vx, vy, ψ, ω] and their motion.

    ``marks`` (L, 3) is the map: x and y (m), and the variance that a place is weighed with, of each axis (m²);
    ``deviations`` (6,) are those of the first states.
    """

    def __init__(
        self,
        settings: ConsiderSettings,
        motion: ConstantTurnRate,
        marks: Array,
        runs: int,
        deviations: Array,
    ) -> None:
        self.settings = settings
        self.motion = motion
        self.lasting = LastingErrors(settings.lasting, runs, len(marks))
        self._marks = np.ascontiguousarray(marks, dtype=float)
        x, y, vx, vy, heading, rate = np.asarray(deviations, dtype=float)
        first = np.diag([x, y, heading, np.hypot(vx, vy) / np.sqrt(2.0), rate]) ** 2
        claimed = np.repeat(first[None], runs, axis=0)
        cross = np.zeros((runs, len(self._marks), 3, kernels.SIZE))
        idle_s = np.full((runs, len(self._marks)), -1.0)
        self._tracked = kernels.Tracked(claimed, claimed.copy(), np.zeros_like(claimed), cross, idle_s)
        self._means = np.zeros((runs, kernels.SIZE))
        self._now_s = 0.0
        self._travelled_m = np.zeros(runs)

    def predict(self, means: Array, dt_s: float) -> None:
        """Move on from the estimated states ``means`` (R, 6) by ``dt_s``."""
        speed = means[:, 2] * np.cos(means[:, 4]) + means[:, 3] * np.sin(means[:, 4])
        self._means = np.column_stack([means[:, :2], means[:, 4], speed, means[:, 5]])
        self._now_s += dt_s
        self._travelled_m += np.abs(speed) * dt_s
        if dt_s > 0.0:
            pairs = (self.motion.along_covariance(dt_s), self.motion.turn_covariance(dt_s))
            noise = np.array([*(pair[i] for pair in pairs for i in UPPER), *self.motion.turn_response(dt_s)])
            keep = float(np.exp(-dt_s / self.settings.lasting.correlation_time_s))
            kernels.advance(self._means, self._tracked, dt_s, noise, keep, self.settings.forget_s)

    def update(
        self,
        fix_variance_m2: float | None,
        heading_variance_rad2: float | None,
        sightings: Sequence[Sighting],
        exponents: Array,
    ) -> None:
        """Take in what the filters took in: a fix, the road's direction, detections tempered by ``exponents`` (R,)."""
        rows = rows_of(sightings)
        which = np.full((len(rows), len(self._means)), -1)
        noise = self.settings.bearing_noise_rad**2
        if len(rows):
            self._look(rows, noise, which)
        if fix_variance_m2 is not None:
            for part in (0, 1):
                kernels.take_in_direct(self._tracked, part, fix_variance_m2)
        if heading_variance_rad2 is not None:
            kernels.take_in_direct(self._tracked, 2, heading_variance_rad2)
        if len(rows):
            detected = (self._marks, rows, which, exponents, FLATTER, noise, self.lasting.share)
            kernels.take_in_landmarks(self._means, self._tracked, *detected)

    def _look(self, rows: Array, noise_rad2: float, which: NDArray[np.int64]) -> None:
        """Match the detections, and learn from how they differ from what is expected."""
        misses, expected = np.zeros((*which.shape, 2)), np.ones((*which.shape, 2))
        seen = (self._marks, rows, noise_rad2, self.settings.gate, which, misses, expected)
        look(self._means, self._tracked, *seen)
        for row, taken, miss, variance in zip(rows, which, misses, expected, strict=True):
            self.lasting.observe_range(self._now_s, taken, miss[:, 0] / row[1])
            self.lasting.observe_bearing(self._now_s, self._travelled_m, taken, miss[:, 1], variance)

    def covariance(self, spread_m2: Array) -> Array:
        """Position covariances (R, 3: xx, xy, yy) of filters whose particles spread by ``spread_m2`` (R, 3)."""
        own: Array = self._whole()[:, [0, 0, 1], [0, 1, 1]]
        return own + self._doubt(spread_m2)

    def state_covariances(self, spread_m2: Array) -> Array:
        """Those of whole states [x, y, vx, vy, ψ, ω] (R, 6, 6); as for ``covariance``."""
        slope = np.zeros((len(self._means), 6, kernels.SIZE))
        slope[:, [0, 1, 4, 5], [0, 1, 2, 4]] = 1.0
        heading, speed = self._means[:, 2], self._means[:, 3]
        slope[:, 2, 2], slope[:, 2, 3] = -speed * np.sin(heading), np.cos(heading)
        slope[:, 3, 2], slope[:, 3, 3] = speed * np.cos(heading), np.sin(heading)
        covariances: Array = slope @ self._whole() @ slope.transpose(0, 2, 1)
        covariances[:, :2, :2] += self._doubt(spread_m2)[:, [0, 1, 1, 2]].reshape(-1, 2, 2)
        return covariances

    def _whole(self) -> Array:
        """Covariances (R, 5, 5) of the errors, the places' share included."""
        whole: Array = self._tracked.plain + self.lasting.offset_m2[:, None, None] * self._tracked.placed
        return whole

    def _doubt(self, spread_m2: Array) -> Array:
        """What particles that spread further than noise alone makes them add (R, 3)."""
        return positive_part(spread_m2 - self.settings.doubt * self._tracked.claimed[:, [0, 0, 1], [0, 1, 1]])


def positive_part(rows: Array) -> Array:
    """Symmetric matrices (R, 3: xx, xy, yy) without their negative eigenvalues."""
    xx, xy, yy = rows.T
    middle, half = 0.5 * (xx + yy), 0.5 * (xx - yy)
    radius = np.hypot(half, xy)
    high, low = np.maximum(middle + radius, 0.0), np.maximum(middle - radius, 0.0)
    # (high + low)/2 · I + (high − low)/2 · the reflection that the deviator is.
    share = 0.5 * (high - low) / np.maximum(radius, 1e-30)
    mean = 0.5 * (high + low)
    return np.column_stack([mean + share * half, share * xy, mean - share * half])
