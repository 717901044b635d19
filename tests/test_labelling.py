"""Labels: the right pole, or none with a reason."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pole_scenes import camera, pose, road_map, see

from scpf.models import labelling
from scpf.models.instances import Instance
from scpf.models.labelling import label

LENS = camera()


def shown(T: np.ndarray, *feet: tuple[float, float], landmark_id: str = "") -> list[Instance]:
    found = [see(LENS, T, foot, landmark_id=landmark_id) for foot in feet]
    assert all(each is not None for each in found)
    return [each for each in found if each is not None]


@given(st.floats(-3.1, 3.1), st.floats(-500, 500), st.floats(8, 55), st.floats(-0.4, 0.4))
@settings(max_examples=60, deadline=None)
def test_a_lone_pole_is_recognised_from_any_pose(yaw: float, x: float, reach: float, aside: float) -> None:
    T = pose(x, -x, yaw)
    foot = tuple((T @ [reach, reach * aside, 0.0, 1.0])[:2])
    (found,) = label(shown(T, foot), LENS, T, road_map(foot, (foot[0] + 500.0, 0.0)))
    assert found.landmark_id == "P0"
    assert found.reason == ""
    assert found.distance_m == pytest.approx(reach * np.hypot(1.0, aside))  # from the body, not the camera


def test_two_poles_near_each_other_are_told_apart() -> None:
    feet = ((25.0, 3.0), (25.5, 4.0))  # two degrees apart
    T = pose()
    for order in (feet, feet[::-1]):
        found = label(shown(T, *order), LENS, T, road_map(*feet))
        assert [each.landmark_id for each in found] == [f"P{feet.index(foot)}" for foot in order]


def test_two_candidates_for_one_instance_are_doubtful() -> None:
    feet = ((25.0, 3.0), (25.2, 3.1))
    (found,) = label(shown(pose(), feet[0]), LENS, pose(), road_map(*feet))
    assert found.landmark_id == ""
    assert found.distance_m is None
    assert found.reason == labelling.AMBIGUOUS


def test_two_instances_for_one_landmark_are_doubtful() -> None:
    found = label(shown(pose(), (25.0, 3.0), (25.0, 3.1)), LENS, pose(), road_map((25.0, 3.05)))
    assert [each.reason for each in found] == [labelling.AMBIGUOUS] * 2


def test_a_poorer_second_instance_is_left_out() -> None:
    found = label(shown(pose(), (25.0, 3.0), (25.0, 3.7)), LENS, pose(), road_map((25.0, 3.0)))
    assert found[0].landmark_id == "P0"
    assert found[1].reason == labelling.TAKEN


def test_another_object_at_the_same_bearing_is_no_landmark() -> None:
    # Seen is an unmapped pole at 10 m; the map has one at 50 m in the same direction of the camera.
    (found,) = label(shown(pose(), (10.0, 1.0)), LENS, pose(), road_map((50.4, 6.0)))
    assert found.landmark_id == ""
    assert found.reason in (labelling.BAD_BASE, labelling.NO_LANDMARK)
    camera_m, near = np.array([1.9, 0.0]), np.array([10.0, 1.0])
    far = tuple(camera_m + 6.0 * (near - camera_m))
    (found,) = label(shown(pose(), (10.0, 1.0)), LENS, pose(), road_map(far))
    assert found.reason == labelling.BAD_BASE


def test_too_high_for_a_pole() -> None:
    T = pose()
    tall = see(LENS, T, (50.0, 0.0), height_m=22.0)
    assert tall is not None
    (found,) = label([tall], LENS, T, road_map((50.0, 0.0)))
    assert found.reason == labelling.BAD_HEIGHT


def test_reasons_for_none() -> None:
    T = pose()
    seen = shown(T, (20.0, 3.0))
    assert label(seen, LENS, T, road_map((20.0, -6.0)))[0].reason == labelling.NO_LANDMARK
    assert label(seen, LENS, T, road_map())[0].reason == labelling.NO_LANDMARK
    assert label(seen, LENS, T, road_map((20.0, 3.0)), max_distance_m=15.0)[0].reason != ""
    behind = road_map((-20.0, -3.0))
    assert label(seen, LENS, T, behind)[0].reason == labelling.NO_LANDMARK
    assert label([], LENS, T, behind) == []


def test_told_truth_wins() -> None:
    T = pose()
    feet = ((20.0, 3.0), (20.2, 3.1), (90.0, 0.0))
    seen = [
        *shown(T, feet[1], landmark_id="P1"),
        *shown(T, feet[2], landmark_id="P2"),
        *shown(T, (30.0, -5.0), landmark_id="elsewhere"),
    ]
    found = label(seen, LENS, T, road_map(*feet))
    assert [each.landmark_id for each in found] == ["P1", "", ""]
    assert [each.reason for each in found] == ["", labelling.TOO_FAR, labelling.NOT_MAPPED]
    # What one instance is told is no rival for the others any more.
    mixed = [*shown(T, feet[1], landmark_id="P1"), *shown(T, feet[0])]
    assert [each.landmark_id for each in label(mixed, LENS, T, road_map(*feet))] == ["P1", "P0"]


def test_heights_of_the_map_and_of_the_body() -> None:
    high = pose()
    high[2, 3] = 312.0  # the reference knows its height, a map drawn from above does not
    seen = shown(pose(), (20.0, 3.0))
    assert label(seen, LENS, high, road_map((20.0, 3.0)))[0].landmark_id == "P0"
    assert label(seen, LENS, high, road_map((20.0, 3.0), up_m=312.0))[0].landmark_id == "P0"


def test_classes_do_not_mix() -> None:
    from dataclasses import replace

    seen = [replace(shown(pose(), (20.0, 3.0))[0], landmark_class="traffic_sign")]
    assert label(seen, LENS, pose(), road_map((20.0, 3.0)))[0].landmark_id == ""


def test_bearings_off_by_less_than_the_gate_and_the_maps_deviation() -> None:
    T = pose()
    seen = shown(T, (20.0, 3.0))
    for degrees, expected in ((2.2, "P0"), (3.1, "")):
        turned = pose(yaw_rad=np.radians(degrees))  # the map adds two times 0.2 m / 18.1 m: 1.3°
        assert label(seen, LENS, turned, road_map((20.0, 3.0)))[0].landmark_id == expected
