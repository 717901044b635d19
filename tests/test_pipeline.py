"""The step, on a synthetic road with an exact distance model: what goes in comes out at the right place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NoReturn

import numpy as np
import pytest

from scpf.models.camera import Camera, looking_ahead
from scpf.models.constraints import Constraint, LandmarkConstraint, SpeedConstraint, total_violation
from scpf.models.instances import Instance, foot_px, instance_from_mask
from scpf.models.observation import Distance
from scpf.models.particle_filter import Belief, ParticleFilter, PositionFix
from scpf.models.road_map import Landmark, RoadMap
from scpf.replay.pipeline import Pipeline
from scpf.replay.settings import PRESETS, ConstraintSettings, Settings, SurfaceSettings
from scpf.replay.step import Frame, Step

MOUNT = looking_ahead()
MOUNT[2, 3] = 2.0
CAMERA = Camera(640, 480, np.array([[500.0, 0, 320], [0, 500.0, 240], [0, 0, 1]]), T_body_camera=MOUNT)
POLES = ((20.0, 6.0), (33.0, -5.5), (52.0, 6.2), (70.0, -6.1))
ROAD = RoadMap(
    tuple(Landmark(f"P{k}", (x, y, 0.0)) for k, (x, y) in enumerate(POLES)),
    np.column_stack([np.linspace(-40, 120, 81), np.zeros(81)]),
)


def drawn(body_x: float, lasting_m: float = 0.0) -> tuple[list[Instance], list[float]]:
    """Masks of the poles ahead of a body at (body_x, 0) that looks along x, and their distances.

    ``lasting_m``: by so much every other pole is always taken too far off, the others too near.
    """
    instances, distances = [], []
    for k, (x, y) in enumerate(POLES):
        depth = x - body_x
        if not 8.0 < depth < 45.0:
            continue
        u, half = 320 - 500 * y / depth, max(1, round(500 * 0.1 / depth))
        top, foot = 240 - 500 * 5.0 / depth, 240 + 500 * 2.0 / depth
        full = np.zeros((480, 640), bool)
        full[max(0, round(top)) : round(foot), round(u) - half : round(u) + half] = True
        instances.append(instance_from_mask(full, 0.97))
        distances.append(float(np.hypot(depth, y)) + lasting_m * (-1) ** k)
    return instances, distances


class Exact:
    """Knows the distances of the frame that is being stepped."""

    distances: Sequence[float] = ()
    variance_m2 = 0.09

    def for_frame(self, stamp_ns: int) -> Exact:
        return self

    def predict(self, instances: Sequence[Instance], width_px: int, height_px: int) -> list[Distance | None]:
        return [Distance(mean, self.variance_m2, 0.04, "far") for mean in self.distances]


def drive(
    settings: Settings,
    count: int = 40,
    gps: bool = True,
    road: RoadMap | None = ROAD,
    lasting_m: float = 0.0,
) -> list[Step]:
    model, steps = Exact(), []
    model.variance_m2 = 0.09 + lasting_m**2
    pipeline = Pipeline(settings, lambda frame: frame.recorded, model, CAMERA, road)
    for k in range(count):
        pose = np.eye(4)
        pose[0, 3] = 0.6 * k
        instances, model.distances = drawn(0.6 * k, lasting_m)
        rng = np.random.default_rng([settings.seed, k])
        fix = pose[:2, 3] + rng.normal(0, 3.0, 2) if gps else None
        frame = Frame(
            k, k * 77_000_000, b"", "jpeg", None, 0.077 if k else 0.0, pose, fix, 9.0, tuple(instances)
        )
        if not k:
            pipeline.start(np.array([0.0, 0.0, 7.8, 0.0]))
        steps.append(pipeline.step(frame))
    return steps


def mean_error(steps: Sequence[Step]) -> float:
    return float(np.mean([s.errors.position_m for s in steps if s.errors]))


def test_landmarks_are_matched_rightly_and_beat_the_plain_filter() -> None:
    steps = drive(Settings())
    matched = [
        (m.landmark_id, true) for s in steps for m, true in zip(s.matches, s.true_landmark_ids, strict=True)
    ]
    assert sum(1 for found, _ in matched if found) > 0.8 * len(matched)
    assert all(found in ("", true) for found, true in matched)
    plain = float(np.mean([s.baseline_errors.position_m for s in steps if s.baseline_errors]))
    assert mean_error(steps) < 0.6 < plain


def test_it_runs_on_without_gps() -> None:
    assert mean_error(drive(Settings(), gps=False)) < 0.7


def test_the_default_preset_has_a_heading_and_stands_errors_that_last() -> None:
    paper, best = (drive(PRESETS[name], lasting_m=1.0) for name in ("paper", "default"))
    assert mean_error(best) < 0.8 * mean_error(paper)
    assert best[-1].belief.mean.shape == (6,)
    assert abs(best[-1].belief.mean[4]) < 0.1  # it drives along x
    assert {s.belief.state for s in best} == {"tracking"}
    assert mean_error(drive(PRESETS["default"], gps=False)) < 0.5
    again = drive(PRESETS["default"], 8, lasting_m=1.0)
    np.testing.assert_array_equal(again[-1].belief.states, best[7].belief.states)
    for road in (None, RoadMap((), ROAD.centre_line_m)):
        bare = drive(PRESETS["default"], 5, road=road)
        assert {s.belief.state for s in bare} == {"unconstrained"}


def test_the_kalman_filter_takes_the_particles_place() -> None:
    steps = drive(PRESETS["ekf"])
    assert mean_error(steps) < 0.5
    assert {s.belief.state for s in steps} == {"tracking"}
    belief = steps[-1].belief
    np.testing.assert_allclose(belief.states.mean(0), belief.mean, atol=0.1)
    drawn = np.cov(belief.states[:, :2].T)
    np.testing.assert_allclose(np.sqrt(np.diag(drawn)), np.sqrt(np.diag(belief.covariance)[:2]), rtol=0.2)
    assert mean_error(drive(PRESETS["ekf"], gps=False)) < 0.5
    assert {s.belief.state for s in drive(PRESETS["ekf"], count=5, road=None)} == {"unconstrained"}


def test_before_anything_says_where_it_is_it_only_looks() -> None:
    pipeline = Pipeline(Settings(), lambda frame: frame.recorded, model := Exact(), CAMERA, ROAD)
    pose = np.eye(4)
    instances, model.distances = drawn(0.0, 0.0)
    model.variance_m2 = 0.09
    frame = Frame(0, 0, b"", "jpeg", None, 0.0, None, None, 9.0, tuple(instances))
    step = pipeline.step(frame)
    assert (step.belief, step.baseline, step.surface, step.errors) == (None,) * 4
    assert step.state == "initialising"
    assert len(step.observations) == len(step.matches) == len(instances) > 0
    assert not any(match.landmark_id for match in step.matches)
    pipeline.start(np.array([0.0, 0.0, 7.8, 0.0]))
    located = pipeline.step(replace(frame, T_map_body=pose, dt_s=9.0))
    # The start is where the vehicle is now: the interval since the frame before moves nothing.
    assert located.belief is not None and located.errors is not None
    assert located.errors.position_m < 3.0


def test_without_a_map_it_is_the_plain_filter() -> None:
    bare = drive(replace(Settings(), q_m2ps3=4.0, constraints=ConstraintSettings(speed=False)), road=None)
    assert all(not m.landmark_id for s in bare for m in s.matches)
    assert {s.belief.state for s in bare} == {"unconstrained"}
    assert mean_error(bare) > 0.7


def test_the_surface_holds_the_constraints_values_about_the_estimate() -> None:
    settings = replace(Settings(), surface=SurfaceSettings(21, 1.0))
    step = drive(settings, count=6)[-1]
    surface = step.surface
    assert surface.violation.shape == (21, 21)
    at = np.array([surface.corner_m[0] + 3.0, surface.corner_m[1] + 7.0, *step.belief.mean[2:]])[None]
    constraints = [SpeedConstraint()] + [
        LandmarkConstraint(
            m.landmark_id, np.array(ROAD.landmark(m.landmark_id).position_m[:2]), o.distance.mean_m, 0.09
        )
        for m, o in zip(step.matches, step.observations, strict=True)
        if m.landmark_id
    ]
    beyond_the_road = max(abs(at[0, 1]) - 4.0, 0.0)
    expected = total_violation(constraints, at)[0] + beyond_the_road
    assert surface.violation[7, 3] == pytest.approx(expected, abs=1e-6)
    middle = np.abs(surface.corner_m + 10.0 - step.belief.mean[:2])
    assert (middle <= 0.5 + 1e-9).all()


def test_errors_are_split_along_and_to_the_left() -> None:
    step = drive(Settings(), count=3)[-1]
    assert step.errors is not None
    off = step.belief.mean[:2] - np.array([1.2, 0.0])
    assert (step.errors.longitudinal_m, step.errors.lateral_m) == pytest.approx(tuple(off))
    assert step.errors.position_m == pytest.approx(np.hypot(*off))


def test_the_foot_is_the_middle_of_the_lowest_rows() -> None:
    full = np.zeros((100, 100), bool)
    full[10:90, 40:44] = True  # the pole
    full[10:14, 20:44] = True  # its arm
    assert foot_px(instance_from_mask(full)) == (41.5, 89.0)


def test_the_same_seed_gives_the_same_steps() -> None:
    one, same, other = (drive(replace(Settings(), seed=seed), count=8) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one[-1].belief.states, same[-1].belief.states)
    assert not np.array_equal(one[-1].belief.states, other[-1].belief.states)


def broken(*given: object) -> NoReturn:
    raise ZeroDivisionError("nothing to divide by")


@pytest.mark.parametrize(
    ("stage", "kind"),
    [
        ("_observe", "distance that failed"),
        ("_constrain", "matching that failed"),
        ("_surface", "constraint surface that failed"),
    ],
)
def test_a_stage_that_fails_on_a_frame_is_told_and_the_replay_goes_on(
    monkeypatch: pytest.MonkeyPatch, stage: str, kind: str
) -> None:
    whole, count = getattr(Pipeline, stage), 0

    def fails_once(self: Pipeline, *given: object) -> object:
        nonlocal count
        count += 1
        return broken() if count == 4 else whole(self, *given)

    monkeypatch.setattr(Pipeline, stage, fails_once)
    steps = drive(Settings(), count=8)
    told = [step.frame.problems for step in steps]
    assert told[3] == ((kind, "ZeroDivisionError: nothing to divide by"),)
    assert not any(told[:3] + told[4:])
    assert all(len(step.matches) == len(step.observations) for step in steps)
    assert steps[3].state == ("tracking" if stage == "_surface" else "unconstrained")
    assert steps[-1].state == "tracking"


def test_a_filter_that_fails_on_the_constraints_goes_on_without(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = ParticleFilter.update

    def fails_on_landmarks(
        self: ParticleFilter, constraints: Sequence[Constraint], fix: PositionFix
    ) -> Belief:
        return broken() if len(constraints) > 3 else whole(self, constraints, fix)

    monkeypatch.setattr(ParticleFilter, "update", fails_on_landmarks)
    steps = drive(Settings(), count=8)
    failed = [step for step in steps if step.frame.problems]
    assert failed and all(step.frame.problems[0][0] == "filter that failed" for step in failed)
    assert {step.state for step in failed} == {"unconstrained"}
