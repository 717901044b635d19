"""Conditions of an evaluation: what outages, lost detections and other errors change, and what they leave."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from scpf.models.errors import UsageError
from scpf.replay.cli import run
from scpf.replay.evaluation import evaluate
from scpf.replay.evaluation_conditions import Conditions
from scpf.replay.evaluation_plan import Plan
from scpf.replay.evaluation_presets import PRESETS
from scpf.replay.evaluation_runs import run_estimator
from scpf.replay.evaluation_scenarios import simulated
from scpf.replay.protocol import Scenario

PLAN = Plan(("pf", "ekf"), ("S0",), (3.0,), runs=3, drives=1, frames=260)


def under(conditions: Conditions, **changes: object) -> Plan:
    return replace(PLAN, conditions=conditions, **changes)  # type: ignore[arg-type]


def range_errors(scenario: Scenario) -> np.ndarray:
    marks = scenario.road_map.positions_m
    rows = zip(scenario.drive.positions_m, scenario.detections, strict=True)
    return np.array(
        [d.distance_m - np.hypot(*(marks[d.landmark] - at)) for at, frame in rows for d in frame if d]
    )


def test_outages_are_half_open_and_the_first_frame_keeps_its_fix() -> None:
    times = np.arange(6.0)
    assert Conditions(((1.0, 3.0), (4.0, 5.0))).fixed(times).tolist() == [
        True,
        False,
        False,
        True,
        False,
        True,
    ]
    assert Conditions(gps_after_start=False).fixed(times).tolist() == [True] + [False] * 5
    assert Conditions().fixed(times).all()


def test_the_filters_hear_nothing_in_an_outage() -> None:
    """Without landmarks the error and the spread grow in the outage, and fall when GPS is back."""
    scenario = simulated(under(Conditions(drop_out=1.0)), "S0", 0)
    fixed = Conditions(((5.0, 15.0),)).fixed(scenario.times_s)
    for name in ("pf", "ekf"):
        estimates = run_estimator(PRESETS[name], scenario, 3.0, range(8), True, fixed)
        heard = run_estimator(PRESETS[name], scenario, 3.0, range(8), True)
        np.testing.assert_array_equal(estimates.positions_m[:, :65], heard.positions_m[:, :65])
        errors = np.hypot(*(estimates.positions_m - scenario.drive.positions_m).transpose(2, 0, 1)).mean(0)
        assert errors[185:195].mean() > 3 * errors[40:65].mean()
        assert errors[230:].mean() < errors[185:195].mean() / 2
        spread = estimates.covariances_m2[..., 0].mean(0)
        assert spread[194] > 20 * spread[64]


def test_no_gps_is_survived_with_landmarks_and_lost_without() -> None:
    plan = under(Conditions(gps_after_start=False), presets=("pf", "default"), sigmas_m=(10.0,), frames=600)
    pf, default = (result.metrics for result in evaluate(plan))
    assert default.mean_m < 1.0 and default.diverged_runs == 0
    assert pf.mean_m > 10.0 and pf.diverged_runs == 3


def test_detections_are_lost_at_the_stated_rate_and_no_other_number_changes() -> None:
    whole = simulated(PLAN, "S0", 0)
    thin = simulated(under(Conditions(drop_out=0.4)), "S0", 0)
    assert all(set(few) <= set(all_) for few, all_ in zip(thin.detections, whole.detections, strict=True))
    count = sum(map(len, whole.detections))
    assert sum(map(len, thin.detections)) / count == pytest.approx(0.6, abs=0.06)
    none = simulated(under(Conditions(drop_out=1.0)), "S0", 0)
    assert sum(map(len, none.detections)) == 0


def test_map_and_range_errors_are_those_that_were_asked_for() -> None:
    plan = under(Conditions(map_error_m=(0.5, 0.6)), frames=2000)
    exact, off = simulated(replace(plan, conditions=Conditions()), "S0", 0), simulated(plan, "S0", 0)
    moved = np.hypot(*(off.road_map.positions_m - exact.road_map.positions_m).T)
    assert moved.min() >= 0.5 and moved.max() <= 0.6
    white = Conditions(range_error_m=(0.2, 0.2))
    errors = range_errors(simulated(replace(plan, conditions=white), "S0", 0))
    assert np.abs(errors).mean() == pytest.approx(0.2, rel=0.1)
    lasting = replace(white, correlated=True)
    for conditions, least, most in ((white, -0.15, 0.15), (lasting, 0.6, 1.0)):
        frames = simulated(replace(plan, conditions=conditions), "S0", 0)
        by_pole: dict[int, list[tuple[int, float]]] = {}
        marks = frames.road_map.positions_m
        for k, frame in enumerate(frames.detections):
            for seen in frame:
                true_m = np.hypot(*(marks[seen.landmark] - frames.drive.positions_m[k]))
                by_pole.setdefault(seen.landmark, []).append((k, seen.distance_m - true_m))
        in_turn = [(one, other) for rows in by_pole.values() for one, other in pairwise(rows)]
        pairs = np.array([(a, b) for (k, a), (n, b) in in_turn if n == k + 1])
        assert least < np.corrcoef(pairs.T)[0, 1] < most


@pytest.mark.parametrize(
    "conditions",
    [
        Conditions(((5.0, 5.0),)),
        Conditions(((-1.0, 5.0),)),
        Conditions(drop_out=1.5),
        Conditions(map_error_m=(2.0, 1.0)),
        Conditions(range_error_m=(0.0, 1.0)),
        Conditions(range_error_m=(float("nan"), 1.0)),
    ],
)
def test_conditions_that_cannot_be_are_refused(conditions: Conditions) -> None:
    with pytest.raises(UsageError):
        evaluate(under(conditions))


def test_the_command_takes_them_and_says_them(capsys: pytest.CaptureFixture[str]) -> None:
    tokens = ["evaluate", "--presets", "ekf", "--cases", "S0", "--sigma", "3", "--runs", "2", "--drives", "1"]
    tokens += ["--frames", "120", "--gps-outage", "2:4", "--gps-outage", "5:6", "--drop-out", "0.25"]
    tokens += ["--map-error", "0.5:1", "--range-error", "0.3:0.6", "--errors", "correlated"]
    assert run(tokens) == 0
    said = capsys.readouterr().out.splitlines()[-1]
    for part in ("from 2 to 4 s", "from 5 to 6 s", "25 %", "0.5–1 m", "0.3 m close", "last for a second"):
        assert part in said
    assert run([*tokens, "--no-gps"]) == 0
    assert "after the first frame" in capsys.readouterr().out
    assert run(["evaluate", "--gps-outage", "2-4"]) == 2
    assert "--gps-outage '2-4' is not two numbers" in capsys.readouterr().err


def test_a_first_speed_that_is_far_off_is_found_out_without_gps() -> None:
    scenario = simulated(PLAN, "S1", 0)
    fixed = np.arange(len(scenario.times_s)) == 0
    # This run's first velocity is off by 6 m/s, almost four of its deviations.
    ends_m = []
    for doubt in (PRESETS["default"].velocity_doubt, 1.0):
        settings = replace(PRESETS["default"], velocity_doubt=doubt)
        estimates = run_estimator(settings, scenario, 3.0, [10], False, fixed)
        ends_m.append(
            float(np.hypot(*(estimates.positions_m[0] - scenario.drive.positions_m).T)[-50:].mean())
        )
    assert ends_m[0] < 3.0 < 15.0 < ends_m[1]
