"""The particle filter against a Kalman filter where all is linear, and its laws."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scpf.models.constraints import LandmarkConstraint, SpeedConstraint
from scpf.models.motion import ConstantVelocity
from scpf.models.particle_filter import FilterSettings, ParticleFilter, PositionFix, systematic_resample


def build(seed: int = 0, **settings: object) -> ParticleFilter:
    return ParticleFilter(ConstantVelocity(4.0), FilterSettings(**settings), np.random.default_rng(seed))  # type: ignore[arg-type]


def test_agrees_with_the_kalman_filter() -> None:
    dt_s, variance = 0.1, 4.0
    rng = np.random.default_rng(5)
    filter_ = build(particles=20_000)
    mean, covariance = np.zeros(4), np.diag([10.0, 10.0, 2.5, 2.5])
    filter_.initialise(mean)
    noise = ConstantVelocity(4.0).covariance(dt_s)
    transition, process = np.eye(4), np.zeros((4, 4))
    for axis in (0, 1):
        transition[axis, axis + 2] = dt_s
        process[np.ix_([axis, axis + 2], [axis, axis + 2])] = noise
    observe = np.eye(2, 4)
    for k in range(25):
        fix = np.array([0.3 * k, -0.2 * k]) + rng.normal(0, 2, 2)
        mean, covariance = transition @ mean, transition @ covariance @ transition.T + process
        gain = covariance @ observe.T @ np.linalg.inv(observe @ covariance @ observe.T + variance * np.eye(2))
        mean, covariance = mean + gain @ (fix - observe @ mean), (np.eye(4) - gain @ observe) @ covariance
        filter_.predict(dt_s)
        belief = filter_.update([], PositionFix(fix, variance))
    np.testing.assert_allclose(belief.mean, mean, atol=0.12)
    np.testing.assert_allclose(belief.covariance, covariance, atol=0.12)


@given(st.lists(st.floats(1e-6, 1.0), min_size=1, max_size=40), st.floats(0, 1, exclude_max=True))
def test_systematic_resampling_draws_each_particle_its_share(raw: list[float], offset: float) -> None:
    weights = np.array(raw) / sum(raw)
    counts = np.bincount(systematic_resample(weights, offset), minlength=len(weights))
    assert counts.sum() == len(weights)
    assert (np.abs(counts - len(weights) * weights) < 1 + 1e-9).all()


def test_weights_are_normalised_and_summaries_weighted() -> None:
    filter_ = build(particles=300)
    filter_.initialise(np.array([0.0, 0.0, 5.0, 0.0]))
    filter_.predict(0.08)
    belief = filter_.update([LandmarkConstraint("a", np.array([20.0, 0.0]), 18.0, 0.25)])
    assert belief.weights.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(belief.mean, belief.weights @ belief.states)
    assert 1.0 <= belief.ess <= 300.0
    assert belief.state == "tracking"
    assert abs(np.hypot(*(belief.mean[:2] - [20.0, 0.0])) - 18.0) < 1.0


def test_a_landmark_narrows_the_belief_along_its_direction() -> None:
    filter_ = build(particles=5000)
    filter_.initialise(np.zeros(4))
    belief = filter_.update([LandmarkConstraint("a", np.array([200.0, 0.0]), 200.0, 0.25)])
    assert belief.covariance[0, 0] < 0.6
    assert belief.covariance[1, 1] > 7.0


def test_state_says_when_nothing_is_near() -> None:
    filter_ = build()
    filter_.initialise(np.zeros(4))
    assert filter_.update([SpeedConstraint()]).state == "unconstrained"
    far = filter_.update([], PositionFix(np.array([500.0, 0.0]), 1.0))
    assert far.state == "lost"
    assert np.isfinite(far.mean).all()
    assert np.isfinite(far.log_weights).any()


def test_the_same_seed_gives_the_same_belief() -> None:
    beliefs = []
    for seed in (4, 4, 5):
        filter_ = build(seed)
        filter_.initialise(np.zeros(4))
        filter_.predict(0.1)
        beliefs.append(filter_.update([], PositionFix(np.array([1.0, 1.0]), 9.0)))
    np.testing.assert_array_equal(beliefs[0].states, beliefs[1].states)
    assert not np.array_equal(beliefs[0].states, beliefs[2].states)


def test_resampling_waits_for_a_low_ess() -> None:
    filter_ = build(resample_below=0.1)
    first = filter_.initialise(np.zeros(4))
    filter_.update([], PositionFix(np.zeros(2), 100.0))
    second = filter_.update([], PositionFix(np.zeros(2), 100.0))
    np.testing.assert_array_equal(first.states, second.states)  # not one was redrawn
    assert second.ess < 500


def test_a_lost_filter_draws_its_particles_anew_around_the_fix() -> None:
    truth = np.array([500.0, -80.0])
    states: dict[int, list[str]] = {}
    for after in (0, 3):
        filter_ = build(recover_after=after)
        filter_.initialise(np.zeros(4))
        states[after] = []
        for _ in range(12):
            filter_.predict(0.1)
            belief = filter_.update([], PositionFix(truth, 1.0))
            states[after].append(belief.state)
        assert (np.hypot(*(belief.mean[:2] - truth)) < 2.0) == (after > 0)
    assert set(states[0]) == {"lost"}
    assert states[3][:3] == ["lost"] * 3
    assert states[3][4:] == ["unconstrained"] * 8


def test_without_a_fix_the_lost_spread_until_something_fits() -> None:
    filter_ = build(recover_after=2, particles=3000)
    filter_.initialise(np.zeros(4))
    ring = LandmarkConstraint("a", np.array([0.0, 0.0]), 60.0, 0.25)
    seen = []
    for _ in range(30):
        filter_.predict(0.1)
        seen.append(filter_.update([ring]))
    assert seen[0].state == "lost"
    assert seen[-1].state == "tracking"
    assert abs(np.hypot(*seen[-1].states[np.argmax(seen[-1].log_weights)][:2]) - 60.0) < 2.0
