"""Monte Carlo evaluation: presets × cases × GPS noise × drives, in parallel, always the same for a seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Final

import numpy as np

from scpf.models.errors import UsageError
from scpf.replay.evaluation_conditions import Conditions, thinned
from scpf.replay.evaluation_metrics import Metrics, measure
from scpf.replay.evaluation_presets import PRESETS, Estimator
from scpf.replay.protocol import CASES, FRAMES, Scenario, make_scenario

SIGMAS_M: Final = (1.0, 3.0, 5.0, 10.0, 15.0, 20.0)
FEWEST_FRAMES: Final = 50


@dataclass(frozen=True)
class Plan:
    """What to evaluate. ``runs`` Monte Carlo runs are made on each of ``drives`` drives."""

    presets: tuple[str, ...] = ("paper", "pf", "ekf", "default")
    cases: tuple[str, ...] = ("P", "S0", "S1", "S2")
    sigmas_m: tuple[float, ...] = (3.0, 10.0)
    runs: int = 50
    drives: int = 2
    frames: int = FRAMES
    known_matching: bool = False
    seed: int = 0
    conditions: Conditions = field(default_factory=Conditions)

    def check(self) -> None:
        """UsageError where the plan cannot be carried out."""
        for chosen, known, what in ((self.presets, PRESETS, "preset"), (self.cases, CASES, "case")):
            for name in chosen:
                if name not in known:
                    raise UsageError(f"no {what} {name!r} to evaluate", f"{what}s: {', '.join(known)}")
        if not self.presets or not self.cases or not self.sigmas_m:
            raise UsageError("nothing to evaluate", "name at least one preset, case and GPS deviation")
        if min(self.sigmas_m) <= 0.0 or self.runs < 1 or self.drives < 1 or self.seed < 0:
            raise UsageError("--sigma, --runs and --drives are positive, --seed is not negative")
        if not FEWEST_FRAMES <= self.frames <= FRAMES:
            raise UsageError(f"--frames lies between {FEWEST_FRAMES} and {FRAMES}")
        self.conditions.check()


@dataclass(frozen=True)
class Result:
    """The figures of one preset on one drive of one case at one GPS deviation."""

    preset: str
    case: str
    sigma_m: float
    drive: int
    metrics: Metrics

    def as_row(self) -> dict[str, Any]:
        """The result as a flat row."""
        row: dict[str, Any] = {key: value for key, value in asdict(self).items() if key != "metrics"}
        return {**row, **asdict(self.metrics)}


def evaluate(plan: Plan, jobs: int = 1, backend: str = "loky") -> list[Result]:
    """Carry out the plan on ``jobs`` workers of a joblib ``backend``; results in the plan's order.

    Every number follows from the plan: neither jobs nor backend change one.
    """
    from joblib import Parallel, delayed, parallel_config

    plan.check()
    tasks = [
        (PRESETS[preset], case, sigma_m, drive)
        for preset in plan.presets
        for case in plan.cases
        for sigma_m in plan.sigmas_m
        for drive in range(plan.drives)
    ]
    if jobs == 1:
        return [evaluate_one(plan, *task) for task in tasks]
    with parallel_config(backend=backend, n_jobs=jobs):
        results: list[Result] = Parallel()(delayed(evaluate_one)(plan, *task) for task in tasks)
    return results


def evaluate_one(plan: Plan, settings: Estimator, case: str, sigma_m: float, drive: int) -> Result:
    """All runs of one cell of the plan."""
    from scpf.replay.evaluation_runs import run_estimator

    scenario = scenario_of(plan, case, drive)
    seeds = range(plan.seed + 1000 * drive, plan.seed + 1000 * drive + plan.runs)
    fixed = plan.conditions.fixed(scenario.times_s)
    estimates = run_estimator(settings, scenario, sigma_m, seeds, plan.known_matching, fixed)
    truth = scenario.drive
    # Without GPS there is no raw fix that a lost run could be as good as.
    allowed_m = sigma_m if plan.conditions.gps_after_start else 0.0
    poles = np.array([len(frame) for frame in scenario.detections])
    figures = (estimates.positions_m, estimates.covariances_m2, truth.positions_m, truth.headings_rad)
    metrics = measure(*figures, allowed_m, poles)
    return Result(settings.name, case, sigma_m, drive, metrics)


def scenario_of(plan: Plan, case: str, drive: int) -> Scenario:
    """A drive of a case, under the plan's conditions; the same whatever the estimator and its GPS."""
    conditions, seed = plan.conditions, plan.seed + drive
    scenario = make_scenario(conditions.applied_to(CASES[case]), seed, plan.frames)
    if conditions.drop_out > 0.0:
        kept = thinned(scenario.detections, conditions.drop_out, np.random.default_rng([seed, 13]))
        scenario = replace(scenario, detections=kept)
    return scenario


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
