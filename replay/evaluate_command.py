"""``scpf evaluate``: Monte Carlo comparison of estimators on the simulated protocol, or on recorded observations."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Literal


def evaluate(
    *recordings: Path,
    presets: tuple[str, ...] = ("paper", "pf", "ekf", "default"),
    cases: tuple[str, ...] = ("P", "S0", "S1", "S2"),
    sigma: tuple[float, ...] = (3.0, 10.0),
    runs: int = 50,
    drives: int = 2,
    frames: int = 4000,
    matching: Literal["known", "unknown"] = "unknown",
    gps_outage: tuple[str, ...] = (),
    no_gps: bool = False,
    drop_out: float = 0.0,
    map_error: str | None = None,
    range_error: str | None = None,
    errors: Literal["white", "correlated"] | None = None,
    map: Path | None = None,
    seed: int = 0,
    jobs: int = 1,
    backend: Literal["loky", "multiprocessing", "threading", "dask", "ray"] = "loky",
    scheduler: str | None = None,
    json: Path | None = None,
    csv: Path | None = None,
    figures: Path | None = None,
    tum: Path | None = None,
    overwrite: bool = False,
    format: Literal["text", "json", "csv"] = "text",
) -> int:
    """Compare estimators in Monte Carlo runs of a simulated drive past mapped poles, or of recorded ones.

    Recordings are the results of `scpf replay`: what it measured is filtered again, with its reference as the truth
    and other noise of the GPS in each run. Without one, the drives are simulated. Exit code 3: frames without a
    reference pose were left out.

    Cases: P has the paper's training errors, S0 its validation errors, S1 the same correlated over a second, S2
    also a map that is off by 1–2 m. The same seed gives the same figures, however many jobs share the work.

    Examples:

        scpf evaluate --runs 5 --drives 1

        scpf evaluate --presets paper --presets pf --cases P --sigma 3 --sigma 10 --matching known

        scpf evaluate --gps-outage 60:90 --gps-outage 200:220 --drop-out 0.3 --map-error 0.5:1

        scpf evaluate drive.results.mcap --runs 20

        scpf evaluate --jobs 8 --json figures.json --csv figures.csv --figures figures/ --tum runs/

    Parameters
    ----------
    recordings
        Results files of `scpf replay`, with a reference.
    presets
        Estimators: `paper`, `pf`, `ekf`, `default`.
    cases
        Cases of the simulated drives: `P`, `S0`, `S1`, `S2`.
    sigma
        Deviations of the rough GPS (m an axis).
    runs
        Monte Carlo runs on each drive.
    drives
        Simulated drives of each case.
    frames
        Frames of each simulated drive, at 13 Hz.
    matching
        Whether the estimators are told which pole a detection shows.
    gps_outage
        Seconds without GPS, FROM:TO after the first frame; may be given several times.
    no_gps
        No GPS after the first frame.
    drop_out
        Probability that a detection is lost, beyond those that the case loses.
    map_error
        How far each landmark of the map is off, LEAST:MOST (m); otherwise the case's own.
    range_error
        Mean absolute errors of distances, CLOSE:FAR (m); otherwise the case's own.
    errors
        Whether errors of distances are drawn anew in each frame or last for a second; otherwise the case's own.
    map
        The map of the recordings (GeoJSON), instead of the one that is in them.
    seed
        Seed of drives, fixes and particles.
    jobs
        Workers; −1 for all cores.
    backend
        joblib's backend that runs them: processes of this machine, or a cluster's (`pip install 'scpf[dask]'`).
    scheduler
        Address of the dask scheduler or ray head to use; otherwise one is started on this machine.
    json
        Also write plan, settings and figures to this file.
    csv
        Also write the figures of each drive to this file.
    figures
        Also draw error against GPS noise, error over time, poles in sight and the constraint surface as PNG into this
        folder (`pip install 'scpf[figures]'`).
    tum
        Also write the truth of each drive, and each estimator's first run on it, as TUM trajectories into this folder.
    overwrite
        Replace files of that name.
    format
        How to print the figures on stdout.
    """
    from scpf.models.errors import UsageError
    from scpf.replay.evaluation import evaluate as carry_out
    from scpf.replay.evaluation_conditions import Conditions
    from scpf.replay.evaluation_outputs import Outputs
    from scpf.replay.evaluation_plan import Plan
    from scpf.replay.evaluation_report import as_csv, as_json, as_table
    from scpf.replay.evaluation_scenarios import make_scenarios

    if jobs == 0:
        raise UsageError("--jobs is not 0", "a number of workers, or -1 for all cores")
    conditions = Conditions(
        gps_outages_s=tuple(pair(text, "--gps-outage") for text in gps_outage),
        gps_after_start=not no_gps,
        drop_out=drop_out,
        map_error_m=None if map_error is None else pair(map_error, "--map-error"),
        range_error_m=None if range_error is None else pair(range_error, "--range-error"),
        correlated=None if errors is None else errors == "correlated",
    )
    plan = Plan(
        presets,
        () if recordings else cases,
        sigma,
        runs,
        drives,
        frames,
        matching == "known",
        seed,
        conditions,
        tuple(str(path) for path in recordings),
        None if map is None else str(map),
    )
    plan.check()
    outputs = Outputs(json, csv, figures, tum)
    outputs.check(plan, overwrite)
    scenarios = make_scenarios(plan)
    results = carry_out(plan, jobs, backend, scenarios, scheduler)
    outputs.write(plan, results, scenarios)
    printed = {"text": as_table, "json": as_json}
    print(printed[format](plan, results) if format != "csv" else as_csv(results).rstrip("\n"))
    lost = sum(result.metrics.diverged_runs for result in results)
    if lost:
        print(f"scpf: {lost} runs diverged", file=sys.stderr)
    skipped = sum(scenario.left_out for scenario in scenarios.values())
    if skipped:
        print(f"scpf: {skipped} frames without a reference pose left out", file=sys.stderr)
    return 3 if skipped else 0


def pair(text: str, option: str) -> tuple[float, float]:
    """The two numbers of ``A:B``; UsageError, naming the option, for anything else."""
    from scpf.models.errors import UsageError

    first, _, second = text.partition(":")
    try:
        return float(first), float(second)
    except ValueError:
        raise UsageError(f"{option} {text!r} is not two numbers", f"for example {option} 1:2") from None
