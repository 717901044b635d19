"""Another localization's pose: a Kalman update where all is linear, a position fix where its axes are alike."""

from __future__ import annotations

import numpy as np
import pytest

from scpf.models.motion import ConstantVelocity
from scpf.models.particle_filter import FilterSettings, ParticleFilter, PositionFix
from scpf.models.pose_fix import PoseFix

COVARIANCE = np.array([[4.0, 1.5], [1.5, 1.0]])


def test_the_filter_takes_its_covariance_as_a_kalman_filter_does() -> None:
    fix, prior = np.array([2.0, -1.0]), np.diag([10.0, 10.0, 2.5, 2.5])
    settings = FilterSettings(40_000, resample_below=0.0)
    filter_ = ParticleFilter(ConstantVelocity(4.0), settings, np.random.default_rng(0))
    filter_.initialise(np.zeros(4))
    belief = filter_.update([], PoseFix(fix, COVARIANCE))
    observe = np.eye(2, 4)
    gain = prior @ observe.T @ np.linalg.inv(observe @ prior @ observe.T + COVARIANCE)
    np.testing.assert_allclose(belief.mean, gain @ fix, atol=0.05)
    np.testing.assert_allclose(belief.covariance, (np.eye(4) - gain @ observe) @ prior, atol=0.15)


def test_alike_axes_are_a_position_fix_and_a_heading_is_taken_in_the_shorter_way_round() -> None:
    states = np.random.default_rng(1).normal(0, 3, (50, 6))
    round_ = PoseFix(np.array([1.0, 2.0]), 4.0 * np.eye(2))
    plain = PositionFix(np.array([1.0, 2.0]), round_.variance_m2)
    np.testing.assert_allclose(round_.log_likelihood(states), plain.log_likelihood(states))
    assert PoseFix(np.zeros(2), COVARIANCE).variance_m2 == pytest.approx(2.5)
    there = PoseFix(np.array([1.0, 2.0]), 4.0 * np.eye(2), np.pi - 0.1, 0.2**2)
    here = states.copy()
    here[:, 4] = -np.pi + 0.1
    lost = there.log_likelihood(here) - round_.log_likelihood(here)
    np.testing.assert_allclose(lost, -0.5 * (0.2 / 0.2) ** 2)


def test_a_lost_filter_is_drawn_anew_around_it() -> None:
    filter_ = ParticleFilter(ConstantVelocity(4.0), FilterSettings(recover_after=2), np.random.default_rng(0))
    filter_.initialise(np.zeros(4))
    for _ in range(6):
        belief = filter_.update([], PoseFix(np.array([300.0, -50.0]), COVARIANCE))
    assert belief.state == "unconstrained"
    np.testing.assert_allclose(belief.mean[:2], [300.0, -50.0], atol=1.0)
