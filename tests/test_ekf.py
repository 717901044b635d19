"""The extended Kalman filter: linear where all is linear, its slopes the derivatives, its runs apart."""

from __future__ import annotations

import numpy as np
from scipy.stats import multivariate_normal

from scpf.models.ekf import ExtendedKalmanFilter
from scpf.models.motion import ConstantVelocity

PRIOR = np.diag([10.0, 10.0, 2.5, 2.5])


def build(means: np.ndarray, q: float = 4.0) -> ExtendedKalmanFilter:
    return ExtendedKalmanFilter(ConstantVelocity(q), means, PRIOR)


def test_fixes_alone_are_the_linear_kalman_filter() -> None:
    dt_s, rng = 0.1, np.random.default_rng(5)
    mean, covariance = np.zeros(4), PRIOR
    transition, process, observe = np.eye(4), np.zeros((4, 4)), np.eye(2, 4)
    for axis in (0, 1):
        transition[axis, axis + 2] = dt_s
        process[np.ix_([axis, axis + 2], [axis, axis + 2])] = ConstantVelocity(4.0).covariance(dt_s)
    filter_ = build(np.zeros((1, 4)))
    for _ in range(30):
        fix = rng.normal(0, 5, 2)
        mean, covariance = transition @ mean, transition @ covariance @ transition.T + process
        spread = observe @ covariance @ observe.T + 3.0 * np.eye(2)
        density = multivariate_normal(observe @ mean, spread).logpdf(fix)
        gain = covariance @ observe.T @ np.linalg.inv(observe @ covariance @ observe.T + 3.0 * np.eye(2))
        mean, covariance = mean + gain @ (fix - observe @ mean), (np.eye(4) - gain @ observe) @ covariance
        filter_.predict(dt_s)
        np.testing.assert_allclose(filter_.update_fix(fix[None], 3.0), [density], rtol=1e-9)
    np.testing.assert_allclose(filter_.means[0], mean, rtol=1e-9)
    np.testing.assert_allclose(filter_.covariances[0], covariance, rtol=1e-9, atol=1e-12)


def test_a_far_landmark_s_range_is_a_linear_measurement() -> None:
    filter_ = build(np.array([[1.0, 2.0, 0.0, 0.0]]))
    filter_.update_range(np.array([[1e7, 2.0]]), 1e7 - 4.0, 2.0)
    # the landmark lies to the east: the range says x = 4 with variance 2
    np.testing.assert_allclose(filter_.means[0], [1.0 + 10.0 / 12.0 * 3.0, 2.0, 0.0, 0.0], atol=1e-5)
    np.testing.assert_allclose(np.diag(filter_.covariances[0]), [20.0 / 12.0, 10.0, 2.5, 2.5], atol=1e-5)


def test_repeated_looks_find_the_position() -> None:
    truth, heading = np.array([2.0, -1.0]), np.array([0.4])
    marks = np.array([[20.0, 6.0], [25.0, -6.0]])
    filter_ = build(np.zeros((1, 4)))
    for _ in range(40):
        filter_.predict(0.1)
        for mark in marks:
            off = mark - truth
            filter_.update_range(mark[None], float(np.hypot(*off)), 0.25)
            seen = float(np.arctan2(off[1], off[0]) - heading[0]) + 2 * np.pi  # any turn of the circle
            filter_.update_bearing(mark[None], seen, heading, 0.05**2)
    np.testing.assert_allclose(filter_.means[0, :2], truth, atol=0.02)
    np.testing.assert_allclose(filter_.covariances[0], filter_.covariances[0].T, atol=1e-12)
    assert np.linalg.eigvalsh(filter_.covariances[0]).min() > 0.0


def test_runs_are_independent_and_masked_ones_untouched() -> None:
    rng = np.random.default_rng(1)
    means = rng.normal(0, 3, (3, 4))
    together, alone = build(means), build(means[1:2])
    used = np.array([False, True, False])
    marks = np.array([[20.0, 6.0]] * 3)
    together.update_range(marks, 19.0, 0.5, used)
    together.update_bearing(marks, 0.3, np.zeros(3), 0.01, used)
    alone.update_range(marks[:1], 19.0, 0.5)
    alone.update_bearing(marks[:1], 0.3, np.zeros(1), 0.01)
    np.testing.assert_allclose(together.means[1], alone.means[0])
    np.testing.assert_allclose(together.covariances[1], alone.covariances[0])
    np.testing.assert_array_equal(together.means[[0, 2]], means[[0, 2]])
    np.testing.assert_array_equal(together.covariances[0], PRIOR)
