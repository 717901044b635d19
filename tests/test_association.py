"""Nearest-neighbour matching: right where it is clear, silent where it is not."""

from __future__ import annotations

import numpy as np

from scpf.models.association import NearestNeighbour
from scpf.models.instances import Instance
from scpf.models.observation import Distance, Observation
from scpf.models.road_map import Landmark, RoadMap


def seen(distance_m: float, bearing_deg: float, landmark_class: str = "light_pole") -> Observation:
    instance = Instance((0, 0, 4, 40), np.ones((40, 4), bool), (0, 0), 0.95, landmark_class)
    return Observation(instance, Distance(distance_m, 0.5, 0.2, "far"), float(np.radians(bearing_deg)))


def road(*positions: tuple[float, float]) -> RoadMap:
    marks = tuple(Landmark(f"P{k}", (x, y, 0.0)) for k, (x, y) in enumerate(positions))
    return RoadMap(marks, np.zeros((0, 2)))


def match(road_map: RoadMap, *observations: Observation, covariance: float = 0.5) -> list[tuple[str, str]]:
    found = NearestNeighbour().match(observations, road_map, np.zeros(2), covariance * np.eye(2), 0.0)
    return [(one.landmark_id, one.reason) for one in found]


def test_clear_cases_are_matched_in_the_observations_order() -> None:
    road_map = road((20.0, 6.0), (45.0, -5.0))
    near, far = seen(20.9, 16.7), seen(45.3, -6.3)
    assert [found for found, _ in match(road_map, near, far)] == ["P0", "P1"]
    assert [found for found, _ in match(road_map, far, near)] == ["P1", "P0"]


def test_doubtful_matches_are_left_out_with_the_reason() -> None:
    assert match(road((20.0, 6.0)), seen(35.0, 16.7)) == [("", "no landmark near enough")]
    twins = road((20.0, 6.0), (20.6, 6.2))
    assert match(twins, seen(20.9, 16.7)) == [("", "two landmarks fit")]
    rivals = match(road((20.0, 6.0)), seen(20.9, 16.7), seen(20.8, 16.9))
    assert rivals == [("", "two detections compete")] * 2


def test_a_wide_belief_makes_neighbours_doubtful() -> None:
    road_map = road((20.0, 6.0), (26.0, 7.0))
    assert match(road_map, seen(20.9, 16.7), covariance=0.1)[0][0] == "P0"
    assert match(road_map, seen(20.9, 16.7), covariance=60.0)[0][1] == "two landmarks fit"


def test_another_class_and_an_empty_map_match_nothing() -> None:
    assert match(road((20.0, 6.0)), seen(20.9, 16.7, "traffic_sign"))[0][0] == ""
    assert match(road(), seen(20.9, 16.7)) == [("", "no landmark on the map")]
    assert match(road((20.0, 6.0))) == []
