"""What the Monte Carlo runs of every estimator share: the map, the road's direction, matching, the first spread."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.association import NearestNeighbour
from scpf.models.batch_matching import nearest_landmarks
from scpf.replay.evaluation_presets import Estimator
from scpf.replay.protocol import Detection, Scenario
from scpf.replay.protocol_drive import Ring

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

NO_BEARING_RAD: Final = 1e3
"""So wide a deviation that a bearing says nothing."""
INITIAL_DEVIATIONS: Final = np.sqrt([10.0, 10.0, 2.5, 2.5])


class RoadTracker:
    """Where each run is along the ring: its nearest point, searched near the last one."""

    def __init__(self, ring: Ring, positions_m: Array) -> None:
        self._ring = ring
        off = ring.line_m[None] - positions_m[:, None]
        self._nearest = np.argmin((off**2).sum(2), axis=1)

    def direction_rad(self, positions_m: Array) -> Array:
        """Direction of travel (R,) of the road at the runs' positions (R, 2)."""
        window = (self._nearest[:, None] + np.arange(-20, 21)) % len(self._ring.line_m)
        off = self._ring.line_m[window] - positions_m[:, None]
        chosen = np.argmin((off**2).sum(2), axis=1)
        self._nearest = window[np.arange(len(window)), chosen]
        direction: Array = self._ring.direction_rad[self._nearest]
        return direction


class Runs:
    """What both kinds of estimator share: the map, the road's direction, matching around the estimate."""

    def __init__(
        self,
        settings: Estimator,
        scenario: Scenario,
        sigma_m: float,
        first: Array,
        seeds: Sequence[int],
        known_matching: bool,
    ) -> None:
        self.settings = settings
        self.fix_variance_m2 = sigma_m**2
        self.known_matching = known_matching
        self.positions_m = scenario.road_map.positions_m
        self.variances_m2 = np.array([mark.variance_m2 for mark in scenario.road_map.landmarks])
        self.road = RoadTracker(scenario.ring, first[:, :2])
        self.matching = NearestNeighbour()

    def which(
        self, detections: Sequence[Detection], poses_m: Array, covariances_m2: Array, yaws_rad: Array
    ) -> Indices:
        """The landmark (M, R) of each detection in each run, −1 for none."""
        if self.known_matching:
            return np.repeat([[d.landmark] for d in detections], len(poses_m), axis=1)
        rows = np.array([(d.distance_m, d.variance_m2, d.bearing_rad) for d in detections])
        rows[:, 1] += self.settings.landmark_variance_m2
        around = (self.positions_m, poses_m, covariances_m2, yaws_rad)
        return nearest_landmarks(self.matching, *around, rows, self.variances_m2)

    def range_variance_m2(self, detection: Detection) -> float:
        """The variance that a range is weighed by, the landmark's own apart."""
        return detection.variance_m2 + self.settings.landmark_variance_m2

    def bearing_deviation_rad(self, detection: Detection) -> float:
        """The deviation that a bearing is weighed by, what the landmark's own variance makes of it apart."""
        own = self.settings.bearing_deviation_rad
        if own is None:
            return NO_BEARING_RAD
        return float(np.hypot(own, self.settings.landmark_deviation_m / max(detection.distance_m, 1.0)))
