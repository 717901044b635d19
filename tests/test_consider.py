"""The consider covariance against a sample of linear filters that make the errors it is told of."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scpf.models.consider import FLATTER, ConsiderCovariance, ConsiderSettings, positive_part
from scpf.models.consider_matching import look
from scpf.models.lasting_errors import LastingSettings
from scpf.models.matched_landmarks import Sighting
from scpf.models.motion import ConstantTurnRate

DT_S = 0.1
MOTION = ConstantTurnRate(0.8, 0.02, 2.0, 1e-3)
MARKS = np.array([[14.0, 7.0, 0.4], [26.0, -6.0, 0.0]])
EXACT = MARKS * np.array([1.0, 1.0, 0.0])
FIRST = np.array([1.0, 1.0, 0.5, 0.5, 0.2, 0.05])
SPEED_MPS, HEADING_RAD = 3.0, 0.3
RANGE_DEVIATION_M, BEARING_DEVIATION_RAD, NOISE_RAD = 0.8, 0.05, 0.02
FIX_M2, ROAD_RAD2 = 4.0, 0.3**2


def certain(share: float, offset_m2: float) -> ConsiderSettings:
    """Settings that nothing seen can change."""
    lasting = LastingSettings(
        first_share=share, first_detections=1e12, memory=1e12, first_offset_m2=offset_m2, first_landmarks=1e12
    )
    return ConsiderSettings(bearing_noise_rad=NOISE_RAD, lasting=lasting)


def truth(k: int) -> np.ndarray:
    ahead = np.array([np.cos(HEADING_RAD), np.sin(HEADING_RAD)])
    return np.concatenate([k * DT_S * SPEED_MPS * ahead, SPEED_MPS * ahead, [HEADING_RAD, 0.0]])


def sightings(k: int) -> list[Sighting]:
    seen = []
    for mark in MARKS[:, :2]:
        east, north = mark - truth(k)[:2]
        bearing = np.arctan2(north, east) - HEADING_RAD
        seen.append(
            Sighting(float(np.hypot(east, north)), RANGE_DEVIATION_M, float(bearing), BEARING_DEVIATION_RAD)
        )
    return seen


def drive(
    settings: ConsiderSettings, steps: int, exponent: float, marks: np.ndarray = MARKS
) -> ConsiderCovariance:
    consider = ConsiderCovariance(settings, MOTION, marks, 2, FIRST)
    for k in range(1, steps + 1):
        consider.predict(np.tile(truth(k - 1), (2, 1)), DT_S)
        consider.update(FIX_M2, ROAD_RAD2, sightings(k), np.full(2, exponent))
    return consider


def sampled(
    steps: int, exponent: float, share: float, offset_m2: float, n: int, marks: np.ndarray = MARKS
) -> tuple[np.ndarray, np.ndarray]:
    """Errors' covariance (2, 2) of ``n`` linear filters, and the one that they claim: written out densely."""
    rng = np.random.default_rng(0)
    c, s = np.cos(HEADING_RAD), np.sin(HEADING_RAD)
    decay, lever = MOTION.turn_response(DT_S)
    move = np.eye(5)
    move[:2, 2], move[:2, 3] = DT_S * SPEED_MPS * np.array([-s, c]), DT_S * np.array([c, s])
    move[2, 4], move[4, 4] = lever, decay
    spread = np.zeros((5, 4))
    spread[[0, 1, 3], :2] = np.array([[c, 0], [s, 0], [0, 1.0]])
    spread[2, 2] = spread[4, 3] = 1.0
    noise = np.zeros((4, 4))
    noise[:2, :2], noise[2:, 2:] = MOTION.along_covariance(DT_S), MOTION.turn_covariance(DT_S)
    noise = spread @ noise @ spread.T
    claimed = np.diag([1.0, 1.0, 0.04, 0.25, 0.0025])
    error = rng.multivariate_normal(np.zeros(5), claimed, n)
    offsets = np.sqrt(offset_m2) * rng.standard_normal((n, 2, 2))
    keep = np.exp(-DT_S / 1.0)
    lasting = np.zeros((n, 2))

    def take_in(slope: np.ndarray, weighed: float, wrong: np.ndarray) -> None:
        nonlocal error, claimed
        gain = claimed @ slope / (slope @ claimed @ slope + weighed)
        claimed = (np.eye(5) - np.outer(gain, slope)) @ claimed
        error = error - np.outer(error @ slope - wrong, gain)

    for k in range(1, steps + 1):
        claimed = move @ claimed @ move.T + noise
        error = error @ move.T + rng.multivariate_normal(np.zeros(5), noise, n)
        for part, variance in ((0, FIX_M2), (1, FIX_M2), (2, ROAD_RAD2)):
            take_in(np.eye(5)[part], variance, np.sqrt(variance) * rng.standard_normal(n))
        fresh = np.sqrt(share) * RANGE_DEVIATION_M * rng.standard_normal((n, 2))
        lasting = fresh if k == 1 else keep * lasting + np.sqrt(1 - keep**2) * fresh
        for m, (*mark, own) in enumerate(marks):
            off = mark - truth(k)[:2]
            far = np.hypot(*off)
            toward = np.array([*(-off / far), 0.0, 0.0, 0.0])
            white = np.sqrt(1 - share) * RANGE_DEVIATION_M * rng.standard_normal(n)
            wrong = white + lasting[:, m] + offsets[:, m] @ toward[:2]
            take_in(toward, FLATTER / exponent * (RANGE_DEVIATION_M**2 + own), wrong)
            beside = np.array([off[1] / far**2, -off[0] / far**2, -1.0, 0.0, 0.0])
            wrong = NOISE_RAD * rng.standard_normal(n) + offsets[:, m] @ beside[:2]
            take_in(beside, FLATTER / exponent * (BEARING_DEVIATION_RAD**2 + own / far**2), wrong)
    return np.cov(error.T)[:2, :2], claimed[:2, :2]


