"""The compiled filter: its kernels equal the numpy classes, its runs are independent, its statistics right."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from scpf.models.batch_filter import BatchFilter, Term
from scpf.models.bearing_constraint import BearingConstraint, HeadingConstraint
from scpf.models.compiled_terms import (
    Bearing,
    Fix,
    Heading,
    Matched,
    Range,
    Road,
    Speed,
    TurnRateMotion,
    VelocityMotion,
    road_cubics,
)
from scpf.models.constraints import LandmarkConstraint, RoadConstraint, SpeedConstraint
from scpf.models.filter_kernels import fill_normals
from scpf.models.matched_landmarks import MatchedLandmarks, Sighting
from scpf.models.motion import ConstantTurnRate, ConstantVelocity, turn_rate_state
from scpf.models.particle_filter import PositionFix
from scpf.models.road_map import RoadSegment

RUNS, N = 3, 301
RNG = np.random.default_rng(0)
STATES = (RNG.normal(0, 1, (6, RUNS, N)) * np.array([5, 5, 9, 9, 2, 2])[:, None, None]).astype(np.float32)
MARKS = np.column_stack([RNG.normal(0, 25, (6, 2)), RNG.uniform(0, 2, 6)]).astype(np.float32)
WHICH = np.array([0, 4, -1])
CANDIDATES = np.array([[0, 1, 2, -1, -1, -1], [5, 4, 3, 2, 1, 0], [2, -1, -1, -1, -1, -1]])
SEEN = [Sighting(20, 5.0, 0.3, 0.8), Sighting(21, 5.0, 0.4, 0.8), Sighting(25, 5.0, -0.3, 0.8)]
CUBICS = [RoadSegment(np.array([1.0, 2.0]), np.array([0.3, 0.2, 0.01, 0.0003]), s) for s in (False, True)]
FIXES = RNG.normal(0, 3, (RUNS, 2))
ROADS = [0.1, 3.0, -2.0]


def expected(name: str, run: int, states: np.ndarray) -> np.ndarray:
    mark, own = MARKS[WHICH[run], :2].astype(float), float(MARKS[WHICH[run], 2])
    if name in ("range", "bearing") and WHICH[run] < 0:
        return np.zeros(len(states))
    candidates = MARKS[[k for k in CANDIDATES[run] if k >= 0]].astype(float)
    matched = MatchedLandmarks(candidates[:, :2], SEEN, 0.001, 0.3, candidates[:, 2])
    bearing_deviation = float(np.sqrt(0.05**2 + own / 17.0**2))
    return {
        "fix": lambda: PositionFix(FIXES[run], 4.0).log_likelihood(states),
        "road": lambda: RoadConstraint(CUBICS[run % 2]).log_probability(states),
        "speed": lambda: SpeedConstraint().log_probability(states),
        "range": lambda: 0.3 * LandmarkConstraint("a", mark, 18.0, 0.64 + own).log_probability(states),
        "bearing": lambda: 0.3 * BearingConstraint("a", mark, 0.3, bearing_deviation).log_probability(states),
        "heading": lambda: HeadingConstraint(ROADS[run], 0.26).log_probability(states),
        "matched": lambda: matched.log_probability(states),
    }[name]()


TERMS: dict[str, Term] = {
    "fix": Fix(FIXES, 4.0),
    "road": Road(road_cubics(CUBICS), np.array([0, 1, 0])),
    "speed": Speed(),
    "range": Range(MARKS, WHICH, 18.0, 0.8, 0.3),
    "bearing": Bearing(MARKS, WHICH, 17.0, 0.3, 0.05, 0.3),
    "heading": Heading(np.array(ROADS), 0.26),
    "matched": Matched(MARKS, CANDIDATES, SEEN, 0.001, 0.3),
}


@pytest.mark.parametrize("name", TERMS)
def test_a_term_equals_its_numpy_constraint(name: str) -> None:
    log_weights = np.zeros((RUNS, N), np.float32)
    TERMS[name].add_to(log_weights, STATES)
    for run in range(RUNS):
        wanted = expected(name, run, STATES[:, run].T.astype(float))
        np.testing.assert_allclose(log_weights[run], wanted, rtol=3e-6, atol=2e-5)


def test_normals_are_normal_independent_and_a_run_s_own() -> None:
    keys = np.array([5, 6], np.uint32)
    draws = np.stack([_normals(keys, step) for step in range(200)])
    assert stats.kstest(draws.ravel()[:200_000], "norm").pvalue > 1e-3
    flat = draws.astype(float)
    assert abs(flat.mean()) < 0.005
    assert abs(flat.std() - 1.0) < 0.005
    assert abs((flat**4).mean() - 3.0) < 0.05
    rows = flat.transpose(1, 2, 0, 3).reshape(8, -1)
    assert np.abs(np.corrcoef(rows) - np.eye(8)).max() < 0.01
    assert abs(np.corrcoef(flat[:-1].ravel(), flat[1:].ravel())[0, 1]) < 0.005
    assert abs(np.corrcoef(flat[..., :-1].ravel(), flat[..., 1:].ravel())[0, 1]) < 0.005
    np.testing.assert_array_equal(_normals(keys[1:], 7)[:, 0], draws[7][:, 1])


def _normals(keys: np.ndarray, step: int) -> np.ndarray:
    out = np.empty((4, len(keys), 500), np.float32)
    fill_normals(out, keys, np.uint32(step))
    return out


@pytest.mark.parametrize("turning", [False, True])
def test_motions_equal_the_numpy_models(turning: bool) -> None:
    n, dt_s = 100_000, 0.4
    model = ConstantTurnRate(2.0, 0.3, 2.0, 1e-3) if turning else ConstantVelocity(4.0)
    motion = TurnRateMotion(model) if isinstance(model, ConstantTurnRate) else VelocityMotion(model)
    start = turn_rate_state(np.array([3.0, 4.0]), np.array([6.0, 2.0]), 0.3)[: 6 if turning else 4]
    states = np.repeat(start[:, None, None], n, axis=2).astype(np.float32)
    normals = np.empty((4, 1, n), np.float32)
    fill_normals(normals, np.array([3], np.uint32), np.uint32(1))
    motion.move(states, normals, dt_s)
    reference = model.propagate(np.repeat(start[None], n, axis=0), dt_s, np.random.default_rng(0))
    moved = states[:, 0].T.astype(float)
    scale = reference.std(0)
    np.testing.assert_allclose((moved.mean(0) - reference.mean(0)) / scale, 0.0, atol=0.02)
    ours, theirs = (np.cov(rows.T) / np.outer(scale, scale) for rows in (moved, reference))
    np.testing.assert_allclose(ours, theirs, atol=0.03)


def drive(seeds: list[int], terms: list[Term], particles: int = 400) -> tuple[np.ndarray, np.ndarray]:
    filter_ = BatchFilter(VelocityMotion(ConstantVelocity(4.0)), seeds, particles)
    filter_.initialise(np.zeros((len(seeds), 4)), np.sqrt([10.0, 10.0, 2.5, 2.5]))
    for _ in range(20):
        filter_.predict(0.1)
        belief = filter_.update(terms)
    return belief.mean, filter_.states


def test_a_run_does_not_depend_on_its_batch_nor_on_the_order_of_terms() -> None:
    marks = np.array([[20.0, 5.0, 0.0]], np.float32)
    terms = lambda n: [Range(marks, np.zeros(n, np.int64), 18.0, 0.5), Speed()]  # noqa: E731
    mean, states = drive([4, 5, 4], terms(3))
    alone, own = drive([5], terms(1))
    np.testing.assert_array_equal(mean[0], mean[2])
    np.testing.assert_array_equal(mean[1], alone[0])
    np.testing.assert_array_equal(states[:, 1], own[:, 0])
    assert not np.array_equal(mean[0], mean[1])
    np.testing.assert_allclose(drive([5], terms(1)[::-1])[0], alone, atol=0.02)


def test_infinite_slack_changes_nothing() -> None:
    fix = Fix(np.array([[1.0, 2.0]]), 4.0)
    loose = Speed(1.0, float("inf"))
    np.testing.assert_array_equal(drive([5], [fix, loose])[0], drive([5], [fix])[0])


def test_it_agrees_with_the_kalman_filter() -> None:
    from scpf.models.ekf import ExtendedKalmanFilter

    runs, rng = 4, np.random.default_rng(3)
    model, variances = ConstantVelocity(4.0), np.array([10.0, 10.0, 2.5, 2.5])
    filter_ = BatchFilter(VelocityMotion(model), range(runs), 20_000, resample_below=0.5)
    filter_.initialise(np.zeros((runs, 4)), np.sqrt(variances))
    kalman = ExtendedKalmanFilter(model, np.zeros((runs, 4)), np.diag(variances))
    for k in range(25):
        fixes = np.array([0.3 * k, -0.2 * k]) + rng.normal(0, 2, (runs, 2))
        filter_.predict(0.1)
        belief = filter_.update([Fix(fixes, 4.0)])
        kalman.predict(0.1)
        kalman.update_fix(fixes, 4.0)
    np.testing.assert_allclose(belief.mean, kalman.means, atol=0.15)
    wanted = kalman.covariances[:, [0, 0, 1], [0, 1, 1]]
    np.testing.assert_allclose(belief.covariance, wanted, atol=0.12)
    assert ((belief.ess >= 1.0) & (belief.ess <= 20_000 * 1.001)).all()
    assert (belief.peak <= 0.0).all()
