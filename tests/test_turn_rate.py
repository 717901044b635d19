"""Constant turn rate: noise against numerical integration, arcs against circles, steps that compose."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from scpf.models.motion import ConstantTurnRate, root_2x2, turn_rate_state

QUIET = ConstantTurnRate(0.0, 0.0, turn_time_s=1e9, q_heading_rad2ps=0.0)


@given(st.floats(0.01, 2.0), st.floats(0.5, 20.0), st.floats(0.0, 1e-3))
def test_turn_noise_is_the_integral_of_the_white_noise(dt_s: float, tau: float, walk: float) -> None:
    model = ConstantTurnRate(0.5, 0.2, tau, walk)
    t = np.linspace(0, dt_s, 4001)
    left = dt_s - t
    response = np.stack(
        [tau * -np.expm1(-left / tau), np.exp(-left / tau)]
    )  # of (heading, rate) to an impulse
    integral = 0.2 * np.trapezoid(response[:, None] * response[None], t, axis=-1)
    integral[0, 0] += walk * dt_s
    np.testing.assert_allclose(model.turn_covariance(dt_s), integral, rtol=1e-4, atol=1e-10)


def test_draws_agree_with_small_steps_of_the_differential_equation() -> None:
    model, dt_s, n, parts = ConstantTurnRate(0.5, 0.3, 2.0, 1e-3), 0.5, 40_000, 100
    start = np.tile(turn_rate_state(np.array([3.0, 4.0]), np.array([0.0, 8.0]), np.pi / 2), (n, 1))
    start[:, 5] = 0.2
    moved = model.propagate(start, dt_s, np.random.default_rng(0))
    rng, h = np.random.default_rng(1), dt_s / parts
    x, y, v, psi, rate = start[:, 0], start[:, 1], np.full(n, 8.0), start[:, 4], start[:, 5]
    for _ in range(parts):
        kick = rng.standard_normal((3, n)) * np.sqrt(h)
        x, y = x + h * v * np.cos(psi), y + h * v * np.sin(psi)
        v = v + np.sqrt(0.5) * kick[0]
        psi = psi + h * rate + np.sqrt(1e-3) * kick[1]
        rate = rate - h * rate / 2.0 + np.sqrt(0.3) * kick[2]
    slow = np.column_stack([x, y, v, psi, rate])
    fast = np.column_stack([moved[:, :2], np.hypot(moved[:, 2], moved[:, 3]), moved[:, 4:]])
    np.testing.assert_allclose(fast.mean(0), slow.mean(0), atol=0.03)
    scale = np.sqrt(np.diag(np.cov(slow.T)))
    along = [1, 2, 3, 4]  # x runs across the path: the chord model leaves out its third-order noise
    np.testing.assert_allclose(
        (np.cov(fast.T) / np.outer(scale, scale))[np.ix_(along, along)],
        (np.cov(slow.T) / np.outer(scale, scale))[np.ix_(along, along)],
        atol=0.04,
    )


@given(st.floats(-2.0, 2.0), st.floats(-3.0, 12.0), st.floats(-9.0, 9.0), st.integers(1, 20))
def test_without_noise_it_drives_circles(rate: float, speed: float, heading: float, steps: int) -> None:
    ahead = np.array([np.cos(heading), np.sin(heading)])
    state = turn_rate_state(np.array([5.0, -7.0]), speed * ahead, heading)[None]
    state[0, 5] = rate
    once = QUIET.propagate(state, 2.0, np.random.default_rng(0))
    often = state
    for _ in range(steps):
        often = QUIET.propagate(often, 2.0 / steps, np.random.default_rng(0))
    np.testing.assert_allclose(often, once, atol=1e-6)
    if abs(rate) > 0.1:
        centre = state[0, :2] + speed / rate * np.array([-ahead[1], ahead[0]])
        np.testing.assert_allclose(np.hypot(*(once[0, :2] - centre)), abs(speed / rate), atol=1e-5)


def test_a_standing_vehicle_keeps_its_heading() -> None:
    state = turn_rate_state(np.zeros(2), np.zeros(2), 1.2)[None]
    moved = QUIET.propagate(state, 5.0, np.random.default_rng(0))
    np.testing.assert_array_equal(moved, state)


def test_covariances_compose_and_roots_multiply_back() -> None:
    model = ConstantTurnRate(0.5, 0.2, 3.0, 1e-3)
    decay, lever = model.turn_response(0.3)
    step = np.array([[1.0, lever], [0.0, decay]])
    once = model.turn_covariance(0.3)
    np.testing.assert_allclose(step @ once @ step.T + once, model.turn_covariance(0.6), rtol=1e-9)
    root = root_2x2(once)
    np.testing.assert_allclose(root @ root.T, once, rtol=1e-12)
    np.testing.assert_array_equal(root_2x2(np.zeros((2, 2))), np.zeros((2, 2)))
