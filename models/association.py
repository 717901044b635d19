"""Landmark matching: which mapped landmark a detection shows, when nobody says.

``NearestNeighbour`` is the paper's way, with one addition: a doubtful match is left out, since a false
constraint costs more than a missing one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scpf.models.geodesy import wrap_angle
from scpf.models.observation import Observation
from scpf.models.road_map import RoadMap

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Match:
    """The landmark that one observation was matched to; ``landmark_id`` "" where it was left out, with the reason."""

    landmark_id: str
    reason: str = ""


@dataclass(frozen=True)
class NearestNeighbour:
    """Nearest landmark in range and bearing from the estimated pose, one to one, doubtful matches left out.

    ``gate``: largest accepted squared Mahalanobis distance (χ², 2 degrees of freedom). ``rival_gap``: a second
    landmark within this much of the best squared distance makes the match doubtful. ``bearing_deviation_rad``:
    deviation of bearing and heading together. ``max_distance_m``: landmarks further off are no candidates.
    """

    gate: float = 13.8
    rival_gap: float = 6.0
    bearing_deviation_rad: float = float(np.radians(4.0))
    max_distance_m: float = 80.0

    def match(
        self,
        observations: Sequence[Observation],
        road_map: RoadMap,
        position_m: Array,
        position_covariance_m2: Array,
        yaw_rad: float,
    ) -> list[Match]:
        """Matches of the observations, in their order.

        ``position_m`` (2,), ``position_covariance_m2`` (2, 2) and ``yaw_rad`` are the predicted pose in map.
        """
        if not observations or not road_map.landmarks:
            return [Match("", "no landmark on the map")] * len(observations)
        offset = road_map.positions_m - position_m
        range_m = np.hypot(*offset.T)
        unit = offset / np.maximum(range_m, 1e-9)[:, None]
        along = np.einsum("li,ij,lj->l", unit, position_covariance_m2, unit)
        normal = np.column_stack([-unit[:, 1], unit[:, 0]])
        across = np.einsum("li,ij,lj->l", normal, position_covariance_m2, normal)
        bearing = wrap_angle(np.arctan2(offset[:, 1], offset[:, 0]) - yaw_rad)
        own = np.array([mark.variance_m2 for mark in road_map.landmarks])

        squared = np.empty((len(observations), len(range_m)))
        for row, observation in zip(squared, observations, strict=True):
            in_range = (range_m - observation.distance.mean_m) ** 2
            in_range /= observation.distance.variance_m2 + along + own
            in_bearing = wrap_angle(bearing - observation.bearing_rad) ** 2
            in_bearing /= self.bearing_deviation_rad**2 + (across + own) / np.maximum(range_m, 1.0) ** 2
            row[:] = in_range + in_bearing
        squared[:, range_m > self.max_distance_m] = np.inf
        for column, mark in enumerate(road_map.landmarks):
            for row, observation in zip(squared, observations, strict=True):
                if mark.landmark_class != observation.instance.landmark_class:
                    row[column] = np.inf
        trusted = np.array([observation.distance.in_range for observation in observations])
        squared[~trusted] = np.inf
        return self._one_to_one(squared, [mark.id for mark in road_map.landmarks], trusted)

    def _one_to_one(
        self, squared: Array, landmark_ids: Sequence[str], trusted: NDArray[np.bool_]
    ) -> list[Match]:
        """Matches from squared distances (observations, landmarks): each pair must be the other's best."""
        matches: list[Match] = []
        for index, row in enumerate(squared):
            best = int(np.argmin(row))
            rivals = np.sort(np.delete(row, best))
            competitors = np.delete(squared[:, best], index)
            if not trusted[index]:
                matches.append(Match("", "outside the training range"))
            elif row[best] > self.gate:
                matches.append(Match("", "no landmark near enough"))
            elif len(rivals) and rivals[0] - row[best] < self.rival_gap:
                matches.append(Match("", "two landmarks fit"))
            elif len(competitors) and competitors.min() - row[best] < self.rival_gap:
                matches.append(Match("", "two detections compete"))
            else:
                matches.append(Match(landmark_ids[best]))
        return matches
