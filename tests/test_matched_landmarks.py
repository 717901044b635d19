"""Bearing, heading and matching by every particle: laws, and one case worked by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from scpf.models.bearing_constraint import BearingConstraint, HeadingConstraint
from scpf.models.constraints import LandmarkConstraint, log_probability
from scpf.models.geodesy import wrap_angle
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
        log_probability(after, there), log_probability(before, here), rtol=1e-5, atol=1e-4
    )


@given(st.permutations(range(4)), st.permutations(range(2)), st.permutations(range(60)))
def test_order_does_not_matter(marks: list[int], seen: list[int], particles: list[int]) -> None:
    expected = MatchedLandmarks(MARKS, SEEN).log_probability(states())
    again = MatchedLandmarks(MARKS[marks], [SEEN[k] for k in seen]).log_probability(states()[particles])
    np.testing.assert_allclose(again, expected[particles], rtol=1e-6)


def by_hand(matched: MatchedLandmarks, state: np.ndarray) -> tuple[float, float]:
    """Violation and log-probability of one state, spelt out: scipy's survivals, one pair after the other."""
    ranked = []
    for seen in matched.sightings:
        fits = []
        for k, mark in enumerate(matched.positions_m):
            own = 0.0 if matched.variances_m2 is None else float(matched.variances_m2[k])
            east, north = mark - state[:2]
            far_off = abs(float(np.hypot(east, north)) - seen.distance_m)
            turned = abs(wrap_angle(np.arctan2(north, east) - state[4] - seen.bearing_rad))
            in_range = np.sqrt(seen.distance_deviation_m**2 + own)
            in_bearing = np.sqrt(seen.bearing_deviation_rad**2 + own / seen.distance_m**2)
            fit = stats.halfnorm(scale=in_range).logsf(far_off) + stats.halfnorm(scale=in_bearing).logsf(
                turned
            )
            fits.append((float(fit), k, far_off))
        ranked.append(sorted(fits, reverse=True))
    violation, total = 0.0, 0.0
    for m, fits in enumerate(ranked):
        others = [other[0] for k, other in enumerate(ranked) if k != m]
        choice = fits[0]
        if any(other[1] == choice[1] and other[0] > choice[0] for other in others):
            free = len(fits) > 1 and all(other[1] != fits[1][1] for other in others)
            choice = fits[1] if free else (-np.inf, -1, 0.0)
        violation += choice[2]
        total += np.log((1 - matched.floor) * np.exp(choice[0]) + matched.floor)
    return violation, matched.exponent * total


@pytest.mark.parametrize("variances", [None, np.array([0.1, 2.0, 0.0, 1.0])])
@pytest.mark.parametrize("count", [1, 2, 4])
def test_it_is_what_every_particle_would_find_by_hand(variances: np.ndarray | None, count: int) -> None:
    seen = (*SEEN, Sighting(24.0, 2.0, -0.3, 0.1), Sighting(20.0, 2.0, 0.25, 0.1))
    own = None if variances is None else variances[:count]
    here = states(80) + np.array([1e3, -2e3, 0, 0, 2 * np.pi, 0])  # far from the origin, turned once
    matched = MatchedLandmarks(MARKS[:count] + np.array([1e3, -2e3]), seen, 0.01, 0.7, own)
    expected = np.array([by_hand(matched, state) for state in here])
    violation, log_probability = matched.both(here)
    np.testing.assert_allclose(violation, expected[:, 0], rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(log_probability, expected[:, 1], rtol=1e-5, atol=1e-4)
    np.testing.assert_array_equal(matched.violation(here[:0]), np.zeros(0))


def test_a_clear_view_is_the_product_of_range_and_bearing() -> None:
    matched = MatchedLandmarks(MARKS, SEEN[:1], floor=0.01)
    alone = [LandmarkConstraint("a", MARKS[0], 21.5, 0.64), BearingConstraint("a", MARKS[0], 0.3, 0.05)]
    near = states() * 0.2
    expected = np.log(0.99 * np.exp(log_probability(alone, near)) + 0.01)
    np.testing.assert_allclose(matched.log_probability(near), expected, rtol=1e-5, atol=1e-5)
    tempered = MatchedLandmarks(MARKS, SEEN[:1], floor=0.01, exponent=0.3)
    np.testing.assert_allclose(tempered.log_probability(near), 0.3 * expected, rtol=1e-5, atol=1e-5)


def test_two_detections_never_take_one_landmark() -> None:
    here = np.zeros((1, 6))
    twice = (Sighting(20.9, 1.0, 0.29, 0.05), Sighting(21.5, 1.0, 0.33, 0.05))
    one = MatchedLandmarks(MARKS[:1], twice, floor=1e-3).log_probability(here)[0]
    first = MatchedLandmarks(MARKS[:1], twice[:1], floor=1e-3).log_probability(here)[0]
    assert one == pytest.approx(first + np.log(1e-3), rel=1e-6)
    neighbour = np.vstack([MARKS[:1], [20.4, 6.9]])
    two = MatchedLandmarks(neighbour, twice, floor=1e-3).log_probability(here)[0]
    assert two > first + np.log(0.2)


def test_a_false_detection_costs_the_floor_and_an_empty_map_nothing() -> None:
    nowhere = MatchedLandmarks(MARKS, (Sighting(90.0, 0.5, 1.5, 0.02),), floor=0.02)
    np.testing.assert_allclose(nowhere.log_probability(states()), np.log(0.02))
    np.testing.assert_array_equal(MatchedLandmarks(MARKS[:0], SEEN).log_probability(states()), np.zeros(60))
    np.testing.assert_array_equal(MatchedLandmarks(MARKS[:0], SEEN).violation(states()), np.zeros(60))
    exact = MatchedLandmarks(MARKS[:1], (Sighting(float(np.hypot(20, 6)), 1.0, 0.29, 0.05),))
    np.testing.assert_allclose(exact.violation(np.zeros((1, 6))), 0.0, atol=1e-5)
