"""What a survey is worth: S2's map, 1-2 m off, surveyed on one drive and used on the next.

    python tests/benchmarks/survey_accuracy.py [runs] [first drive] [drives] [preset]

Run by hand: half a minute for 10 runs of one drive. Prints errors of the map before and after, then mean position
errors (m) of the next drive past the same poles: on the old map (S2), the surveyed one, and the true one (S1).
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from scpf.models.survey import Survey
from scpf.replay.evaluation_metrics import position_errors
from scpf.replay.evaluation_presets import PRESETS
from scpf.replay.evaluation_runs import run_estimator
from scpf.replay.protocol import CASES, make_scenario
from scpf.replay.survey_protocol import drive_again, survey_drive, true_positions_m

SIGMAS_M = (3.0, 10.0)
CASE = CASES["S2"]


def map_errors(seed: int, found: Survey) -> None:
    """Print how far the poles of one drive are off, before and after."""
    truth = true_positions_m(CASE, seed)
    old = make_scenario(CASE, seed, 2).road_map.positions_m
    done = np.array([not row.reason for row in found.landmarks])
    seen = np.array([row.sightings > 0 for row in found.landmarks])
    before, after = (np.hypot(*(each - truth).T)[done] for each in (old, found.road_map.positions_m))
    variances = np.array([mark.variance_m2 for mark in found.road_map.landmarks])[done]
    print(
        f"drive {seed}: {done.sum()} of {seen.sum()} poles in sight surveyed; map error mean {before.mean():.2f} -> "
        f"{after.mean():.2f} m, 95 % {np.percentile(before, 95):.2f} -> {np.percentile(after, 95):.2f}, "
        f"max {before.max():.2f} -> {after.max():.2f}, below 0.4 m {100 * np.mean(after < 0.4):.0f} %; "
        f"NEES {np.mean(after**2 / variances):.1f}"
    )


def main(runs: int = 10, first: int = 0, drives: int = 1, preset: str = "default") -> None:
    figures: dict[tuple[str, float], list[float]] = {}
    for seed in range(first, first + drives):
        found = survey_drive(CASE, seed)
        map_errors(seed, found)
        exact = replace(CASE, map_error_m=(0.0, 0.0))
        scenarios = {
            "S2": drive_again(CASE, seed, None),
            "S2 surveyed": drive_again(CASE, seed, found),
            "S1": drive_again(exact, seed, None),
        }
        for name, scenario in scenarios.items():
            for sigma_m in SIGMAS_M:
                seeds = range(1000 * seed, 1000 * seed + runs)
                estimates = run_estimator(PRESETS[preset], scenario, sigma_m, seeds, known_matching=False)
                errors = position_errors(estimates.positions_m, scenario.drive.positions_m)
                figures.setdefault((name, sigma_m), []).append(float(errors.mean()))
    print(f"\nmean position error (m) of the next drive, {preset}, {drives} drives of {runs} runs")
    print("map          " + "".join(f"  σ_v {sigma_m:>4.0f} m" for sigma_m in SIGMAS_M))
    mean = {key: float(np.mean(values)) for key, values in figures.items()}
    for name in ("S2", "S2 surveyed", "S1"):
        print(f"{name:<13}" + "".join(f"{mean[name, sigma_m]:12.2f}" for sigma_m in SIGMAS_M))
    shares = (mean["S2 surveyed", sigma_m] / mean["S1", sigma_m] for sigma_m in SIGMAS_M)
    print("surveyed / S1" + "".join(f"{share:12.2f}" for share in shares))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:4]), *sys.argv[4:5])
