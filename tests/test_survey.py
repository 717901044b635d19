"""Surveys of landmarks: exact data, honest covariances, outliers, and the laws that must hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from survey_drives import (
    BEARING_DEVIATION_RAD,
    POLES,
    RANGE_DEVIATION_M,
    Noise,
    drive,
    moved,
    turned,
    wrong_map,
)

from scpf.models.road_map import RoadMap
from scpf.models.survey import FEW, VAGUE, SurveySettings, survey
from scpf.models.survey_fit import FitSettings, Lasting, Sights, effective_number, locate
from scpf.models.survey_matching import DOUBTFUL, NO_LANDMARK, Places, match

WHITE = Lasting(share=0.0)
TOLD = FitSettings(bearing_deviation_rad=BEARING_DEVIATION_RAD)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_exact_data_give_exact_positions() -> None:
    sights, _ = drive(POLES, None, rng())
    old = wrong_map(POLES, rng(1))
    found = survey(sights, old)
    assert np.abs(found.road_map.positions_m - POLES).max() < 1e-6
    assert (found.unmatched, found.doubtful) == (0, 0)
    assert sum(row.sightings for row in found.landmarks) == len(sights)
    off = np.hypot(*(old.positions_m - POLES).T)
    assert [row.moved_m for row in found.landmarks] == pytest.approx(off.tolist())
    for mark, row in zip(found.road_map.landmarks, found.landmarks, strict=True):
        assert mark.position_m[2] == 3.0
        assert mark.variance_m2 == pytest.approx(row.deviation_m**2)
    assert np.array_equal(found.road_map.centre_line_m, old.centre_line_m)


def test_the_covariance_is_the_spread_of_many_draws() -> None:
    pole = POLES[1:2]
    settings = replace(TOLD, bearings=WHITE)
    generator = rng(2)
    draws = [
        locate(drive(pole, Noise(), generator)[0], pole[0] + np.array([1.0, -1.0]), settings)
        for _ in range(180)
    ]
    off = np.array([each.position_m for each in draws]) - pole[0]
    stated = np.mean([each.covariance_m2 for each in draws], axis=0)
    spread = off.T @ off / len(off)
    scatter = np.linalg.eigvals(np.linalg.solve(stated, spread)).real
    assert scatter.min() > 0.75
    assert scatter.max() < 1.3
    assert np.abs(off.mean(0)).max() < 0.05

    # Whoever takes lasting errors for new ones believes far too much.
    sights = drive(pole, Noise(), generator)[0]
    naive = locate(sights, pole[0], replace(settings, ranges=WHITE)).covariance_m2
    assert np.linalg.eigvals(np.linalg.solve(naive, spread)).real.max() > 1.8


def test_a_wrong_map_is_put_right_within_its_own_deviations() -> None:
    errors, squared = [], []
    for seed in range(4):
        sights, _ = drive(POLES, Noise(), rng(seed))
        found = survey(sights, wrong_map(POLES, rng(100 + seed)))
        off = np.hypot(*(found.road_map.positions_m - POLES).T)
        assert not any(row.reason for row in found.landmarks)
        errors.append(off.mean())
        squared.append(np.mean(off**2 / [mark.variance_m2 for mark in found.road_map.landmarks]))
    assert np.mean(errors) < 0.15
    assert 1.0 < np.mean(squared) < 3.5  # 2 is right


@pytest.mark.parametrize(("bearing_s", "low", "high"), [(0.0, 0.0, 0.15), (1.0, 0.6, 1.0)])
def test_how_much_of_the_errors_lasts_is_found_out(bearing_s: float, low: float, high: float) -> None:
    poles = np.concatenate([POLES, POLES + np.array([200.0, 1.0])])
    sights, _ = drive(poles, Noise(bearing_s=bearing_s), rng(3))
    found = survey(sights, wrong_map(poles, rng(4), (0.0, 0.5)))
    assert low <= found.bearing_share <= high
    assert 0.6 <= found.range_share <= 1.0


def test_deviations_that_are_stated_too_small_are_scaled() -> None:
    settings = SurveySettings(fit=TOLD)
    sights, _ = drive(POLES, Noise(range_s=0.0, scale=2.0), rng(5))
    found = survey(sights, wrong_map(POLES, rng(6)), settings)
    assert found.range_scale == pytest.approx(2.0, rel=0.15)
    assert found.bearing_scale == pytest.approx(2.0, rel=0.15)
    plain = survey(drive(POLES, Noise(range_s=0.0), rng(5))[0], wrong_map(POLES, rng(6)), settings)
    assert plain.range_scale == pytest.approx(1.0, abs=0.1)
    assert plain.bearing_scale == pytest.approx(1.0, abs=0.1)
    assert found.landmarks[3].deviation_m > 1.5 * plain.landmarks[3].deviation_m


@pytest.mark.parametrize("turn_deg", [-0.4, 0.0, 0.6])
def test_what_all_directions_are_off_is_found_and_taken_out(turn_deg: float) -> None:
    sights, _ = drive(POLES, Noise(), rng(14))
    found = survey(sights.turned(np.radians(turn_deg)), wrong_map(POLES, rng(15)))
    off_deg, deviation_deg = np.degrees([found.turned_rad - np.radians(turn_deg), found.turned_deviation_rad])
    assert abs(off_deg) < 3.0 * deviation_deg
    assert deviation_deg < 0.2
    off = np.hypot(*(found.road_map.positions_m - POLES).T)
    assert off.mean() < 0.2
    assert np.mean(off**2 / [mark.variance_m2 for mark in found.road_map.landmarks]) < 4.0  # 2 is right


def test_outliers_are_rejected_and_change_nothing() -> None:
    sights, shown = drive(POLES, None, rng())
    wrong = rng(7).uniform(size=len(sights)) < 0.15
    bad = replace(
        sights,
        distances_m=sights.distances_m + np.where(wrong, 6.0 * RANGE_DEVIATION_M, 0.0),
        directions_rad=sights.directions_rad + np.where(wrong, 3.0 * BEARING_DEVIATION_RAD, 0.0),
    )
    for k, pole in enumerate(POLES):
        mine = shown == k
        found = locate(bad.rows(mine), pole + np.array([1.2, -0.9]), TOLD)
        assert np.array_equal(found.kept, ~wrong[mine])
        assert np.abs(found.position_m - pole).max() < 1e-6
    whole = survey(bad, wrong_map(POLES, rng(8)))
    assert np.abs(whole.road_map.positions_m - POLES).max() < 1e-6
    assert sum(row.rejected for row in whole.landmarks) + whole.unmatched == wrong.sum()


@pytest.mark.parametrize("turn_rad", [0.7, np.pi, -2.9])
def test_rigid_motion_of_the_world_carries_over(turn_rad: float) -> None:
    sights, shown = drive(POLES, Noise(), rng(9))
    shift = np.array([300.0, -120.0])
    old = wrong_map(POLES, rng(10))
    places = turned(old.positions_m, turn_rad) + shift
    marks = [
        replace(mark, position_m=(float(x), float(y), 3.0))
        for mark, (x, y) in zip(old.landmarks, places, strict=True)
    ]
    here, there = (
        survey(sights, old),
        survey(moved(sights, turn_rad, shift), replace(old, landmarks=tuple(marks))),
    )
    expected = turned(here.road_map.positions_m, turn_rad) + shift
    assert np.abs(there.road_map.positions_m - expected).max() < 1e-5
    for a, b in zip(here.landmarks, there.landmarks, strict=True):
        assert (a.sightings, a.rejected) == (b.sightings, b.rejected)
        assert b.deviation_m == pytest.approx(a.deviation_m, rel=1e-4)
    mine, R = shown == 4, turned(np.eye(2), turn_rad).T
    one = locate(sights.rows(mine), POLES[4], TOLD)
    start = turned(POLES[4:5], turn_rad)[0] + shift
    other = locate(moved(sights.rows(mine), turn_rad, shift), start, TOLD)
    assert other.covariance_m2 == pytest.approx(R @ one.covariance_m2 @ R.T, rel=1e-3, abs=1e-6)


def test_landmarks_hardly_seen_keep_their_position() -> None:
    sights, shown = drive(POLES, Noise(), rng(11))
    few = np.flatnonzero(shown == 2)[:9]
    old = wrong_map(POLES, rng(12))
    found = survey(sights.rows(np.sort(np.concatenate([np.flatnonzero(shown != 2), few]))), old)
    assert found.landmarks[2].reason == FEW
    assert (found.landmarks[2].sightings, found.landmarks[2].moved_m) == (9, 0.0)
    assert found.road_map.landmarks[2] is old.landmarks[2]
    assert not found.landmarks[3].reason
    # Many sightings from one place, all alike: the range is hardly known.
    still = sights.rows(np.repeat(np.flatnonzero(shown == 5)[:1], 30))
    blurred = replace(still, times_s=np.arange(30) / 100.0, variances_m2=np.full(30, 9.0))
    vague = survey(blurred, old).landmarks[5]
    assert (vague.reason, vague.sightings) == (VAGUE, 30)
    nothing = survey(sights.rows(np.zeros(0, np.intp)), old)
    assert nothing.road_map.landmarks == old.landmarks
    assert {row.reason for row in nothing.landmarks} == {FEW}
    assert len(survey(sights, RoadMap((), np.zeros((0, 2)))).landmarks) == 0


def test_a_sighting_in_doubt_is_left_out() -> None:
    places = Places(
        np.array([[20.0, 3.0], [20.0, 3.4], [40.0, -5.0]]), np.full(3, 0.5), np.full(3, "light_pole")
    )

    def at(*points: tuple[float, float], kind: str = "light_pole") -> Sights:
        feet, n = np.array(points), len(points)
        direction = np.arctan2(feet[:, 1], feet[:, 0])
        here, kinds = np.zeros((n, 2)), np.full(n, kind)
        return Sights(np.zeros(n), here, np.hypot(*feet.T), np.full(n, 0.1), here, direction, kinds)

    def matched(sights: Sights) -> list[int]:
        return match(sights, places, BEARING_DEVIATION_RAD, 13.8, 6.0).tolist()

    assert matched(at((20.0, 3.1), (40.0, -5.2))) == [DOUBTFUL, 2]
    assert matched(at((39.8, -5.0), (40.3, -5.0))) == [DOUBTFUL, DOUBTFUL]
    assert matched(at((30.0, 8.0))) == [NO_LANDMARK]
    assert matched(at((40.0, -5.0), kind="sign")) == [NO_LANDMARK]


def test_the_effective_number_is_that_of_the_direct_sum() -> None:
    times = np.sort(rng(13).uniform(0.0, 20.0, 60))
    lasting = Lasting(0.7, 1.3)
    correlation = np.where(np.eye(60) > 0, 1.0, 0.7 * np.exp(-np.abs(times[:, None] - times) / 1.3))
    assert effective_number(times, lasting) == pytest.approx(60**2 / correlation.sum())
    assert effective_number(times, WHITE) == pytest.approx(60.0)
    assert effective_number(np.zeros(60), Lasting()) == pytest.approx(1.0)
