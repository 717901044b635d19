"""Replay's `default` preset is the evaluation's: the same estimates, tempering and covariance, step by step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from scpf.models.association import Match
from scpf.models.instances import Instance
from scpf.models.matched_landmarks import MatchedLandmarks
from scpf.models.motion import ConstantTurnRate, turn_rate_state
from scpf.models.observation import Distance, Observation
from scpf.models.particle_filter import Belief, PositionFix
from scpf.models.road_map import Landmark, RoadMap
from scpf.replay.evaluation_metrics import normalised_squared_errors
from scpf.replay.evaluation_particles import ParticleRuns
from scpf.replay.evaluation_presets import PRESETS as EVALUATED
from scpf.replay.lasting_tracker import LastingTracker
from scpf.replay.protocol import CASES, Detection, Scenario, gps_fixes, make_scenario
from scpf.replay.settings import PRESETS
from scpf.replay.soft_constraints import soft_constraints

SETTINGS = PRESETS["default"]
SIGMA_M, FRAMES = 3.0, 500


def observed(detections: Sequence[Detection], landmark_class: str = "light_pole") -> list[Observation]:
    pole = Instance((0, 0, 4, 40), np.ones((40, 4), bool), (0, 0), 0.9, landmark_class)
    return [
        Observation(pole, Distance(d.distance_m, d.variance_m2, 0.1, "far"), d.bearing_rad)
        for d in detections
    ]


def tracker(road_map: RoadMap, seed: int) -> LastingTracker:
    heading = SETTINGS.heading
    assert heading is not None
    motion = ConstantTurnRate(SETTINGS.q_m2ps3, heading.q_turn_rad2ps3)
    return LastingTracker(heading, motion, SETTINGS.filter, road_map, np.random.default_rng(seed))


def replayed(scenario: Scenario, fixes: np.ndarray, first: np.ndarray) -> tuple[list[Belief], list[float]]:
    track = tracker(scenario.road_map, 1)
    heading = scenario.drive.headings_rad[0]
    track.initialise(turn_rate_state(first[:2], first[2:], float(heading)))
    beliefs, exponents = [], []
    for k, detections in enumerate(scenario.detections):
        predicted = track.predict(float(scenario.times_s[k] - scenario.times_s[max(k - 1, 0)]))
        seen = observed(detections)
        unmatched = [Match("")] * len(seen)
        exponents.append(track.exponent)
        constraints = soft_constraints(
            SETTINGS, scenario.road_map, seen, unmatched, predicted, predicted[4], track.exponent
        )
        beliefs.append(track.update(constraints, PositionFix(fixes[k], SIGMA_M**2)))
    return beliefs, exponents


@pytest.mark.parametrize("case", ["S0", "S2"])
def test_it_is_the_filter_of_the_evaluation(case: str) -> None:
    scenario = make_scenario(CASES[case], 0, FRAMES)
    drive = scenario.drive
    fixes = gps_fixes(drive, SIGMA_M, np.random.default_rng(3))
    first = np.concatenate([drive.positions_m[0], drive.velocities_mps[0]]) + 0.5
    runs = ParticleRuns(EVALUATED["default"], scenario, SIGMA_M, np.stack([first] * 2), [5, 6], False)
    means, spreads, tempering = [], [], []
    for k, detections in enumerate(scenario.detections):
        tempering.append(runs._exponents()[0])
        mean, covariance = runs.step(float(k > 0) / 13.0, np.stack([fixes[k]] * 2), detections)
        means.append(mean[:, :2])
        spreads.append(covariance[0])
    beliefs, exponents = replayed(scenario, fixes, first)
    theirs, ours = np.array(means), np.array([belief.mean for belief in beliefs])
    # Other random numbers: as near to theirs as theirs are to one another.
    between = np.hypot(*(theirs[:, 0] - theirs[:, 1])[50:].T).mean()
    apart = np.hypot(*(theirs[:, 0] - ours[:, :2])[50:].T).mean()
    wrong = np.hypot(*(ours[:, :2] - drive.positions_m)[50:].T).mean()
    assert apart < 1.5 * between < wrong
    assert np.abs(np.array(exponents) - tempering)[50:].mean() < 0.05
    assert np.ptp(exponents) > 0.05  # it learns
    deviations = np.sqrt(np.array(spreads)[50:, [0, 2]])
    own = np.sqrt(np.array([np.diag(belief.covariance)[:2] for belief in beliefs])[50:])
    assert np.abs(np.log(own / deviations)).mean() < 0.1
    rows = np.array([belief.covariance[[0, 0, 1], [0, 1, 1]] for belief in beliefs])
    squared = normalised_squared_errors(ours[None, 50:, :2], rows[None, 50:], drive.positions_m[50:])
    assert 0.3 < squared.mean() < 4.0
    assert all(np.linalg.eigvalsh(belief.covariance).min() > -1e-9 for belief in beliefs[::50])


def test_a_new_start_forgets() -> None:
    scenario = make_scenario(CASES["S2"], 0, 200)
    fixes = gps_fixes(scenario.drive, SIGMA_M, np.random.default_rng(3))
    first = np.concatenate([scenario.drive.positions_m[0], scenario.drive.velocities_mps[0]])
    fresh = tracker(scenario.road_map, 1)
    start = fresh.exponent
    assert replayed(scenario, fixes, first)[1][-1] != start
    fresh.initialise(turn_rate_state(first[:2], first[2:], 0.0))
    assert fresh.exponent == start


ROAD = np.column_stack([np.linspace(-50.0, 150.0, 41), np.zeros(41)])
MARKS = (
    Landmark("exact", (20.0, 6.0, 0.0)),
    Landmark("rough", (30.0, -6.0, 0.0), variance_m2=4.0),
    Landmark("tree", (25.0, 6.0, 0.0), "tree", 1.0),
    Landmark("behind", (-40.0, 6.0, 0.0)),
    Landmark("far", (120.0, 6.0, 0.0)),
)


def matched(detections: Sequence[Observation]) -> list[MatchedLandmarks]:
    predicted = np.array([0.0, 0.0, 8.0, 0.0, 0.0, 0.0])
    unmatched = [Match("")] * len(detections)
    found = soft_constraints(SETTINGS, RoadMap(MARKS, ROAD), detections, unmatched, predicted, 0.0, 0.3)
    return [one for one in found if isinstance(one, MatchedLandmarks)]


def test_every_landmark_is_weighed_by_its_own_variance() -> None:
    (one,) = matched(observed([Detection(-1, 21.0, 0.64, 0.3)]))
    np.testing.assert_array_equal(one.positions_m, [[20.0, 6.0], [30.0, -6.0]])
    np.testing.assert_array_equal(one.variances_m2, [0.0, 4.0])
    assert one.exponent == 0.3
    assert one.sightings[0].distance_deviation_m == pytest.approx(0.8)


def test_a_detection_is_a_landmark_of_its_class_or_none() -> None:
    pole, tree = Detection(-1, 21.0, 0.64, 0.3), Detection(-1, 25.0, 0.64, 0.24)
    poles, trees = matched([*observed([pole]), *observed([tree], "tree")])
    np.testing.assert_array_equal(trees.positions_m, [[25.0, 6.0]])
    assert [len(poles.sightings), len(trees.sightings)] == [1, 1]
    assert matched(observed([tree], "sign")) == []
    outside = replace(observed([pole])[0], distance=Distance(21.0, 0.64, 0.1, "far", in_range=False))
    assert matched([outside]) == []
