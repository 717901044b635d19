"""The baseline that a practitioner would try first: an extended Kalman filter with constant velocity.

States [x, y, vx, vy] of R runs at once, (R, 4), covariances (R, 4, 4); every measurement is a scalar update, and
one run is the case R = 1. Where all is linear (fixes alone) it is the Kalman filter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scpf.models.geodesy import wrap_angle
from scpf.models.motion import ConstantVelocity

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class ExtendedKalmanFilter:
    """Constant velocity, position fixes, ranges and bearings of landmarks."""

    def __init__(self, motion: ConstantVelocity, means: Array, covariance: Array) -> None:
        self.motion = motion
        self.means = np.array(means, dtype=float)
        self.covariances = np.repeat(np.asarray(covariance, dtype=float)[None], len(self.means), axis=0)

    def predict(self, dt_s: float) -> None:
        """Move on by ``dt_s``."""
        transition, noise = np.eye(4), np.zeros((4, 4))
        transition[0, 2] = transition[1, 3] = dt_s
        for axis in (0, 1):
            noise[axis::2, axis::2] = self.motion.covariance(dt_s)
        self.means = self.means @ transition.T
        self.covariances = transition @ self.covariances @ transition.T + noise

    def update_fix(self, fixes_m: Array, variance_m2: float) -> Array:
        """Take in a position fix (R, 2) a run; returns its log-evidence (R,), as all updates do."""
        log_evidence = np.zeros(len(self.means))
        for axis in (0, 1):
            slope = np.zeros_like(self.means)
            slope[:, axis] = 1.0
            log_evidence += self._update(slope, fixes_m[:, axis] - self.means[:, axis], variance_m2, None)
        return log_evidence

    def update_range(
        self, landmarks_m: Array, distance_m: float, variance_m2: float | Array, used: Mask | None = None
    ) -> Array:
        """Take in a distance to a landmark (R, 2), in the runs ``used`` (R,)."""
        offset = self.means[:, :2] - landmarks_m
        expected = np.maximum(np.hypot(*offset.T), 1e-6)
        slope = np.zeros_like(self.means)
        slope[:, :2] = offset / expected[:, None]
        return self._update(slope, distance_m - expected, variance_m2, used)

    def update_bearing(
        self,
        landmarks_m: Array,
        bearing_rad: float,
        headings_rad: Array,
        variance_rad2: float | Array,
        used: Mask | None = None,
    ) -> Array:
        """Take in a landmark's bearing; the heading (R,) is given (the road's), since the state has none."""
        offset = self.means[:, :2] - landmarks_m
        squared = np.maximum((offset**2).sum(1), 1e-6)
        slope = np.zeros_like(self.means)
        slope[:, 0], slope[:, 1] = -offset[:, 1] / squared, offset[:, 0] / squared
        expected = np.arctan2(-offset[:, 1], -offset[:, 0]) - headings_rad
        return self._update(slope, wrap_angle(bearing_rad - expected), variance_rad2, used)

    def _update(self, slope: Array, innovation: Array, variance: float | Array, used: Mask | None) -> Array:
        """The scalar update with rows ``slope`` (R, 4); the innovation's log-density (R,), 0 where unused."""
        moved = np.einsum("rij,rj->ri", self.covariances, slope)
        expected_square = (moved * slope).sum(1) + variance
        gain = moved / expected_square[:, None]
        log_evidence: Array = -0.5 * (innovation**2 / expected_square + np.log(2 * np.pi * expected_square))
        if used is not None:
            gain = np.where(used[:, None], gain, 0.0)
            log_evidence = np.where(used, log_evidence, 0.0)
        self.means = self.means + gain * innovation[:, None]
        # gain·movedᵀ is symmetric by construction: the covariance stays so without a repair.
        self.covariances = self.covariances - gain[:, :, None] * moved[:, None, :]
        return log_evidence
