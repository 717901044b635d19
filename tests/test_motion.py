"""The motion model's noise against numerical integration of the white acceleration that it stands for."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from scpf.models.motion import ConstantVelocity


@given(st.floats(1e-3, 2.0), st.floats(0.1, 20.0))
def test_covariance_is_the_integral_of_the_white_noise(dt_s: float, q: float) -> None:
    t = np.linspace(0, dt_s, 2001)
    response = np.stack([dt_s - t, np.ones_like(t)])  # of (position, velocity) to an impulse at t
    integral = q * np.trapezoid(response[:, None] * response[None], t, axis=-1)
    np.testing.assert_allclose(ConstantVelocity(q).covariance(dt_s), integral, rtol=1e-4)


def test_draws_have_that_covariance_and_the_mean_moves_straight_on() -> None:
    model, dt_s = ConstantVelocity(11.0), 0.4
    start = np.tile([10.0, -5.0, 3.0, 1.0], (200_000, 1))
    moved = model.propagate(start, dt_s, np.random.default_rng(0))
    np.testing.assert_allclose(moved.mean(axis=0), [11.2, -4.6, 3.0, 1.0], atol=0.02)
    for axis in (0, 1):
        sample = np.cov(moved[:, [axis, axis + 2]].T)
        np.testing.assert_allclose(sample, model.covariance(dt_s), rtol=0.03)
    assert abs(np.corrcoef(moved[:, 0], moved[:, 1])[0, 1]) < 0.01


def test_two_steps_compose_into_one() -> None:
    model = ConstantVelocity(2.0)
    step = np.array([[1.0, 0.3], [0.0, 1.0]])
    twice = step @ model.covariance(0.3) @ step.T + model.covariance(0.3)
    np.testing.assert_allclose(twice, model.covariance(0.6), rtol=1e-12)


def test_no_time_no_motion_and_the_input_stays() -> None:
    states = np.random.default_rng(3).normal(size=(7, 4))
    before = states.copy()
    np.testing.assert_array_equal(
        ConstantVelocity(4.0).propagate(states, 0.0, np.random.default_rng(0)), before
    )
    ConstantVelocity(4.0).propagate(states, 0.1, np.random.default_rng(0))
    np.testing.assert_array_equal(states, before)
