"""The fit monitor: silent where variances are right, firm where every detection is off."""

from __future__ import annotations

import numpy as np

from scpf.models.fit_monitor import FitMonitor, FitSettings
from scpf.models.matched_landmarks import Sighting

MARKS = np.array([[20.0, 6.0], [45.0, -6.0], [-30.0, 6.0]])


def watch(error_m: float, error_rad: float, frames: int = 3000) -> FitMonitor:
    """Two runs whose detections of the first landmark have normal errors of these deviations."""
    monitor, rng = FitMonitor(FitSettings(), 2), np.random.default_rng(0)
    for _ in range(frames):
        distance = float(np.hypot(*MARKS[0])) + error_m * rng.standard_normal()
        bearing = float(np.arctan2(6.0, 20.0)) + error_rad * rng.standard_normal()
        seen = Sighting(distance, 1.0, bearing, 0.05)
        monitor.observe(np.repeat(MARKS[None], 2, axis=0), np.zeros(2), np.full(2, 0.01), seen)
    return monitor


def test_it_is_half_the_squared_deviations() -> None:
    np.testing.assert_allclose(watch(1.0, 0.0).misfit, 0.5, atol=0.05)
    np.testing.assert_allclose(watch(0.0, 0.05).misfit, 0.5, atol=0.05)


def test_a_good_fit_costs_nothing_and_a_bad_one_weight() -> None:
    np.testing.assert_array_equal(watch(0.5, 0.01).share, 1.0)
    bad, worse = watch(1.5, 0.05), watch(2.5, 0.1)
    assert (worse.share < bad.share).all()
    assert (bad.share < 0.3).all()


def test_a_false_detection_is_bounded_and_runs_are_apart() -> None:
    settings = FitSettings(memory=10.0)
    monitor = FitMonitor(settings, 2)
    offsets = np.stack([MARKS, MARKS - 5.0])
    far = Sighting(500.0, 0.1, 2.0, 0.01)
    monitor.observe(offsets, np.zeros(2), np.zeros(2), far)
    np.testing.assert_allclose(
        monitor.misfit, settings.expected + (settings.largest - settings.expected) / 10
    )
    exact = Sighting(float(np.hypot(20, 6)), 0.1, float(np.arctan2(6.0, 20.0)), 0.01)
    monitor.observe(offsets, np.zeros(2), np.zeros(2), exact)
    assert monitor.misfit[0] < monitor.misfit[1]
