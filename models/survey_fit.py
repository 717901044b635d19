"""Where one landmark stands, by ranges and directions to it from known poses: robust least squares, with covariance.

Errors that last weigh less than their number says. Whatever is seen within about a second errs alike, so that N
sightings count as N² / Σ ρ_ij only, where ρ_ij is the correlation of two of them.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.geodesy import wrap_angle

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

NEAREST_M: Final = 0.1
"""Nearer than this a direction says nothing."""


@dataclass(frozen=True, eq=False)
class Sights:
    """N sightings of landmarks from known poses, ordered by time.

    ``times_s`` (N,); those of one frame are equal. ``ranged_from_m`` (N, 2): the points in map that ``distances_m``
    (N,), of variance ``variances_m2`` (N,), are measured from. ``seen_from_m`` (N, 2): the camera's own place, which
    ``directions_rad`` (N,) in map, counter-clockwise from East, point from. ``landmark_classes`` (N,).
    """

    times_s: Array
    ranged_from_m: Array
    distances_m: Array
    variances_m2: Array
    seen_from_m: Array
    directions_rad: Array
    landmark_classes: NDArray[np.str_]

    def __len__(self) -> int:
        return len(self.times_s)

    def rows(self, which: NDArray[np.intp] | Flags) -> Sights:
        """The sightings that ``which`` (indices or flags) selects."""
        return Sights(**{name: values[which] for name, values in vars(self).items()})

    def stretched(self, scale: float) -> Sights:
        """The same with range deviations ``scale`` times as large."""
        return replace(self, variances_m2=scale**2 * self.variances_m2)

    def turned(self, angle_rad: float) -> Sights:
        """The same with all directions turned to the left."""
        return replace(self, directions_rad=self.directions_rad + angle_rad)


@dataclass(frozen=True)
class Lasting:
    """Errors of which ``share`` of the variance lasts for ``time_s``, the rest is new in each sighting.

    Two of them, t apart, are correlated by share · exp(−t / time_s).
    """

    share: float = 1.0
    time_s: float = 1.0


@dataclass(frozen=True)
class FitSettings:
    """``bearing_deviation_rad``: of the directions, the pose's own heading included, at best.

    ``common_bearing_rad``: deviation of an error that all directions share, such as the camera's mounting. ``ranges``,
    ``bearings``: how their own errors last. ``gate``: a sighting whose range and direction together miss by more (χ², 2
    degrees of freedom) is rejected.
    """

    bearing_deviation_rad: float = float(np.radians(0.2))
    ranges: Lasting = field(default_factory=Lasting)
    bearings: Lasting = field(default_factory=Lasting)
    common_bearing_rad: float = 0.0
    gate: float = 13.8


@dataclass(frozen=True, eq=False)
class Located:
    """A landmark's ``position_m`` (2,) in map with ``covariance_m2`` (2, 2), of N sightings.

    ``residuals`` (N, 2): of range and direction, in their deviations. ``kept`` (N,): not rejected. ``effective``: as
    how many independent ranges the kept ones count.
    """

    position_m: Array
    covariance_m2: Array
    residuals: Array
    kept: Flags
    effective: float


def locate(sights: Sights, start_m: Array, settings: FitSettings) -> Located:
    """The landmark that all of ``sights`` (at least one) show, sought from ``start_m`` (2,).

    A soft-L1 fit finds what does not agree with the rest; what is left is weighed by plain least squares. The
    covariance is that of this estimate under errors that are correlated as ``settings`` say. It is infinite where
    sightings do not determine the place.
    """
    kept = np.ones(len(sights), dtype=np.bool_)
    position = _fit(sights, start_m, settings, "soft_l1")
    for _ in range(2):
        agreeing = (misses(sights, position, settings) ** 2).sum(1) < settings.gate
        if not agreeing.any():
            break
        kept = agreeing
        position = _fit(sights.rows(kept), position, settings, "linear")
    covariance, effective = _covariance(sights.rows(kept), position, settings)
    return Located(position, covariance, misses(sights, position, settings), kept, effective)


def effective_number(times_s: Array, lasting: Lasting) -> float:
    """As how many independent errors those at ``times_s`` (N,), ascending, count in their mean: 1 … N."""
    ones = np.ones((len(times_s), 1))
    return float(len(times_s) ** 2 / _spread(ones, times_s, lasting)[0, 0])


def _fit(sights: Sights, start_m: Array, settings: FitSettings, loss: str) -> Array:
    """The position (2,) of least loss."""
    from scipy.optimize import least_squares

    share = shares(sights, settings).ravel()

    def counted(squared: Array) -> Array:
        """The loss and its two derivatives (3, 2N), each row as much as its share of independent sightings."""
        if loss == "linear":
            return share * np.stack([squared, np.ones_like(squared), np.zeros_like(squared)])
        root = np.sqrt(1.0 + squared)
        return share * np.stack([2.0 * (root - 1.0), 1.0 / root, -0.5 / root**3])

    found = least_squares(
        lambda position: misses(sights, position, settings).ravel(),
        start_m,
        jac=lambda position: jacobian(sights, position, settings).reshape(-1, 2),
        loss=counted,
    )
    position: Array = found.x
    return position


def shares(sights: Sights, settings: FitSettings) -> Array:
    """What part (N, 2) of an independent sighting each range and each direction is."""
    kinds = (settings.ranges, settings.bearings)
    return np.tile([effective_number(sights.times_s, kind) / len(sights) for kind in kinds], (len(sights), 1))


def misses(sights: Sights, position_m: Array, settings: FitSettings) -> Array:
    """Expected minus measured range and direction (N, 2), in their deviations."""
    ahead, seen = position_m - sights.ranged_from_m, position_m - sights.seen_from_m
    off_m = np.hypot(*ahead.T) - sights.distances_m
    off_rad = wrap_angle(np.arctan2(seen[:, 1], seen[:, 0]) - sights.directions_rad)
    return np.column_stack([off_m / np.sqrt(sights.variances_m2), off_rad / settings.bearing_deviation_rad])


def jacobian(sights: Sights, position_m: Array, settings: FitSettings) -> Array:
    """Derivatives (N, 2, 2) of the residuals by the position."""
    ahead, seen = position_m - sights.ranged_from_m, position_m - sights.seen_from_m
    unit = ahead / np.maximum(np.hypot(*ahead.T), NEAREST_M)[:, None]
    turn = np.column_stack([-seen[:, 1], seen[:, 0]]) / np.maximum((seen**2).sum(1), NEAREST_M**2)[:, None]
    return np.stack(
        [unit / np.sqrt(sights.variances_m2)[:, None], turn / settings.bearing_deviation_rad], axis=1
    )


def _covariance(sights: Sights, position_m: Array, settings: FitSettings) -> tuple[Array, float]:
    """Covariance (2, 2) of the least-squares position, and the effective number of ranges.

    With rows J_i and shares w_i, the position's error is A⁻¹ Σ w_i J_i e_i, A = Σ w_i J_i J_iᵀ; hence A⁻¹ B A⁻¹ with
    B = Σ w_i w_j ρ_ij J_i J_jᵀ over pairs of ranges and pairs of directions, and what directions have in common.
    """
    rows, share = jacobian(sights, position_m, settings), shares(sights, settings)
    pulls = share[:, :, None] * rows
    information = np.einsum("nka,nkb->ab", pulls, rows)
    effective = float(share[:, 0].sum())
    if np.linalg.cond(information) > 1e12:
        return np.diag([np.inf, np.inf]), effective
    spread = _spread(pulls[:, 0], sights.times_s, settings.ranges)
    spread += _spread(pulls[:, 1], sights.times_s, settings.bearings)
    common = pulls[:, 1].sum(0) * settings.common_bearing_rad / settings.bearing_deviation_rad
    spread += np.outer(common, common)
    inverse = np.linalg.inv(information)
    covariance: Array = inverse @ spread @ inverse.T
    return covariance, effective


def _spread(vectors: Array, times_s: Array, lasting: Lasting) -> Array:
    """Σ_ij ρ_ij v_i v_jᵀ (D, D) of vectors (N, D) at ascending times, ρ as ``lasting`` says and 1 for i = j."""
    fade = np.exp(-np.diff(times_s, prepend=times_s[:1]) / lasting.time_s)
    before = np.zeros_like(vectors)
    for n in range(1, len(vectors)):
        before[n] = fade[n] * (before[n - 1] + vectors[n - 1])
    once = lasting.share * vectors.T @ before
    total: Array = vectors.T @ vectors + once + once.T
    return total
