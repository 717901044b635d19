"""The extended Kalman filter in the place of the particle filter: what a practitioner would compare with first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.bearing_constraint import RoadBearingConstraint
from scpf.models.constraints import Constraint, LandmarkConstraint
from scpf.models.ekf import ExtendedKalmanFilter
from scpf.models.motion import ConstantVelocity
from scpf.models.particle_filter import Belief, FilterSettings, PositionFix, State

Array = NDArray[np.float64]


class KalmanTracker:
    """Steps as `ParticleFilter` does: ``initialise``, then ``predict`` and ``update`` for each frame.

    Of the constraints it takes ranges and bearings of landmarks, as measurements; any other it cannot use. Its belief
    is a Gaussian: the ``states`` of a `Belief` are equal-weighted draws from it, to be shown as particles are, and ESS
    is their number.
    """

    exponent: Final = 1.0

    def __init__(self, motion: ConstantVelocity, settings: FilterSettings, rng: np.random.Generator) -> None:
        self.motion = motion
        self.settings = settings
        # The same normal draws for every frame: the cloud then moves and stretches with the Gaussian, and nothing else.
        self._draws = rng.standard_normal((settings.particles, 4))
        self._filter = ExtendedKalmanFilter(motion, np.zeros((1, 4)), np.eye(4))

    def initialise(self, mean: Array) -> Belief:
        """Begin at ``mean`` [x, y, vx, vy] with the settings' variances."""
        covariance = np.diag(self.settings.initial_variance)
        self._filter = ExtendedKalmanFilter(self.motion, mean[None], covariance)
        return self._belief(0.0, constrained=False, initial=True)

    def predict(self, dt_s: float) -> Array:
        """Move on by ``dt_s``; returns the predicted mean (4,)."""
        self._filter.predict(dt_s)
        mean: Array = self._filter.means[0]
        return mean

    def update(self, constraints: Sequence[Constraint], fix: PositionFix | None = None) -> Belief:
        """Take in the fix, then each landmark's range and bearing."""
        log_evidence, kalman, used = 0.0, self._filter, False
        if fix is not None:
            log_evidence += kalman.update_fix(fix.position_m[None], fix.variance_m2)[0]
        for one in constraints:
            if isinstance(one, LandmarkConstraint):
                mark = one.position_m[None]
                log_evidence += kalman.update_range(mark, one.distance_m, one.variance_m2)[0]
                used = True
            elif isinstance(one, RoadBearingConstraint):
                mark, heading = one.position_m[None], np.array([one.heading_rad])
                variance = one.deviation_rad**2
                log_evidence += kalman.update_bearing(mark, one.bearing_rad, heading, variance)[0]
        return self._belief(float(log_evidence), constrained=used)

    def _belief(self, log_evidence: float, *, constrained: bool, initial: bool = False) -> Belief:
        mean, covariance = self._filter.means[0].copy(), self._filter.covariances[0].copy()
        states = mean + self._draws @ np.linalg.cholesky(covariance + 1e-12 * np.eye(4)).T
        n = len(states)
        state: State = "initialising" if initial else "tracking" if constrained else "unconstrained"
        return Belief(states, np.full(n, -np.log(n)), mean, covariance, float(n), log_evidence, state)