def full(row: np.ndarray) -> np.ndarray:
    return np.array([[row[0], row[1]], [row[1], row[2]]])


@pytest.mark.parametrize(
    ("share", "offset_m2", "exponent"), [(0.0, 0.0, 0.2), (1.0, 0.0, 0.5), (0.4, 1.2, 0.3), (0.0, 1.0, 1.0)]
)
def test_it_is_the_covariance_of_the_errors_that_such_filters_make(
    share: float, offset_m2: float, exponent: float
) -> None:
    consider = drive(certain(share, offset_m2), 40, exponent)
    errors, claimed = sampled(40, exponent, share, offset_m2, 20_000)
    rows = consider.covariance(np.zeros((2, 3)))
    np.testing.assert_array_equal(rows[0], rows[1])
    scale = np.sqrt(np.diag(errors))
    np.testing.assert_allclose(
        full(rows[0]) / np.outer(scale, scale), errors / np.outer(scale, scale), atol=0.04
    )
    # What the filters claim differs by more than that, or the test would show nothing.
    assert np.abs(claimed / errors - 1.0).max() > 0.2


def test_where_errors_are_what_the_filter_weighs_it_is_the_kalman_covariance() -> None:
    settings = ConsiderSettings(bearing_noise_rad=BEARING_DEVIATION_RAD, lasting=certain(0.0, 0.0).lasting)
    consider = drive(settings, 30, FLATTER, EXACT)
    np.testing.assert_allclose(
        full(consider.covariance(np.zeros((2, 3)))[0]),
        sampled(30, FLATTER, 0.0, 0.0, 2, EXACT)[1],
        rtol=1e-6,
    )


