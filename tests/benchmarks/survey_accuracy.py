"""What a survey is worth: S2's map, 1-2 m off, surveyed on one drive and used on the next.

    python tests/benchmarks/survey_accuracy.py [runs] [first drive] [drives] [preset]

Run by hand: half a minute for 10 runs of one drive. Prints errors of the map before and after, then mean position
errors (m) of the next drive past the same poles: on the old map (S2), the surveyed one, and the true one (S1).
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from scpf.models.survey import Survey, SurveySettings, survey
from scpf.models.survey_fit import FitSettings
from scpf.replay.evaluation_metrics import position_errors
from scpf.replay.evaluation_presets import PRESETS
from scpf.replay.evaluation_runs import run_estimator
from scpf.replay.protocol import BEARING_DEVIATION_RAD, CASES, CORRELATION_TIME_S, make_scenario
from scpf.replay.survey_protocol import drive_again, sights_of, survey_drive, true_positions_m

SIGMAS_M = (3.0, 10.0)
CASE = CASES["S2"]


def map_errors(what: str, seed: int, found: Survey) -> None:
    """Print how far the poles of one drive are off, before and after."""
    truth = true_positions_m(CASE, seed)
    old = make_scenario(CASE, seed, 2).road_map.positions_m
    done = np.array([not row.reason for row in found.landmarks])
    seen = np.array([row.sightings > 0 for row in found.landmarks])
    before, after = (np.hypot(*(each - truth).T)[done] for each in (old, found.road_map.positions_m))
    variances = np.array([mark.variance_m2 for mark in found.road_map.landmarks])[done]
    print(
        f"drive {seed}, {what}: {done.sum()} of {seen.sum()} poles in sight surveyed; map error mean "
        f"{before.mean():.2f} -> {after.mean():.2f} m, 95 % {np.percentile(before, 95):.2f} -> "
        f"{np.percentile(after, 95):.2f}, max {before.max():.2f} -> {after.max():.2f}, below 0.4 m "
        f"{100 * np.mean(after < 0.4):.0f} %; NEES {np.mean(after**2 / variances):.1f}"
    )


def harder(seed: int) -> None:
    """The same where the protocol is kind: its directions err anew in each frame, and its poses are exact."""
    scenario = make_scenario(CASE, seed)
    sights, rng = sights_of(scenario), np.random.default_rng([seed, 19])
    truth, which = (
        true_positions_m(CASE, seed),
        [one.landmark for frame in scenario.detections for one in frame],
    )
    ahead = truth[which] - sights.seen_from_m
    exact = np.arctan2(ahead[:, 1], ahead[:, 0])
    errors, last = np.empty(len(exact)), {}
    for n, (mark, now_s) in enumerate(zip(which, sights.times_s.tolist(), strict=True)):
        before, then_s = last.get(mark, (0.0, -np.inf))
        keep = np.exp((then_s - now_s) / CORRELATION_TIME_S)
        errors[n] = keep * before + np.sqrt(1 - keep**2) * rng.standard_normal()
        last[mark] = errors[n], now_s
    lasting = replace(sights, directions_rad=exact + BEARING_DEVIATION_RAD * errors)
    turned = replace(sights, directions_rad=sights.directions_rad + np.radians(0.3))
    blind = SurveySettings(fit=FitSettings(bearing_deviation_rad=np.radians(10.0)))
    for what, seen, settings in (
        ("directions that err for a second, too", lasting, None),
        ("a heading that is always 0.3 degrees off", turned, None),
        ("directions for matching alone", sights, blind),
    ):
        map_errors(what, seed, survey(seen, scenario.road_map, settings))


def main(runs: int = 10, first: int = 0, drives: int = 1, preset: str = "default") -> None:
    figures: dict[tuple[str, float], list[float]] = {}
    for seed in range(first, first + drives):
        found = survey_drive(CASE, seed)
        map_errors("the protocol", seed, found)
        harder(seed)
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
