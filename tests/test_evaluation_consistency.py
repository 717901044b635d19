"""The default preset tells how wrong it is: on exact maps and on maps that are off, without being told which."""

from __future__ import annotations

from dataclasses import replace

import pytest

from scpf.replay.evaluation_metrics import diverged, normalised_squared_errors, position_errors
from scpf.replay.evaluation_presets import PRESETS
from scpf.replay.evaluation_runs import run_estimator
from scpf.replay.protocol import CASES, make_scenario


@pytest.mark.parametrize(("case", "honest"), [("S0", True), ("S2", True), ("S2", False)])
def test_the_covariance_answers_for_errors_that_last(case: str, honest: bool) -> None:
    settings = PRESETS["default"]
    if not honest:
        settings = replace(settings, consider=None)
    scenario = make_scenario(CASES[case], 0, 1200)
    estimates = run_estimator(settings, scenario, 10.0, range(4), False)
    truth_m = scenario.drive.positions_m
    assert not diverged(position_errors(estimates.positions_m, truth_m), 10.0).any()
    squared = normalised_squared_errors(estimates.positions_m, estimates.covariances_m2, truth_m)[:, 100:]
    if honest:
        assert 0.8 < squared.mean() < 3.0
        assert (squared < 6.0).mean() > 0.85  # 0.95 where errors are Gaussian
    else:
        assert squared.mean() > 5.0