def test_whole_states_have_the_same_position_and_the_velocity_of_their_heading() -> None:
    consider = drive(certain(0.4, 1.0), 20, 0.3)
    spread = np.array([[9.0, 1.0, 4.0], [0.0, 0.0, 0.0]])
    whole, rows = consider.state_covariances(spread), consider.covariance(spread)
    assert whole.shape == (2, 6, 6)
    np.testing.assert_allclose(whole[:, [0, 0, 1], [0, 1, 1]], rows)
    np.testing.assert_allclose(whole, whole.transpose(0, 2, 1), atol=1e-12)
    assert np.linalg.eigvalsh(whole).min() > -1e-9
    # Velocity is v·(cos ψ, sin ψ): along the path the speed's error, across it the heading's.
    c, s = np.cos(HEADING_RAD), np.sin(HEADING_RAD)
    across = np.array([0.0, 0.0, -s, c, 0.0, 0.0])
    assert across @ whole[1] @ across == pytest.approx(SPEED_MPS**2 * whole[1, 4, 4], rel=1e-6)


def test_particles_in_doubt_add_what_goes_beyond_the_claim() -> None:
    consider = drive(certain(0.0, 0.0), 20, 0.3)
    calm = consider.covariance(np.zeros((2, 3)))
    spread = np.array([[100.0, 0.0, 0.01], [0.0, 0.0, 0.0]])
    doubtful = consider.covariance(spread)
    assert 95.0 < doubtful[0, 0] - calm[0, 0] < 100.0
    assert abs(doubtful[0, 2] - calm[0, 2]) < 0.1
    np.testing.assert_array_equal(doubtful[1], calm[1])


def test_landmarks_out_of_sight_are_forgotten_and_time_alone_widens() -> None:
    consider = drive(certain(0.5, 1.0), 20, 0.3)
    before = consider.covariance(np.zeros((2, 3)))
    for k in range(20, 150):
        consider.predict(np.tile(truth(k), (2, 1)), DT_S)
        consider.update(None, None, [], np.full(2, 0.3))
    assert (consider._tracked.idle_s == -1.0).all()
    assert (consider._tracked.cross == 0.0).all()
    after = consider.covariance(np.zeros((2, 3)))
    assert (after[:, [0, 2]] > 3.0 * before[:, [0, 2]]).all()


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-5, 5))
def test_positive_part_is_that_of_the_eigenvalues(xx: float, xy: float, yy: float) -> None:
    values, vectors = np.linalg.eigh(full(np.array([xx, xy, yy])))
    expected = (vectors * np.maximum(values, 0.0)) @ vectors.T
    np.testing.assert_allclose(full(positive_part(np.array([[xx, xy, yy]]))[0]), expected, atol=1e-9)


def test_detections_are_matched_one_to_one_around_the_estimate() -> None:
    consider = ConsiderCovariance(certain(0.0, 0.0), MOTION, MARKS, 1, FIRST)
    means = np.array([[1.0, -1.0, HEADING_RAD, SPEED_MPS, 0.0]])
    off = MARKS[:, :2] - means[0, :2]
    far, angle = np.hypot(*off.T), np.arctan2(off[:, 1], off[:, 0]) - HEADING_RAD
    rows = np.array(
        [
            [far[1] + 0.5, 0.8, angle[1] + 0.02, 0.05],
            [far[1], 0.8, angle[1], 0.05],  # taken already
            [far[0] + 9.0, 0.8, angle[0], 0.05],  # too far off
            [far[0] - 0.3, 0.8, angle[0] - 0.01, 0.05],
        ]
    )
    which = np.full((4, 1), -1)
    misses, expected = np.zeros((4, 1, 2)), np.zeros((4, 1, 2))
    look(means, consider._tracked, MARKS, rows, NOISE_RAD**2, 25.0, which, misses, expected)
    assert which[:, 0].tolist() == [1, -1, -1, 0]
    np.testing.assert_allclose(misses[[0, 3], 0], [[0.5, 0.02], [-0.3, -0.01]], atol=1e-9)
    # Before anything was seen: the first spread, and the whole of an offset.
    slope = np.array([off[0, 1], -off[0, 0]]) / far[0] ** 2
    np.testing.assert_allclose(expected[3, 0, 0], NOISE_RAD**2 + slope @ slope + 0.2**2)
    np.testing.assert_allclose(expected[3, 0, 1], 1.0 / far[0] ** 2)
