"""What lasts of the errors is found in innovations that are made to last."""

from __future__ import annotations

import numpy as np
import pytest

from scpf.models.lasting_errors import LastingErrors, LastingSettings, LastingTempering

DT_S = 0.1
SETTINGS = LastingSettings()


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_the_share_of_a_range_s_variance_that_lasts_is_found(share: float) -> None:
    rng, runs = np.random.default_rng(0), 40
    lasting = LastingErrors(SETTINGS, runs, 3)
    keep = np.exp(-DT_S / SETTINGS.correlation_time_s)
    slow = rng.standard_normal((runs, 3))
    for k in range(1200):
        slow = keep * slow + np.sqrt(1 - keep**2) * rng.standard_normal((runs, 3))
        for mark in range(3):
            miss = np.sqrt(share) * slow[:, mark] + np.sqrt(1 - share) * rng.standard_normal(runs)
            lasting.observe_range(k * DT_S, np.full(runs, mark), miss)
    assert lasting.share.mean() == pytest.approx(share, abs=0.06)
    assert lasting.share.std() < 0.15


def test_gaps_and_other_landmarks_are_not_compared() -> None:
    lasting = LastingErrors(SETTINGS, 2, 2)
    for k in range(200):
        lasting.observe_range(float(k), np.array([0, -1]), np.ones(2))  # a second apart
        lasting.observe_range(k + 0.1, np.array([k % 2, 0]) - np.array([0, 1]), np.ones(2))
    assert lasting.share[1] == SETTINGS.first_share
    assert lasting.share[0] > 0.75


def drive(offsets_m: np.ndarray, speed_mps: float, steps: int, noise_m: float = 0.2) -> LastingErrors:
    """Runs that pass one landmark after another, 5 s each, displaced by ``offsets_m`` (R, L) across."""
    rng = np.random.default_rng(1)
    runs, marks = offsets_m.shape
    lasting = LastingErrors(SETTINGS, runs, marks)
    range_m = 20.0
    variances = np.tile([(noise_m / range_m) ** 2, 1.0 / range_m**2], (runs, 1))
    for k in range(steps):
        mark = (k // 50) % marks
        miss = (offsets_m[:, mark] + noise_m * rng.standard_normal(runs)) / range_m
        travelled = np.full(runs, k * DT_S * speed_mps)
        lasting.observe_bearing(k * DT_S, travelled, np.full(runs, mark), miss, variances)
    return lasting


@pytest.mark.parametrize("variance_m2", [0.0, 0.3, 1.2])
def test_the_variance_of_misplaced_landmarks_is_found(variance_m2: float) -> None:
    offsets = np.sqrt(variance_m2) * np.random.default_rng(2).standard_normal((60, 30))
    lasting = drive(offsets, 5.0, 1500)
    assert lasting.offset_m2.mean() == pytest.approx(variance_m2, rel=0.15, abs=0.01)


def test_a_vehicle_that_stands_learns_nothing_about_places() -> None:
    fresh = LastingErrors(SETTINGS, 3, 2)
    np.testing.assert_array_equal(drive(np.ones((3, 2)), 0.0, 400).offset_m2, fresh.offset_m2)


def test_few_landmarks_say_as_much_as_many_on_average() -> None:
    few, many = drive(np.ones((20, 2)), 5.0, 100), drive(np.ones((2, 40)), 5.0, 2000)
    assert few.offset_m2.mean() == pytest.approx(1.0, abs=0.2)
    assert many.offset_m2.mean() == pytest.approx(1.0, abs=0.05)


def test_runs_are_independent_and_a_filter_that_is_uncertain_itself_is_not_believed() -> None:
    lasting = LastingErrors(SETTINGS, 3, 1)
    variances = np.array([[1e-4, 1 / 400.0], [1e-4, 1 / 400.0], [1.0, 1 / 400.0]])
    for k in range(100):
        seen = np.array([0, -1, 0])
        lasting.observe_bearing(float(k), np.full(3, 10.0 * k), seen, np.full(3, 0.05), variances)
    assert lasting.offset_m2[0] > 0.5
    np.testing.assert_array_equal(lasting.offset_m2[1:], LastingErrors(SETTINGS, 2, 1).offset_m2)


def test_tempering_goes_from_white_to_lasting_and_falls_with_the_offsets() -> None:
    tempering = LastingTempering(0.5, 0.2, 0.5)
    exponents = tempering.exponent(np.array([0.0, 1.0, 0.5, 0.0]), np.array([0.0, 0.0, 0.0, 0.5]))
    np.testing.assert_allclose(exponents, [0.5, 0.2, 1 / 3.5, 0.25])
