"""Error figures of Monte Carlo runs against the truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SETTLING_FRAMES: Final = 100
"""The consistency figures leave out the first frames, where the initial spread rules."""
DIVERGED_WINDOW_FRAMES: Final = 390
DIVERGED_M: Final = 5.0
MEAN_OF_RAYLEIGH: Final = float(np.sqrt(np.pi / 2))
VARIANCE_FLOOR_M2: Final = 1e-4


@dataclass(frozen=True)
class Metrics:
    """Figures over R runs of K frames; errors are horizontal, in m.

    ``run_low_m`` … ``run_high_m`` hold 95 % of the runs' means. ``longitudinal_m`` and ``lateral_m`` are mean
    absolute errors along and across the true heading. ``diverged_runs``: those where the mean error over some 30 s
    exceeds 5 m and that of a raw fix. ``nees``: mean normalised estimation error squared of the position (2 where
    the covariance is right); for R consistent runs, 95 % of a single frame's means lie in ``nees_low`` …
    ``nees_high``. ``inside_95``: share of frames with the truth inside the 95 % ellipse. ``poles_0_m`` …
    ``poles_3_m``: mean errors in the frames that detected none, one, two, and three poles or more; None where
    there is no such frame.
    """

    runs: int
    frames: int
    mean_m: float
    median_m: float
    rmse_m: float
    p95_m: float
    max_m: float
    run_low_m: float
    run_high_m: float
    longitudinal_m: float
    lateral_m: float
    diverged_runs: int
    diverged_share: float
    nees: float
    nees_low: float
    nees_high: float
    inside_95: float
    poles_0_m: float | None
    poles_1_m: float | None
    poles_2_m: float | None
    poles_3_m: float | None


def position_errors(positions_m: Array, truth_m: Array) -> Array:
    """Horizontal errors (R, K) in m of positions (R, K, 2) against the truth (K, 2)."""
    off = positions_m - truth_m
    errors: Array = np.hypot(off[..., 0], off[..., 1])
    return errors


def normalised_squared_errors(positions_m: Array, covariances_m2: Array, truth_m: Array) -> Array:
    """Normalised errors squared (R, K); ``covariances_m2`` (R, K, 3) are xx, xy, yy.

    A centimetre's variance is added an axis: particles that a resampling made equal have none.
    """
    east, north = np.moveaxis(positions_m - truth_m, -1, 0)
    xx, xy, yy = np.moveaxis(covariances_m2, -1, 0)
    xx, yy = xx + VARIANCE_FLOOR_M2, yy + VARIANCE_FLOOR_M2
    squared: Array = (yy * east**2 - 2 * xy * east * north + xx * north**2) / (xx * yy - xy**2)
    return squared


def diverged(errors_m: Array, sigma_m: float) -> NDArray[np.bool_]:
    """Which runs (R,) of ``errors_m`` (R, K) lost the vehicle, for fixes of deviation ``sigma_m``."""
    window = min(DIVERGED_WINDOW_FRAMES, errors_m.shape[1])
    total = np.cumsum(np.pad(errors_m, ((0, 0), (1, 0))), axis=1)
    worst = (total[:, window:] - total[:, :-window]).max(axis=1) / window
    lost: NDArray[np.bool_] = worst > max(DIVERGED_M, MEAN_OF_RAYLEIGH * sigma_m)
    return lost


def measure(
    positions_m: Array,
    covariances_m2: Array,
    truth_m: Array,
    headings_rad: Array,
    sigma_m: float,
    poles: NDArray[np.int64],
) -> Metrics:
    """The figures of estimates (R, K, 2) and (R, K, 3) against truth (K, 2) and heading (K,).

    ``poles`` (K,): how many were detected in each frame.
    """
    from scipy.stats import chi2

    errors = position_errors(positions_m, truth_m)
    runs, frames = errors.shape
    off = positions_m - truth_m
    along = off[..., 0] * np.cos(headings_rad) + off[..., 1] * np.sin(headings_rad)
    across = off[..., 1] * np.cos(headings_rad) - off[..., 0] * np.sin(headings_rad)
    settled = min(SETTLING_FRAMES, frames // 2)
    squared = normalised_squared_errors(positions_m, covariances_m2, truth_m)[:, settled:]
    low, high = chi2.ppf([0.025, 0.975], 2 * runs) / runs
    lost = diverged(errors, sigma_m)
    by_poles = [_mean(errors[:, np.minimum(poles, 3) == count]) for count in range(4)]
    by_run = np.percentile(errors.mean(axis=1), [2.5, 97.5])
    return Metrics(
        runs=runs,
        frames=frames,
        mean_m=float(errors.mean()),
        median_m=float(np.median(errors)),
        rmse_m=float(np.sqrt((errors**2).mean())),
        p95_m=float(np.percentile(errors, 95)),
        max_m=float(errors.max()),
        run_low_m=float(by_run[0]),
        run_high_m=float(by_run[1]),
        longitudinal_m=float(np.abs(along).mean()),
        lateral_m=float(np.abs(across).mean()),
        diverged_runs=int(lost.sum()),
        diverged_share=float(lost.mean()),
        nees=float(squared.mean()),
        nees_low=float(low),
        nees_high=float(high),
        inside_95=float((squared < chi2.ppf(0.95, 2)).mean()),
        poles_0_m=by_poles[0],
        poles_1_m=by_poles[1],
        poles_2_m=by_poles[2],
        poles_3_m=by_poles[3],
    )


def _mean(values: Array) -> float | None:
    return float(values.mean()) if values.size else None
