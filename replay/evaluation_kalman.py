"""Monte Carlo runs of the extended Kalman filter, all in lock-step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scpf.models.ekf import ExtendedKalmanFilter
from scpf.models.motion import ConstantVelocity
from scpf.replay.evaluation_common import INITIAL_DEVIATIONS, Runs
from scpf.replay.evaluation_presets import Estimator
from scpf.replay.protocol import Detection, Scenario

Array = NDArray[np.float64]


class KalmanRuns(Runs):
    """The extended Kalman filter's runs."""

    def __init__(
        self,
        settings: Estimator,
        scenario: Scenario,
        sigma_m: float,
        first: Array,
        seeds: Sequence[int],
        known_matching: bool,
    ) -> None:
        super().__init__(settings, scenario, sigma_m, first, seeds, known_matching)
        motion = ConstantVelocity(settings.q_m2ps3)
        self.filter = ExtendedKalmanFilter(motion, first, np.diag(INITIAL_DEVIATIONS**2))

    def step(self, dt_s: float, fixes_m: Array, detections: Sequence[Detection]) -> tuple[Array, Array]:
        """Means (R, 4) and position covariances (R, 3) after a frame."""
        kalman = self.filter
        kalman.predict(dt_s)
        yaws = self.road.direction_rad(kalman.means[:, :2])
        poses, spread = kalman.means[:, :2].copy(), self._spread()
        kalman.update_fix(fixes_m, self.fix_variance_m2)
        if detections:
            matched = self.which(detections, poses, spread, yaws)
            for detection, which in zip(detections, matched, strict=True):
                marks, used = self.positions_m[which], which >= 0
                own = self.variances_m2[which]
                variance = self.range_variance_m2(detection) + own
                kalman.update_range(marks, detection.distance_m, variance, used)
                if self.settings.bearing_deviation_rad is not None:
                    variance = self.bearing_deviation_rad(detection) ** 2
                    variance = variance + own / max(detection.distance_m, 1.0) ** 2
                    kalman.update_bearing(marks, detection.bearing_rad, yaws, variance, used)
        return kalman.means, self._spread()

    def _spread(self) -> Array:
        rows: Array = self.filter.covariances[:, [0, 0, 1], [0, 1, 1]]
        return rows
