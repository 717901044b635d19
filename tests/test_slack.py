"""Slacks against scipy's distributions, tempering, and what holds for any slack."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from scpf.models.constraints import LandmarkConstraint, half_normal_log_survival
from scpf.models.slack import Slackened, Tempered, half_student_t_log_survival, rayleigh_log_survival

SLACKS = [rayleigh_log_survival, half_student_t_log_survival, half_normal_log_survival]


def test_log_survivals_are_those_of_the_distributions() -> None:
    violation = np.concatenate([np.linspace(-2, 10, 40), [50.0, 1e3]])
    positive = np.maximum(violation, 0.0)
    np.testing.assert_allclose(
        rayleigh_log_survival(violation, 0.7), stats.rayleigh.logsf(positive, scale=0.7)
    )
    student = np.log(2.0) + stats.t.logsf(positive, 4.0, scale=0.7)
    np.testing.assert_allclose(half_student_t_log_survival(violation, 0.7), student, atol=1e-9)


def test_the_student_tail_goes_on_where_numbers_end() -> None:
    far = half_student_t_log_survival(np.array([1e40, 1e60, 1e80, 1e120]), 1.0)
    np.testing.assert_allclose(np.diff(far), -4.0 * np.log([1e20, 1e20, 1e40]), rtol=1e-9)


@pytest.mark.parametrize("slack", SLACKS)
@given(st.lists(st.floats(-50, 1e4), min_size=2, max_size=20), st.floats(0.05, 20.0))
def test_it_falls_with_the_violation_and_is_0_within(slack, values, scale) -> None:  # type: ignore[no-untyped-def]
    violation = np.sort(np.array(values))
    log_survival = slack(violation, scale)
    assert (np.diff(log_survival) <= 1e-12).all()
    np.testing.assert_allclose(log_survival[violation <= 0.0], 0.0, atol=1e-12)
    np.testing.assert_allclose(slack(violation, float("inf")), 0.0, atol=1e-12)


def test_wrapped_constraints_keep_name_and_violation() -> None:
    states = np.random.default_rng(0).normal(0, 20, (30, 4))
    ring = LandmarkConstraint("7", np.array([5.0, 5.0]), 12.0, 0.5)
    tempered, heavy = Tempered(ring, 0.3), Slackened(ring, 0.5)
    np.testing.assert_allclose(tempered.log_probability(states), 0.3 * ring.log_probability(states))
    np.testing.assert_array_equal(Tempered(ring, 0.0).log_probability(states), 0.0 * states[:, 0])
    np.testing.assert_allclose(
        heavy.log_probability(states), half_student_t_log_survival(ring.violation(states), 0.5)
    )
    for wrapped in (tempered, heavy):
        assert wrapped.name == "landmark 7"
        np.testing.assert_array_equal(wrapped.violation(states), ring.violation(states))
