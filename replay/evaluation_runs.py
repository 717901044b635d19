"""Monte Carlo runs of one estimator over one scenario."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.replay.evaluation_common import INITIAL_DEVIATIONS
from scpf.replay.evaluation_kalman import KalmanRuns
from scpf.replay.evaluation_particles import ParticleRuns
from scpf.replay.evaluation_presets import Estimator
from scpf.replay.protocol import Scenario, gps_fixes

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

NO_FIX_VARIANCE_M2: Final = 1e12
"""So wide a variance that a fix says nothing."""


@dataclass(frozen=True, eq=False)
class Estimates:
    """Estimates in R runs of K frames.

    ``positions_m`` (R, K, 2), their ``covariances_m2`` (R, K, 3: xx, xy, yy), and ``headings_rad`` (R, K): that of the
    velocity where an estimator has no other.
    """

    positions_m: Array
    covariances_m2: Array
    headings_rad: Array


def run_estimator(
    settings: Estimator,
    scenario: Scenario,
    sigma_m: float,
    seeds: Sequence[int],
    known_matching: bool,
    fixed: Mask | None = None,
) -> Estimates:
    """Run the estimator once a seed on fixes of deviation ``sigma_m``, in the frames ``fixed`` (K,) or all.

    A run's fixes and first state depend on its seed alone: estimators are compared on the same ones.
    """
    drive = scenario.drive
    fixes = np.empty((len(seeds), *drive.positions_m.shape))
    first = np.empty((len(seeds), 4))
    truth = np.concatenate([drive.positions_m[0], drive.velocities_mps[0]])
    for r, seed in enumerate(seeds):
        rng = np.random.default_rng([seed, 11])
        first[r] = truth + INITIAL_DEVIATIONS * rng.standard_normal(4)
        fixes[r] = gps_fixes(drive, sigma_m, rng)
    make = KalmanRuns if settings.kind == "kalman" else ParticleRuns
    runs = make(settings, scenario, sigma_m, first, seeds, known_matching)
    positions = np.empty((len(seeds), len(drive.positions_m), 2))
    covariances = np.empty((len(seeds), len(drive.positions_m), 3))
    headings = np.empty((len(seeds), len(drive.positions_m)))
    intervals_s = np.diff(scenario.times_s, prepend=scenario.times_s[0])
    for k, detections in enumerate(scenario.detections):
        runs.fix_variance_m2 = sigma_m**2 if fixed is None or fixed[k] else NO_FIX_VARIANCE_M2
        mean, covariance = runs.step(float(intervals_s[k]), fixes[:, k], detections)
        positions[:, k], covariances[:, k] = mean[:, :2], covariance
        headings[:, k] = mean[:, 4] if mean.shape[1] > 4 else np.arctan2(mean[:, 3], mean[:, 2])
    return Estimates(positions, covariances, headings)
