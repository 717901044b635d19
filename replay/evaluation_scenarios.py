"""The drives of an evaluation: simulated ones of the protocol, or recorded ones, under the plan's conditions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from scpf.models.errors import MissingError
from scpf.replay.evaluation_conditions import thinned
from scpf.replay.evaluation_plan import Plan
from scpf.replay.protocol import CASES, Scenario, make_scenario

Scenarios = dict[tuple[str, int], Scenario]
"""By the name of case or recording, and the number of the drive."""


def make_scenarios(plan: Plan) -> Scenarios:
    """Every drive of the plan, the same whatever the estimator and its GPS. Raises as ``read_scenario`` does."""
    plan.check()
    if not plan.recordings:
        return {
            (case, drive): simulated(plan, case, drive) for case in plan.cases for drive in range(plan.drives)
        }
    scenarios = (recorded(plan, Path(path)) for path in plan.recordings)
    return {(scenario.case.name, 0): scenario for scenario in scenarios}


def simulated(plan: Plan, case: str, drive: int) -> Scenario:
    """A drive of a case of the protocol."""
    seed = plan.seed + drive
    scenario = make_scenario(plan.conditions.applied_to(CASES[case]), seed, plan.frames)
    return _thinned(plan, scenario, seed)


def recorded(plan: Plan, path: Path) -> Scenario:
    """The drive of a results file. MissingError where matching is to be known and the file does not know it."""
    from scpf.replay.evaluation_recorded import read_scenario, with_map_error

    scenario = read_scenario(path, None if plan.map_path is None else Path(plan.map_path))
    seen = [one for frame in scenario.detections for one in frame]
    if plan.known_matching and all(one.landmark < 0 for one in seen):
        raise MissingError(
            f"{path} does not say which landmarks were seen", "evaluate with --matching unknown"
        )
    if plan.conditions.map_error_m is not None:
        rng = np.random.default_rng([plan.seed, 17])
        scenario = with_map_error(scenario, plan.conditions.map_error_m, rng)
    return _thinned(plan, scenario, plan.seed)


def _thinned(plan: Plan, scenario: Scenario, seed: int) -> Scenario:
    if plan.conditions.drop_out == 0.0:
        return scenario
    kept = thinned(scenario.detections, plan.conditions.drop_out, np.random.default_rng([seed, 13]))
    return replace(scenario, detections=kept)
