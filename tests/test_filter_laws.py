"""Laws that both particle filters keep, whatever the numbers: weights, order, rigid motions, slack, resampling."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from scpf.models.batch_filter import BatchFilter
from scpf.models.bearing_constraint import BearingConstraint, HeadingConstraint, RoadBearingConstraint
from scpf.models.compiled_terms import Fix, Range, Road, Speed, VelocityMotion, road_cubics
from scpf.models.constraints import (
    Constraint,
    LandmarkConstraint,
    RoadConstraint,
    SpeedConstraint,
    log_probability,
)
from scpf.models.filter_kernels import conclude, normalise, resample, summarise
from scpf.models.matched_landmarks import MatchedLandmarks, Sighting
from scpf.models.motion import ConstantTurnRate, ConstantVelocity, MotionModel
from scpf.models.particle_filter import FilterSettings, ParticleFilter, PositionFix
from scpf.models.road_map import RoadSegment
from scpf.models.slack import Slackened, Tempered

MARKS = np.array([[20.0, 6.0], [24.0, -6.0], [45.0, 6.5]])
LINE = RoadConstraint(RoadSegment(np.array([5.0, 0.0]), np.array([0.0, 0.05, 0.0, 0.0]), False))
RING = LandmarkConstraint("a", MARKS[0], 19.0, 0.6)
CONSTRAINTS: list[Constraint] = [
    LINE,
    SpeedConstraint(12.0),
    RING,
    BearingConstraint("a", MARKS[0], 0.3, 0.05),
    RoadBearingConstraint("a", MARKS[0], 0.3, 0.1, 0.05),
    HeadingConstraint(0.1),
    MatchedLandmarks(MARKS, (Sighting(21.0, 0.8, 0.3, 0.05), Sighting(25.0, 1.0, -0.2, 0.05)), exponent=0.3),
    Slackened(LandmarkConstraint("b", MARKS[1], 24.0, 0.6), 1.0),
    Tempered(LandmarkConstraint("c", MARKS[2], 44.0, 0.6), 0.2),
]
NAMES = [f"{type(one).__name__}" for one in CONSTRAINTS]
seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=25)


def states(seed: int, n: int = 40) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.normal(0, 1, (n, 6)) * np.array([4.0, 4.0, 9.0, 9.0, 0.3, 0.1])


@few
@given(seeds, st.permutations(range(len(CONSTRAINTS))), st.permutations(range(40)))
def test_order_of_particles_and_constraints_changes_nothing(
    seed: int, order: list[int], particles: list[int]
) -> None:
    here = states(seed)
    expected = log_probability(CONSTRAINTS, here)
    again = log_probability([CONSTRAINTS[k] for k in order], here[particles])
    np.testing.assert_allclose(again, expected[particles], rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("constraint", CONSTRAINTS, ids=NAMES)
@few
@given(seeds)
def test_what_violates_more_is_less_probable(constraint: Constraint, seed: int) -> None:
    here = states(seed, 60)
    if isinstance(constraint, MatchedLandmarks):
        # Its violation counts ranges alone: so one detection, and places along the line of sight.
        constraint = MatchedLandmarks(MARKS[:1], constraint.sightings[:1])
        away = np.sort(np.random.default_rng(seed).uniform(0.0, 40.0, 60))
        direction = np.array([np.cos(0.3), np.sin(0.3)])
        here[:, :2], here[:, 4] = MARKS[0] - away[:, None] * direction, 0.0
    violation, log_pr = constraint.violation(here), constraint.log_probability(here)
    ranked = log_pr[np.argsort(violation, kind="stable")]
    assert (np.diff(ranked) <= 1e-5).all()
    assert (log_pr <= 1e-6).all()
    assert log_pr.min() < log_pr.max()


def loosened(scale: float) -> dict[str, Constraint]:
    return {
        "road": RoadConstraint(LINE.segment, slack_mean_m=scale),
        "speed": SpeedConstraint(12.0, scale),
        "range": LandmarkConstraint("a", MARKS[0], 19.0, scale**2),
        "bearing": BearingConstraint("a", MARKS[0], 0.3, scale),
        "road bearing": RoadBearingConstraint("a", MARKS[0], 0.3, 0.1, scale),
        "heading": HeadingConstraint(0.1, scale),
        "matched": MatchedLandmarks(MARKS, (Sighting(21.0, scale, 0.3, scale),)),
        "student": Slackened(RING, scale),
        "tempered": Tempered(RING, 1.0 / scale),
    }


@pytest.mark.parametrize("name", list(loosened(1.0)))
@few
@given(seeds)
def test_an_infinite_slack_changes_nothing(name: str, seed: int) -> None:
    here = states(seed)
    # Single precision's best is 1e-6; a slack of 1 says something, or the test would show nothing.
    np.testing.assert_allclose(loosened(1e9)[name].log_probability(here), 0.0, atol=3e-6)
    assert loosened(0.3)[name].log_probability(here).min() < -0.1


def turned(points: np.ndarray, turn: float) -> np.ndarray:
    c, s = np.cos(turn), np.sin(turn)
    return points @ np.array([[c, s], [-s, c]])


class Turned:
    """A motion whose noise is turned with the world: the same drive, seen from elsewhere."""

    def __init__(self, model: MotionModel, turn: float, shift: np.ndarray) -> None:
        self.model, self.turn, self.shift = model, turn, shift

    def back(self, rows: np.ndarray, turn: float, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        moved = rows.copy()
        moved[:, :2], moved[:, 2:4] = turned(rows[:, :2] - before, turn) + after, turned(rows[:, 2:4], turn)
        if rows.shape[1] > 4:
            moved[:, 4] += turn
        return moved

    def propagate(self, rows: np.ndarray, dt_s: float, rng: np.random.Generator) -> np.ndarray:
        home = self.back(rows, -self.turn, self.shift, np.zeros(2))
        return self.back(self.model.propagate(home, dt_s, rng), self.turn, np.zeros(2), self.shift)


@pytest.mark.parametrize("turning", [False, True])
@few
@given(st.floats(-3.0, 3.0), st.floats(-800, 800), st.floats(-800, 800))
def test_a_rigid_motion_of_the_world_carries_over_to_the_whole_filter(
    turning: bool, turn: float, east: float, north: float
) -> None:
    shift, first = np.array([east, north]), np.array([0.0, 0.0, 8.0, 0.5])
    model: MotionModel = ConstantTurnRate(2.0, 0.05) if turning else ConstantVelocity(4.0)
    if turning:
        first = np.concatenate([first[:2], [8.0, 0.0, 0.0, 0.0]])
    variances = (4.0, 4.0, 1.0, 1.0, 0.01, 0.01)[: len(first)]

    def drive(turn: float, shift: np.ndarray) -> np.ndarray:
        filter_ = ParticleFilter(
            Turned(model, turn, shift), FilterSettings(300, variances), np.random.default_rng(1)
        )
        filter_.initialise(first)
        filter_._states = Turned(model, turn, shift).back(filter_._states, turn, np.zeros(2), shift)
        marks = turned(MARKS, turn) + shift
        for k in range(6):
            filter_.predict(0.1)
            seen: list[Constraint] = [
                LandmarkConstraint("a", marks[0], 20.0 - 0.7 * k, 0.6),
                SpeedConstraint(),
            ]
            if turning:
                seen += [HeadingConstraint(turn), BearingConstraint("a", marks[0], 0.3, 0.1)]
            fix = turned(np.array([[0.8 * k, 0.3]]), turn)[0] + shift
            belief = filter_.update(seen, PositionFix(fix, 9.0))
        return belief.mean

    expected, found = drive(0.0, np.zeros(2)), drive(turn, shift)
    home = Turned(model, 0.0, np.zeros(2)).back(found[None], -turn, shift, np.zeros(2))[0]
    np.testing.assert_allclose(home, expected, atol=1e-6)


@few
@given(seeds, st.floats(-300, 300))
def test_weights_are_normalised_however_improbable_all_is(seed: int, far_m: float) -> None:
    fix = np.array([far_m * 100, -far_m])
    filter_ = ParticleFilter(ConstantVelocity(4.0), FilterSettings(100), np.random.default_rng(seed))
    filter_.initialise(np.zeros(4))
    filter_.predict(0.1)
    belief = filter_.update([RING, SpeedConstraint(1.0)], PositionFix(fix, 1.0))
    assert belief.weights.sum() == pytest.approx(1.0)
    assert 1.0 - 1e-9 <= belief.ess <= 100.0 + 1e-9
    compiled = BatchFilter(VelocityMotion(ConstantVelocity(4.0)), [seed], 100, resample_below=0.0)
    compiled.initialise(np.zeros((1, 4)), np.ones(4))
    ring = Range(np.array([[20.0, 6.0, 0.0]], np.float32), np.array([0]), 19.0, 0.8)
    found = compiled.update([Fix(fix[None], 1.0), Speed(1.0), ring])
    assert compiled._weights.sum() == pytest.approx(1.0, abs=1e-5)
    assert 1.0 - 1e-4 <= found.ess[0] <= 100.0 + 1e-2
    assert np.isfinite(found.mean).all()


@few
@given(seeds, st.permutations(range(4)))
def test_order_of_terms_changes_no_weight_of_the_compiled_filter(seed: int, order: list[int]) -> None:
    marks = np.array([[20.0, 6.0, 0.3]], np.float32)
    segment = RoadSegment(np.zeros(2), np.array([0.0, 0.1, 0.0, 0.0]), False)
    terms: list[Any] = [
        Fix(np.array([[1.0, 2.0]]), 9.0),
        Road(road_cubics([segment]), np.array([0])),
        Speed(8.0),
        Range(marks, np.array([0]), 19.0, 0.8),
    ]
    weights = []
    for some in (terms, [terms[k] for k in order]):
        filter_ = BatchFilter(VelocityMotion(ConstantVelocity(4.0)), [seed], 200, resample_below=0.0)
        filter_.initialise(np.zeros((1, 4)), np.array([3.0, 3.0, 6.0, 6.0]))
        filter_.update(some)
        weights.append(filter_._weights.copy())
    np.testing.assert_allclose(weights[0], weights[1], rtol=2e-4, atol=1e-8)


@given(
    arrays.arrays(np.float32, st.integers(1, 60), elements=st.floats(0, 1, width=32)),
    st.integers(0, 2**32 - 1),
    st.integers(0, 2**20),
)
def test_compiled_resampling_draws_each_particle_its_share_in_order(
    raw: np.ndarray, key: int, step: int
) -> None:
    if raw.sum() < 1e-3:
        raw = raw + np.float32(1.0)
    weights, n = (raw / raw.sum())[None], len(raw)
    particles = np.arange(n, dtype=np.float32)[None, None]
    target, chosen = np.full_like(particles, -1.0), np.full(n + 1, 7)
    resample(particles, target, weights, chosen, np.array([key], np.uint32), np.uint32(step))
    drawn = target[0, 0]
    assert (np.diff(drawn) >= 0).all()
    counts = np.bincount(drawn.astype(int), minlength=n)
    assert counts.sum() == len(counts) == n
    assert (np.abs(counts - n * weights[0]) < 1 + 1e-3).all()


@few
@given(seeds, st.sampled_from([0.0, 0.3, 0.9, 1.0]))
def test_a_step_s_end_is_its_parts_one_after_the_other(seed: int, below: float) -> None:
    rng, runs, n = np.random.default_rng(seed), 3, 50
    log_weights = rng.normal(0, 1.5, (runs, n)).astype(np.float32)
    particles = rng.normal(0, 5, (4, runs, n)).astype(np.float32)
    keys, step, chosen = np.arange(runs, dtype=np.uint32), np.uint32(3), np.zeros(n + 1, np.int64)
    wanted = [np.empty((runs, 4)), np.empty((runs, 3)), np.empty(runs), np.empty(runs)]
    weights = np.empty_like(log_weights)
    normalise(log_weights, weights, wanted[3])
    summarise(particles, weights, *wanted[:3])
    drawn = np.empty_like(particles)
    resample(particles, drawn, weights, chosen, keys, step)
    found = [np.empty_like(each) for each in wanted]
    target, own, left = np.empty_like(particles), np.empty_like(weights), log_weights.copy()
    done = conclude(left, own, particles, target, chosen, keys, step, below, *found)
    for one, other in zip(found, wanted, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-5)
    assert done == (below >= 1.0 or bool((wanted[2] < below * n).any()))
    if done:
        np.testing.assert_array_equal(target, drawn)
        assert not left.any()
    else:
        np.testing.assert_array_equal(left, log_weights)
