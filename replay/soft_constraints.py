"""The soft constraints of a step: road and speed, and what the landmarks in sight say."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scpf.models.association import Match
from scpf.models.bearing_constraint import HeadingConstraint, RoadBearingConstraint
from scpf.models.constraints import Constraint, LandmarkConstraint, RoadConstraint, SpeedConstraint
from scpf.models.matched_landmarks import (
    CANDIDATE_BEHIND_M,
    CANDIDATE_RANGE_M,
    MatchedLandmarks,
    Sighting,
)
from scpf.models.observation import Observation
from scpf.models.road_map import RoadMap
from scpf.replay.settings import HeadingSettings, Settings

Array = NDArray[np.float64]


def soft_constraints(
    settings: Settings,
    road_map: RoadMap,
    observations: Sequence[Observation],
    matches: Sequence[Match],
    predicted: Array,
    yaw_rad: float,
    exponent: float = 1.0,
) -> list[Constraint]:
    """The constraints about the ``predicted`` state (D,), whose heading is ``yaw_rad``.

    ``matches`` run parallel to ``observations``. The paper's are road, speed and the range of each matched landmark.
    ``exponent`` tempers the landmarks that every particle matches for itself.
    """
    wanted = settings.constraints
    constraints: list[Constraint] = []
    segment = road_map.segment_near(predicted[:2]) if wanted.road else None
    if segment is not None:
        constraints.append(RoadConstraint(segment, road_map.half_width_m, wanted.road_slack_mean_m))
    if wanted.speed:
        constraints.append(SpeedConstraint(wanted.speed_limit_mps, wanted.speed_slack_mean_mps))
    if settings.heading is not None:
        return [
            *constraints,
            *_of_every_particle(settings, settings.heading, road_map, observations, predicted, exponent),
        ]
    if not wanted.landmarks:
        return constraints
    for observation, match in zip(observations, matches, strict=True):
        mark = road_map.landmark(match.landmark_id)
        if mark is None:
            continue
        distance, position_m = observation.distance, np.array(mark.position_m[:2])
        variance_m2 = distance.variance_m2 + mark.variance_m2
        constraints.append(LandmarkConstraint(mark.id, position_m, distance.mean_m, variance_m2))
        if settings.kalman is not None:
            deviation = np.hypot(
                settings.kalman.bearing_deviation_rad, np.sqrt(mark.variance_m2) / distance.mean_m
            )
            constraints.append(
                RoadBearingConstraint(mark.id, position_m, observation.bearing_rad, yaw_rad, float(deviation))
            )
    return constraints


def _of_every_particle(
    settings: Settings,
    heading: HeadingSettings,
    road_map: RoadMap,
    observations: Sequence[Observation],
    predicted: Array,
    exponent: float,
) -> list[Constraint]:
    """Beyond the paper: the road's direction, and every particle's own match of range and bearing."""
    constraints: list[Constraint] = []
    direction = road_map.direction_near(predicted[:2], predicted[2:4])
    if direction is not None:
        constraints.append(HeadingConstraint(direction, heading.road_deviation_rad))
    if not settings.constraints.landmarks:
        return constraints
    offset = road_map.positions_m - predicted[:2]
    ahead = offset @ np.array([np.cos(predicted[4]), np.sin(predicted[4])])
    candidates = (np.hypot(*offset.T) < CANDIDATE_RANGE_M) & (ahead > -CANDIDATE_BEHIND_M)
    marks = [mark for mark, near in zip(road_map.landmarks, candidates, strict=True) if near]
    for name in dict.fromkeys(mark.landmark_class for mark in marks):
        sightings = [
            Sighting(
                seen.distance.mean_m,
                float(np.sqrt(seen.distance.variance_m2)),
                seen.bearing_rad,
                heading.bearing_deviation_rad,
            )
            for seen in observations
            if seen.instance.landmark_class == name and seen.distance.in_range and seen.distance.mean_m > 0.0
        ]
        if sightings:
            same = [mark for mark in marks if mark.landmark_class == name]
            positions = np.array([mark.position_m[:2] for mark in same])
            own = np.array([mark.variance_m2 for mark in same])
            constraints.append(MatchedLandmarks(positions, sightings, heading.floor, exponent, own))
    return constraints
