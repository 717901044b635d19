"""Evaluation on a replay's results: what is read, what is refused, and that the filters find the reference."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_steps import FIRST_STAMP_NS, PERIOD_NS, road_map, synthetic_steps

from scpf.ingest.maps import write_map
from scpf.models.errors import InputError, MissingError, UsageError
from scpf.models.road_map import RoadMap, to_geojson
from scpf.replay.cli import run
from scpf.replay.evaluation import evaluate
from scpf.replay.evaluation_conditions import Conditions
from scpf.replay.evaluation_plan import Plan
from scpf.replay.evaluation_recorded import read_scenario
from scpf.replay.evaluation_scenarios import make_scenarios
from scpf.replay.results import Results
from scpf.replay.step import Step

FRAMES = 200
BLIND = 100


@pytest.fixture(scope="module")
def steps() -> list[Step]:
    """Steps along the bend; one has no reference."""
    made = synthetic_steps(FRAMES, blind=frozenset({BLIND}), particles=10, cells=3)
    made[7] = replace(
        made[7], frame=replace(made[7].frame, T_map_body=None), errors=None, baseline_errors=None
    )
    return made


def write(path: Path, steps: list[Step], known: RoadMap | None = None) -> Path:
    with Results(path, {}, None if known is None else to_geojson(known)) as results:
        for step in steps:
            results.log(step)
    return path


@pytest.fixture(scope="module")
def bend(steps: list[Step], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("recorded") / "bend.results.mcap", steps, road_map())


def test_truth_detections_and_map_are_those_of_the_file(bend: Path, steps: list[Step]) -> None:
    scenario = read_scenario(bend)
    kept = [step for step in steps if step.frame.T_map_body is not None]
    assert (scenario.case.name, scenario.left_out, scenario.start_ns) == ("bend", 1, FIRST_STAMP_NS)
    assert len(scenario.times_s) == len(scenario.detections) == FRAMES - 1
    assert scenario.times_s[7] == pytest.approx(8 * PERIOD_NS * 1e-9)
    for step, position, heading in zip(
        kept, scenario.drive.positions_m + scenario.middle_m, scenario.drive.headings_rad, strict=True
    ):
        pose = step.frame.T_map_body
        assert pose is not None
        np.testing.assert_allclose(position, pose[:2, 3], atol=1e-6)
        assert np.cos(heading) == pytest.approx(pose[0, 0])
    np.testing.assert_allclose(np.hypot(*scenario.drive.velocities_mps.T), 10.0, rtol=0.01)
    marks = scenario.road_map.positions_m + scenario.middle_m
    np.testing.assert_allclose(marks, road_map().positions_m, atol=1e-4)
    for step, frame in zip(kept, scenario.detections, strict=True):
        near = [one for one in step.observations if one.distance.in_range]
        assert [seen.distance_m for seen in frame] == [one.distance.mean_m for one in near]
        assert [seen.variance_m2 for seen in frame] == [one.distance.variance_m2 + 0.01 for one in near]
        names = [f"P{seen.landmark + 11}" for seen in frame]
        assert names == [one.instance.landmark_id for one in near]
    assert any(len(frame) >= 2 for frame in scenario.detections)


def test_the_road_runs_as_the_drive_does(bend: Path, steps: list[Step], tmp_path: Path) -> None:
    backwards = replace(road_map(), centre_line_m=road_map().centre_line_m[::-1].copy())
    turned = read_scenario(write(tmp_path / "turned.results.mcap", steps, backwards))
    for scenario in (read_scenario(bend), turned):
        off = scenario.ring.line_m[None] - scenario.drive.positions_m[:, None]
        nearest = np.argmin((off**2).sum(2), axis=1)
        angle = scenario.ring.direction_rad[nearest] - scenario.drive.headings_rad
        assert np.cos(angle).min() > 0.99


def test_the_filters_find_the_reference(bend: Path) -> None:
    plan = Plan(("default", "ekf", "pf"), (), (3.0,), runs=6, recordings=(str(bend),))
    default, ekf, pf = evaluate(plan)
    assert (default.case, default.metrics.frames, default.metrics.runs) == ("bend", FRAMES - 1, 6)
    assert default.metrics.mean_m < 0.6 and ekf.metrics.mean_m < 0.8
    assert default.metrics.mean_m < 0.6 * pf.metrics.mean_m
    known = evaluate(replace(plan, known_matching=True, presets=("paper",)))[0]
    assert known.metrics.mean_m < pf.metrics.mean_m
    moved = replace(plan, presets=("ekf",), conditions=Conditions(map_error_m=(2.0, 2.0)))
    assert evaluate(moved)[0].metrics.mean_m > 1.3 * ekf.metrics.mean_m


def test_map_errors_and_drop_outs_apply_to_recordings(bend: Path) -> None:
    conditions = Conditions(map_error_m=(0.4, 0.5), drop_out=0.5)
    plan = Plan(cases=(), recordings=(str(bend),), conditions=conditions)
    (changed,) = make_scenarios(plan).values()
    (own,) = make_scenarios(replace(plan, conditions=Conditions())).values()
    off = np.hypot(*(changed.road_map.positions_m - own.road_map.positions_m).T)
    assert off.min() >= 0.4 and off.max() <= 0.5
    share = sum(map(len, changed.detections)) / sum(map(len, own.detections))
    assert share == pytest.approx(0.5, abs=0.1)


def test_what_cannot_be_evaluated_is_refused(bend: Path, steps: list[Step], tmp_path: Path) -> None:
    bare = write(tmp_path / "bare.results.mcap", steps)
    with pytest.raises(MissingError, match="no map"):
        read_scenario(bare)
    given = tmp_path / "map.geojson"
    write_map(given, road_map())
    assert len(read_scenario(bare, given).road_map.landmarks) == len(road_map().landmarks)
    with pytest.raises(MissingError, match="no centre line"):
        no_line = replace(road_map(), centre_line_m=np.zeros((0, 2)))
        read_scenario(write(tmp_path / "line.results.mcap", steps[:60], no_line))
    with pytest.raises(InputError, match="too few"):
        read_scenario(write(tmp_path / "short.results.mcap", steps[:20], road_map()))
    there_and_back = [*steps[:60], *(turned(step, 60 + k) for k, step in enumerate(steps[59::-1]))]
    with pytest.raises(InputError, match="turns round"):
        read_scenario(write(tmp_path / "back.results.mcap", there_and_back, road_map()))
    unknown = [replace(step, true_landmark_ids=("",) * len(step.observations)) for step in steps]
    nameless = write(tmp_path / "nameless.results.mcap", unknown, road_map())
    plan = Plan(cases=(), recordings=(str(nameless),), known_matching=True)
    with pytest.raises(MissingError, match="which landmarks"):
        make_scenarios(plan)
    for wrong in (
        replace(plan, conditions=Conditions(correlated=True)),
        replace(plan, recordings=(str(bend), str(bend))),
        Plan(map_path=str(given)),
    ):
        with pytest.raises(UsageError):
            make_scenarios(wrong)


def turned(step: Step, index: int) -> Step:
    """The step on the way back."""
    pose = step.frame.T_map_body
    if pose is not None:
        pose = pose @ np.diag([-1.0, -1.0, 1.0, 1.0])
    stamp_ns = FIRST_STAMP_NS + index * PERIOD_NS
    return replace(step, frame=replace(step.frame, index=index, stamp_ns=stamp_ns, T_map_body=pose))


def test_the_command_reads_recordings(bend: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tokens = ["evaluate", str(bend), "--presets", "ekf", "--sigma", "3", "--runs", "2"]
    assert run(tokens) == 3
    said = capsys.readouterr()
    assert said.out.splitlines()[1].split()[:2] == ["ekf", "bend"]
    assert "1 recorded drives, 2 runs each" in said.out
    assert "1 frames without a reference pose left out" in said.err
    assert run([*tokens, "--format", "json"]) == 3
    assert json.loads(capsys.readouterr().out)["plan"]["cases"] == []
