"""Monte Carlo evaluation: presets × cases × GPS noise × drives, in parallel, always the same for a seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from scpf.replay.evaluation_backends import LOCAL, workers
from scpf.replay.evaluation_metrics import Metrics, measure
from scpf.replay.evaluation_plan import Plan
from scpf.replay.evaluation_presets import PRESETS, Estimator
from scpf.replay.evaluation_runs import run_estimator
from scpf.replay.evaluation_scenarios import Scenarios, make_scenarios
from scpf.replay.evaluation_traces import Trace, trace_of
from scpf.replay.protocol import Scenario


@dataclass(frozen=True)
class Result:
    """The figures of one preset on one drive of one case at one GPS deviation, and how the runs went."""

    preset: str
    case: str
    sigma_m: float
    drive: int
    metrics: Metrics
    trace: Trace = field(compare=False, repr=False)

    def as_row(self) -> dict[str, Any]:
        """The figures as a flat row."""
        row = {"preset": self.preset, "case": self.case, "sigma_m": self.sigma_m, "drive": self.drive}
        return {**row, **asdict(self.metrics)}


def evaluate(
    plan: Plan,
    jobs: int = 1,
    backend: str = "loky",
    scenarios: Scenarios | None = None,
    scheduler: str | None = None,
) -> list[Result]:
    """Carry out the plan on ``jobs`` workers of a ``backend``; results in the plan's order.

    ``scenarios``: the plan's drives, where they have been made already. ``scheduler``: see ``workers``, whose errors
    are raised. Every number follows from the plan: neither jobs nor backend change one.
    """
    from joblib import Parallel, delayed

    plan.check()
    drives = make_scenarios(plan) if scenarios is None else scenarios
    names = list(dict.fromkeys(name for name, _ in drives))
    tasks = [
        (PRESETS[preset], name, sigma_m, drive, drives[name, drive])
        for preset in plan.presets
        for name in names
        for sigma_m in plan.sigmas_m
        for drive in sorted(number for other, number in drives if other == name)
    ]
    if jobs == 1 and backend in LOCAL and scheduler is None:
        return [evaluate_one(plan, *task) for task in tasks]
    with workers(backend, jobs, scheduler):
        results: list[Result] = Parallel()(delayed(evaluate_one)(plan, *task) for task in tasks)
    return results


def evaluate_one(
    plan: Plan, settings: Estimator, case: str, sigma_m: float, drive: int, scenario: Scenario
) -> Result:
    """All runs of one cell of the plan."""
    seeds = range(plan.seed + 1000 * drive, plan.seed + 1000 * drive + plan.runs)
    fixed = plan.conditions.fixed(scenario.times_s)
    estimates = run_estimator(settings, scenario, sigma_m, seeds, plan.known_matching, fixed)
    truth = scenario.drive
    # Without GPS there is no raw fix that a lost run could be as good as.
    allowed_m = sigma_m if plan.conditions.gps_after_start else 0.0
    poles = np.array([len(frame) for frame in scenario.detections])
    figures = (estimates.positions_m, estimates.covariances_m2, truth.positions_m, truth.headings_rad)
    metrics = measure(*figures, allowed_m, poles)
    return Result(settings.name, case, sigma_m, drive, metrics, trace_of(estimates, scenario))


def pooled(results: Sequence[Result]) -> list[dict[str, Any]]:
    """One row a preset, case and GPS deviation: means over its drives, sums of runs, worst of maxima."""
    groups: dict[tuple[str, str, float], list[Metrics]] = {}
    for result in results:
        groups.setdefault((result.preset, result.case, result.sigma_m), []).append(result.metrics)
    rows = []
    for (preset, case, sigma_m), members in groups.items():
        row: dict[str, Any] = {"preset": preset, "case": case, "sigma_m": sigma_m}
        for name in asdict(members[0]):
            values = [value for one in members if (value := getattr(one, name)) is not None]
            if not values:
                row[name] = None
            elif name in ("runs", "diverged_runs"):
                row[name] = sum(values)
            elif name in ("max_m", "frames"):
                row[name] = max(values)
            else:
                row[name] = sum(values) / len(values)
        rows.append(row)
    return rows
