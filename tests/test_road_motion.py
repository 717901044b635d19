"""Road-aligned motion: coordinates that round-trip, noise against numerical integration, laps, both senses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scpf.models.centre_line import CentreLine
from scpf.models.errors import InputError
from scpf.models.motion import MotionModel, decaying_noise
from scpf.models.particle_filter import FilterSettings, ParticleFilter, PositionFix
from scpf.models.road_motion import RoadMotion

ANGLE = np.linspace(0, 2 * np.pi, 181)
RADIUS_M = 60.0
CIRCLE = CentreLine(RADIUS_M * np.column_stack([np.cos(ANGLE), np.sin(ANGLE)]))
BENT = CentreLine(np.array([[0.0, 0.0], [30.0, 0.0], [55.0, 10.0], [70.0, 30.0], [72.0, 70.0]]))
STRAIGHT = CentreLine(np.array([[0.0, 0.0], [100.0, 0.0]]))


def quiet(line: CentreLine) -> RoadMotion:
    return RoadMotion(line, 0.0, 0.0)


@given(st.floats(-40.0, 160.0), st.floats(-5.0, 5.0), st.floats(-8.0, 8.0))
def test_positions_come_back_from_progress_and_offset(s: float, d: float, wrong: float) -> None:
    for line in (BENT, CIRCLE):
        place = line.at(np.array([s]))
        position = place.points_m + d * place.left
        progress, offset, _ = line.project(position, np.array([s + wrong]))
        np.testing.assert_allclose([progress[0], offset[0]], [s, d], atol=1e-7)


def test_a_circle_has_its_radius_and_progress_counts_laps() -> None:
    assert CIRCLE.length_m == pytest.approx(2 * np.pi * RADIUS_M, rel=1e-4)
    place = CIRCLE.at(np.array([3.0, 3.0 + 2 * CIRCLE.length_m]))
    np.testing.assert_allclose(place.points_m[0], place.points_m[1], atol=1e-9)
    np.testing.assert_allclose(np.diff(place.direction_rad), 4 * np.pi)
    np.testing.assert_allclose(place.curvature_pm, 1 / RADIUS_M, rtol=1e-3)


def test_a_road_that_passes_itself_keeps_its_stretch() -> None:
    eight = np.column_stack([60 * np.sin(ANGLE), 40 * np.sin(2 * ANGLE)])[:-20]
    line = CentreLine(eight)
    crossing = np.zeros((1, 2))
    first, _, early = line.project(crossing, np.array([5.0]))
    again, _, late = line.project(crossing, first + 0.5 * line.length_m)
    assert abs(again[0] - first[0]) > 50.0
    assert abs(early.direction_rad[0] - late.direction_rad[0]) > 0.5


@given(st.floats(0.01, 2.0), st.floats(0.1, 20.0))
def test_noise_across_is_the_integral_of_the_white_noise(dt_s: float, tau: float) -> None:
    model = RoadMotion(STRAIGHT, 1.0, 0.3, tau)
    left = np.linspace(dt_s, 0, 4001)
    response = np.stack([tau * -np.expm1(-left / tau), np.exp(-left / tau)])
    integral = 0.3 * np.trapezoid(response[:, None] * response[None], dt_s - left, axis=-1)
    np.testing.assert_allclose(model.across_covariance(dt_s), integral, rtol=1e-4, atol=1e-10)


def test_noise_across_composes() -> None:
    tau, once = 2.0, decaying_noise(2.0, 0.3)
    step = np.array([[1.0, tau * -np.expm1(-0.3 / tau)], [0.0, np.exp(-0.3 / tau)]])
    np.testing.assert_allclose(step @ once @ step.T + once, decaying_noise(tau, 0.6), rtol=1e-9)


@pytest.mark.parametrize("line", [STRAIGHT, CIRCLE])
def test_draws_agree_with_small_steps_of_the_differential_equation(line: CentreLine) -> None:
    model, dt_s, n, parts = RoadMotion(line, 0.8, 0.3, 1.5), 0.6, 20_000, 100
    at = line.at(np.array([20.0]))
    first = model.state(at.points_m[0] - 1.5 * at.left[0], 7.0 * at.ahead[0] + 0.4 * at.left[0])
    start = np.tile(first, (n, 1))
    moved = model.propagate(start, dt_s, np.random.default_rng(0))
    rng, h = np.random.default_rng(1), dt_s / parts
    s, d = start[:, 5].copy(), start[:, 6].copy()
    speed, sideways = np.full(n, 7.0), np.full(n, 0.4)
    for _ in range(parts):
        kick = rng.standard_normal((2, n)) * np.sqrt(h)
        s = s + h * speed / (1.0 - line.at(s).curvature_pm * d)
        d = d + h * sideways
        speed = speed + np.sqrt(0.8) * kick[0]
        sideways = sideways - h * sideways / 1.5 + np.sqrt(0.3) * kick[1]
    there = line.at(moved[:, 5])
    velocities = [(moved[:, 2:4] * there.ahead).sum(1), (moved[:, 2:4] * there.left).sum(1)]
    fast = np.column_stack([moved[:, 5], moved[:, 6], *velocities])
    slow = np.column_stack([s, d, speed, sideways])
    np.testing.assert_allclose(fast.mean(0), slow.mean(0), atol=0.03)
    scale = np.sqrt(np.diag(np.cov(slow.T)))
    for one in (fast, slow):
        one /= scale
    np.testing.assert_allclose(np.cov(fast.T), np.cov(slow.T), atol=0.04)


@given(st.floats(-3.0, 12.0), st.floats(-4.0, 4.0), st.integers(1, 15))
def test_without_noise_it_follows_the_road_in_any_number_of_steps(speed: float, d: float, steps: int) -> None:
    model, at = quiet(CIRCLE), CIRCLE.at(np.array([50.0]))
    state = model.state(at.points_m[0] + d * at.left[0], speed * at.ahead[0])[None]
    once = model.propagate(state, 3.0, np.random.default_rng(0))
    often = state
    for _ in range(steps):
        often = model.propagate(often, 3.0 / steps, np.random.default_rng(0))
    np.testing.assert_allclose(often, once, atol=1e-6)
    np.testing.assert_allclose(once[0, 6], d, atol=1e-9)
    np.testing.assert_allclose(once[0, 5] - 50.0, 3.0 * speed / (1 - d / RADIUS_M), rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(np.hypot(*once[0, 2:4]), abs(speed), atol=1e-9)


def test_the_heading_follows_the_road_in_the_sense_of_travel() -> None:
    at = CIRCLE.at(np.array([0.0]))
    for sense in (1.0, -1.0):
        model = quiet(CIRCLE)
        state = model.state(at.points_m[0], sense * 5.0 * at.ahead[0])[None]
        state[:, 4] += 6 * np.pi  # three turns ago
        for _ in range(40):
            before = state
            state = model.propagate(state, 0.5, np.random.default_rng(0))
            assert abs(state[0, 4] - before[0, 4] - sense * 2.5 / RADIUS_M) < 1e-3
        along = np.arctan2(state[0, 3], state[0, 2])
        assert np.cos(state[0, 4] - along) == pytest.approx(1.0)
    standing = quiet(CIRCLE).state(at.points_m[0], np.zeros(2))[None]
    np.testing.assert_allclose(quiet(CIRCLE).propagate(standing, 2.0, np.random.default_rng(0)), standing)


def test_the_filter_keeps_to_a_bend_that_fixes_only_hint_at() -> None:
    """Progress and offset are read from the position: particles that something else moved are taken as they are."""
    model: MotionModel = RoadMotion(CIRCLE)
    settings = FilterSettings(particles=300, initial_variance=(4.0, 4.0, 1.0, 1.0, 0.0, 0.0, 0.0))
    rng = np.random.default_rng(0)
    particles = ParticleFilter(model, settings, rng)
    place = CIRCLE.at(np.array([0.0]))
    particles.initialise(
        RoadMotion(CIRCLE).state(place.points_m[0] + 2.0 * place.ahead[0], 6 * place.ahead[0])
    )
    errors = []
    for k in range(1, 200):
        truth = CIRCLE.at(np.array([6.0 * k / 13])).points_m[0]
        particles.predict(1 / 13)
        belief = particles.update([], PositionFix(truth + rng.normal(0, 3, 2), 9.0))
        errors.append(np.hypot(*(belief.mean[:2] - truth)))
    assert np.mean(errors[50:]) < 1.0  # a raw fix errs by 3.8 m


def test_no_time_no_motion_and_the_input_stays() -> None:
    state = RoadMotion(BENT).state(np.array([20.0, 1.0]), np.array([3.0, 0.0]))[None]
    before = state.copy()
    np.testing.assert_array_equal(RoadMotion(BENT).propagate(state, 0.0, np.random.default_rng(0)), before)
    RoadMotion(BENT).propagate(state, 0.1, np.random.default_rng(0))
    np.testing.assert_array_equal(state, before)


@pytest.mark.parametrize("line", [np.zeros((0, 2)), np.zeros((1, 2)), np.ones((3, 2))])
def test_a_line_without_length_is_refused(line: np.ndarray) -> None:
    with pytest.raises(InputError):
        CentreLine(line)
