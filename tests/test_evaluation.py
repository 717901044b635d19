"""The protocol, the figures and the command: what they promise, on short drives."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scpf.models.association import NearestNeighbour
from scpf.models.batch_matching import nearest_landmarks
from scpf.models.errors import UsageError
from scpf.models.instances import Instance
from scpf.models.observation import Distance, Observation
from scpf.replay.cli import run
from scpf.replay.evaluation import evaluate, pooled
from scpf.replay.evaluation_metrics import diverged, measure
from scpf.replay.evaluation_plan import Plan
from scpf.replay.protocol import CASES, make_scenario
from scpf.replay.protocol_drive import make_ring

SHORT = Plan(
    presets=("paper", "ekf", "default"), cases=("S1",), sigmas_m=(3.0,), runs=3, drives=1, frames=200
)


@pytest.mark.parametrize("name", CASES)
def test_the_scenario_is_the_protocol_s(name: str) -> None:
    case = CASES[name]
    scenario = make_scenario(case, 0)
    drive, marks = scenario.drive, scenario.road_map.positions_m
    assert len(drive.positions_m) == len(scenario.detections) == 4000
    assert len(marks) == case.poles
    travelled = np.hypot(*np.diff(drive.positions_m, axis=0).T).sum()
    assert travelled == pytest.approx(1200.0, rel=0.02)
    speed = np.hypot(*drive.velocities_mps.T)
    assert speed.max() < 12.0
    assert np.count_nonzero(np.diff((speed < 0.5).astype(int)) == 1) >= 3
    errors: dict[bool, list[float]] = {True: [], False: []}
    for position, frame in zip(drive.positions_m, scenario.detections, strict=True):
        assert len(frame) <= 3
        assert len({seen.landmark for seen in frame}) == len(frame)
        for seen in frame:
            error = seen.distance_m - np.hypot(*(marks[seen.landmark] - position))
            errors[seen.variance_m2 < (case.mean_absolute_error_m[1] * 1.2) ** 2].append(error)
    close, far = (np.abs(errors[key]).mean() for key in (True, False))
    if case.map_error_m[1] == 0.0:
        assert close == pytest.approx(case.mean_absolute_error_m[0], rel=0.15)
        assert far == pytest.approx(case.mean_absolute_error_m[1], rel=0.15)
    else:
        assert far > 1.2 * case.mean_absolute_error_m[1]


def test_a_scenario_follows_from_its_seed_and_the_ring_closes() -> None:
    one, again, other = (make_scenario(CASES["S2"], seed, 300) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.drive.positions_m, again.drive.positions_m)
    assert one.detections == again.detections
    assert one.detections != other.detections
    assert make_scenario(CASES["S2"], 1, 200).detections == one.detections[:200]
    ring = make_ring()
    gaps = np.hypot(*(np.roll(ring.line_m, -1, axis=0) - ring.line_m).T)
    np.testing.assert_allclose(gaps, ring.spacing_m, rtol=0.01)
    assert ring.direction_rad[-1] - ring.direction_rad[0] == pytest.approx(2 * np.pi, abs=0.02)


def test_results_follow_from_the_plan_alone() -> None:
    results = evaluate(SHORT)
    assert results == evaluate(SHORT, jobs=2, backend="threading")
    assert results != evaluate(Plan(**{**SHORT.__dict__, "seed": 1}))
    assert [result.preset for result in results] == ["paper", "ekf", "default"]
    for row in pooled(results):
        assert 0.0 < row["median_m"] < row["p95_m"] < row["max_m"] < 15.0
        assert row["diverged_runs"] == 0


def test_known_matching_and_the_pf_run_too() -> None:
    plan = Plan(("pf", "default", "paper"), ("P",), (3.0,), 2, 1, 200, known_matching=True)
    pf, default, paper = (result.metrics.mean_m for result in evaluate(plan))
    assert default < paper < pf < 3.0


def test_metrics_of_errors_that_are_known() -> None:
    rng = np.random.default_rng(0)
    truth = np.cumsum(rng.normal(0, 1, (2000, 2)), axis=0)
    heading = rng.uniform(-3, 3, 2000)
    left = np.column_stack([-np.sin(heading), np.cos(heading)])
    poles = rng.integers(0, 5, 2000)
    beside = np.repeat((truth + 0.5 * left)[None], 3, axis=0)
    unit = np.tile([1.0, 0.0, 1.0], (3, 2000, 1))
    figures = measure(beside, unit, truth, heading, 3.0, poles)
    assert figures.mean_m == pytest.approx(0.5)
    assert figures.lateral_m == pytest.approx(0.5)
    assert figures.longitudinal_m == pytest.approx(0.0, abs=1e-9)
    noisy = truth + rng.normal(0, 1, (3, 2000, 2))
    figures = measure(noisy, unit, truth, heading, 3.0, poles)
    assert figures.nees == pytest.approx(2.0, abs=0.1)
    assert figures.inside_95 == pytest.approx(0.95, abs=0.01)
    assert figures.rmse_m == pytest.approx(np.sqrt(2.0), rel=0.03)
    assert figures.nees_low < 2.0 < figures.nees_high
    # A sum of 3 chi-squares of 2 degrees is one of 6, whose 95 % lie in 1.237 … 14.449 in any table.
    assert (figures.nees_low, figures.nees_high) == pytest.approx((1.2373 / 3, 14.4494 / 3), rel=1e-4)
    assert figures.diverged_share == 0.0


def test_errors_are_told_apart_by_poles_in_sight() -> None:
    truth, heading = np.zeros((600, 2)), np.zeros(600)
    poles = np.repeat([0, 1, 3, 5], 150)
    off = np.repeat([4.0, 2.0, 1.0, 0.5], 150)
    positions = np.repeat(np.column_stack([off, np.zeros(600)])[None], 2, axis=0)
    figures = measure(positions, np.ones((2, 600, 3)) * [1, 0, 1], truth, heading, 3.0, poles)
    assert (figures.poles_0_m, figures.poles_1_m, figures.poles_2_m) == (4.0, 2.0, None)
    assert figures.poles_3_m == pytest.approx(0.75)
    far = positions + np.array([[[100.0, 0.0]], [[0.0, 0.0]]])
    assert measure(far, np.ones((2, 600, 3)) * [1, 0, 1], truth, heading, 3.0, poles).diverged_share == 0.5


def test_a_run_diverges_where_it_is_lost_for_half_a_minute() -> None:
    errors = np.full((4, 1000), 0.5)
    errors[1, 300:400] = 9.0
    errors[2, 300:800] = 9.0
    errors[3] = 11.0
    assert diverged(errors, 3.0).tolist() == [False, False, True, True]
    assert diverged(errors, 10.0).tolist() == [False] * 4


def test_batched_matching_is_nearest_neighbour_matching() -> None:
    scenario = make_scenario(CASES["S1"], 0, 400)
    matching, rng = NearestNeighbour(), np.random.default_rng(0)
    marks = tuple(replace(mark, variance_m2=rng.uniform(0, 1)) for mark in scenario.road_map.landmarks)
    road_map = replace(scenario.road_map, landmarks=marks)
    own = np.array([mark.variance_m2 for mark in marks])
    found = 0
    for k in range(0, 400, 10):
        frame = scenario.detections[k]
        poses = scenario.drive.positions_m[k] + rng.normal(0, 2, (5, 2))
        spread = np.array([[1.0, 0.3, 2.0]] * 5) * rng.uniform(0.1, 3, (5, 1))
        yaws = scenario.drive.headings_rad[k] + rng.normal(0, 0.03, 5)
        if not frame:
            continue
        rows = np.array([(d.distance_m, d.variance_m2, d.bearing_rad) for d in frame])
        batched = nearest_landmarks(matching, road_map.positions_m, poses, spread, yaws, rows, own)
        observations = [
            Observation(
                Instance((0, 0, 4, 40), np.ones((40, 4), bool), (0, 0), 0.9, "light_pole"),
                Distance(d.distance_m, d.variance_m2, 0.1, "far"),
                d.bearing_rad,
            )
            for d in frame
        ]
        for r in range(5):
            xx, xy, yy = spread[r]
            covariance = np.array([[xx, xy], [xy, yy]])
            one = matching.match(observations, road_map, poses[r], covariance, yaws[r])
            names = ["" if index < 0 else f"P{index}" for index in batched[:, r]]
            assert names == [match.landmark_id for match in one]
            found += sum(name != "" for name in names)
    assert found > 20


@pytest.mark.parametrize(
    "changes", [{"presets": ("best",)}, {"cases": ("X",)}, {"sigmas_m": (0.0,)}, {"runs": 0}, {"frames": 3}]
)
def test_a_plan_that_cannot_be_is_refused(changes: dict[str, object]) -> None:
    with pytest.raises(UsageError):
        evaluate(Plan(**{**SHORT.__dict__, **changes}))


def test_the_command_prints_a_table_and_writes_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    figures, rows = tmp_path / "figures.json", tmp_path / "rows.csv"
    tokens = ["evaluate", "--presets", "default", "--presets", "pf", "--cases", "S2", "--sigma", "3"]
    tokens += ["--runs", "2", "--drives", "2", "--frames", "120"]
    assert run([*tokens, "--json", str(figures), "--csv", str(rows)]) == 0
    table = capsys.readouterr().out.splitlines()
    assert table[0].split()[:2] == ["preset", "case"]
    assert [line.split()[0] for line in table[1:3]] == ["default", "pf"]
    document = json.loads(figures.read_text())
    assert document["plan"]["frames"] == 120
    assert document["presets"]["default"]["motion"] == "constant-turn-rate"
    assert [row["runs"] for row in document["pooled"]] == [4, 4]
    lines = list(csv.DictReader(io.StringIO(rows.read_text())))
    assert [line["drive"] for line in lines] == ["0", "1", "0", "1"]
    assert float(lines[0]["mean_m"]) == document["drives"][0]["mean_m"]
    assert run([*tokens, "--json", str(figures)]) == 2
    assert "exists" in capsys.readouterr().err
    assert run([*tokens, "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out) == document
