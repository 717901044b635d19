"""Bearing, heading and matching by every particle: laws, and one case worked by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scpf.models.bearing_constraint import BearingConstraint, HeadingConstraint
from scpf.models.constraints import LandmarkConstraint, log_probability
from scpf.models.matched_landmarks import MatchedLandmarks, Sighting

MARKS = np.array([[20.0, 6.0], [24.0, -6.0], [45.0, 6.5], [-30.0, 2.0]])
SEEN = (Sighting(21.5, 0.8, 0.3, 0.05), Sighting(25.2, 1.1, -0.24, 0.05))


def states(n: int = 60, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.normal(0, 1, (n, 6)) * np.array([2.0, 2.0, 5.0, 5.0, 0.1, 0.1])


def test_violations_are_angles() -> None:
    here = np.array([[0.0, 0.0, 5.0, 0.0, 0.0, 0.0], [0.0, 0.0, -5.0, 0.0, np.pi + 0.1, 0.0]])
    seen = BearingConstraint("7", np.array([10.0, 10.0]), np.pi / 4, 0.05)
    np.testing.assert_allclose(seen.violation(here), [0.0, np.pi - 0.1])
    assert seen.log_probability(here)[0] == 0.0
    np.testing.assert_allclose(HeadingConstraint(np.pi).violation(here), [np.pi, 0.1])
    assert HeadingConstraint(np.pi, 0.2).log_probability(here)[1] == pytest.approx(-0.5 * (0.1 / 0.2) ** 2)
    assert seen.name.startswith("landmark")


@given(st.floats(-4.0, 4.0), st.floats(-500, 500), st.floats(-500, 500))
def test_a_rigid_motion_of_the_world_changes_nothing(turn: float, east: float, north: float) -> None:
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    shift, here = np.array([east, north]), states()
    there = here.copy()
    there[:, :2] = here[:, :2] @ R.T + shift
    there[:, 2:4] = here[:, 2:4] @ R.T
    there[:, 4] += turn
    moved = MARKS @ R.T + shift
    before = [
        MatchedLandmarks(MARKS, SEEN),
        HeadingConstraint(0.2),
        LandmarkConstraint("a", MARKS[0], 21.0, 0.5),
        BearingConstraint("a", MARKS[0], 0.3, 0.05),
    ]
    after = [
        MatchedLandmarks(moved, SEEN),
        HeadingConstraint(0.2 + turn),
        LandmarkConstraint("a", moved[0], 21.0, 0.5),
        BearingConstraint("a", moved[0], 0.3, 0.05),
    ]
    np.testing.assert_allclose(
        log_probability(after, there), log_probability(before, here), rtol=1e-6, atol=1e-6
    )


@given(st.permutations(range(4)), st.permutations(range(2)), st.permutations(range(60)))
def test_order_does_not_matter(marks: list[int], seen: list[int], particles: list[int]) -> None:
    expected = MatchedLandmarks(MARKS, SEEN).log_probability(states())
    again = MatchedLandmarks(MARKS[marks], [SEEN[k] for k in seen]).log_probability(states()[particles])
    np.testing.assert_allclose(again, expected[particles], rtol=1e-12)


def test_a_clear_view_is_the_product_of_range_and_bearing() -> None:
    matched = MatchedLandmarks(MARKS, SEEN[:1], floor=0.01)
    alone = [LandmarkConstraint("a", MARKS[0], 21.5, 0.64), BearingConstraint("a", MARKS[0], 0.3, 0.05)]
    near = states() * 0.2
    expected = np.log(0.99 * np.exp(log_probability(alone, near)) + 0.01)
    np.testing.assert_allclose(matched.log_probability(near), expected)
    tempered = MatchedLandmarks(MARKS, SEEN[:1], floor=0.01, exponent=0.3)
    np.testing.assert_allclose(tempered.log_probability(near), 0.3 * expected)


def test_two_detections_never_take_one_landmark() -> None:
    here = np.zeros((1, 6))
    twice = (Sighting(20.9, 1.0, 0.29, 0.05), Sighting(21.5, 1.0, 0.33, 0.05))
    one = MatchedLandmarks(MARKS[:1], twice, floor=1e-3).log_probability(here)[0]
    first = MatchedLandmarks(MARKS[:1], twice[:1], floor=1e-3).log_probability(here)[0]
    assert one == pytest.approx(first + np.log(1e-3))
    neighbour = np.vstack([MARKS[:1], [20.4, 6.9]])
    two = MatchedLandmarks(neighbour, twice, floor=1e-3).log_probability(here)[0]
    assert two > first + np.log(0.2)


def test_a_false_detection_costs_the_floor_and_an_empty_map_nothing() -> None:
    nowhere = MatchedLandmarks(MARKS, (Sighting(90.0, 0.5, 1.5, 0.02),), floor=0.02)
    np.testing.assert_allclose(nowhere.log_probability(states()), np.log(0.02))
    np.testing.assert_array_equal(MatchedLandmarks(MARKS[:0], SEEN).log_probability(states()), np.zeros(60))
    np.testing.assert_array_equal(MatchedLandmarks(MARKS[:0], SEEN).violation(states()), np.zeros(60))
    exact = MatchedLandmarks(MARKS[:1], (Sighting(float(np.hypot(20, 6)), 1.0, 0.29, 0.05),))
    np.testing.assert_allclose(exact.violation(np.zeros((1, 6))), 0.0, atol=1e-9)
