"""Soft constraints: survival functions against scipy's, and the laws they keep."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from scpf.models.constraints import (
    LandmarkConstraint,
    RoadConstraint,
    SpeedConstraint,
    exponential_log_survival,
    half_normal_log_survival,
    log_probability,
    total_violation,
)
from scpf.models.road_map import RoadSegment

violations = st.lists(st.floats(-50, 1e4), min_size=2, max_size=20).map(np.array)
scales = st.floats(1e-2, 1e2)


@given(violations, scales)
def test_exponential_is_the_survival_function(violation: np.ndarray, mean: float) -> None:
    expected = stats.expon(scale=mean).logsf(np.maximum(violation, 0.0))
    np.testing.assert_allclose(exponential_log_survival(violation, mean), expected, rtol=1e-12)


@given(st.lists(st.floats(-5, 25), min_size=1, max_size=20).map(np.array), scales)
def test_half_normal_is_the_survival_function(in_sigmas: np.ndarray, sigma: float) -> None:
    expected = stats.halfnorm(scale=sigma).logsf(np.maximum(in_sigmas * sigma, 0.0))
    np.testing.assert_allclose(
        half_normal_log_survival(in_sigmas * sigma, sigma), expected, rtol=1e-9, atol=1e-12
    )


@given(violations, scales)
def test_the_tail_neither_underflows_nor_rises(violation: np.ndarray, scale: float) -> None:
    ordered = np.sort(violation)
    for survival in (exponential_log_survival, half_normal_log_survival):
        values = survival(ordered, scale)
        assert np.isfinite(values).all()
        assert (np.diff(values) <= 0).all()
        assert (values <= 0).all()
        assert (values[ordered <= 0] == 0).all()


def test_road_uses_the_cubic_in_either_orientation() -> None:
    cubic = np.array([1.0, 0.5, 0.01, -0.001])
    along = RoadSegment(np.array([10.0, 20.0]), cubic, swapped=False)
    across = RoadSegment(np.array([20.0, 10.0]), cubic, swapped=True)
    x = np.linspace(-20, 20, 9)
    y = np.polynomial.polynomial.polyval(x, cubic)
    on_line = np.column_stack([x + 10, y + 20, 0 * x, 0 * x])
    road = RoadConstraint(along, half_width_m=4.0)
    np.testing.assert_allclose(road.violation(on_line), -4.0, atol=1e-9)
    np.testing.assert_allclose(road.violation(on_line + np.array([0, 6, 0, 0])), 2.0, atol=1e-9)
    np.testing.assert_allclose(
        road.log_probability(on_line + np.array([0, -6, 0, 0])), -2.0 / 0.25, atol=1e-8
    )
    mirrored = on_line[:, [1, 0, 2, 3]]
    np.testing.assert_allclose(RoadConstraint(across).violation(mirrored), -4.0, atol=1e-9)


def test_speed_and_landmark_violations() -> None:
    states = np.array([[3.0, 4.0, 6.0, 8.0], [0.0, 0.0, 15.0, 0.0]])
    np.testing.assert_allclose(SpeedConstraint(12.0).violation(states), [-2.0, 3.0])
    landmark = LandmarkConstraint("7", np.array([0.0, 0.0]), distance_m=5.0, variance_m2=0.25)
    np.testing.assert_allclose(landmark.violation(states), [0.0, 5.0])
    assert landmark.log_probability(states)[0] == 0.0
    assert landmark.log_probability(states)[1] == pytest.approx(stats.halfnorm(scale=0.5).logsf(5.0))


def test_infinite_slack_changes_nothing_and_order_does_not_matter() -> None:
    rng = np.random.default_rng(1)
    states = rng.normal(0, 20, (50, 4))
    ring = LandmarkConstraint("a", np.array([5.0, 5.0]), 12.0, 0.5)
    speed = SpeedConstraint(12.0, 1.0)
    loose = SpeedConstraint(12.0, float("inf"))
    joint = log_probability([ring, speed], states)
    np.testing.assert_allclose(joint, log_probability([speed, ring], states))
    np.testing.assert_allclose(joint, log_probability([ring, speed, loose], states))
    np.testing.assert_array_equal(joint[::-1], log_probability([ring, speed], states[::-1]))


def test_the_surface_sums_positive_parts_only() -> None:
    states = np.array([[0.0, 0.0, 1.0, 0.0]])
    ring = LandmarkConstraint("a", np.array([3.0, 0.0]), 1.0, 0.5)
    assert total_violation([ring, SpeedConstraint(12.0)], states)[0] == pytest.approx(2.0)
