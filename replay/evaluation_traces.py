"""What a drive's runs did over time: errors frame by frame, and the first run as a trajectory file for evo."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.trajectory_writers import write_tum
from scpf.models.trajectory import Trajectory
from scpf.replay.evaluation_metrics import position_errors
from scpf.replay.evaluation_runs import Estimates
from scpf.replay.protocol import Scenario

Array = NDArray[np.float64]

BAND_PERCENT: Final = (2.5, 97.5)


@dataclass(frozen=True, eq=False)
class Trace:
    """Over K frames: mean error of the runs (m) and the band of 95 % of them; positions (K, 2) and headings (K,) of
    the first run, positions relative to the scenario's ``middle_m``.
    """

    mean_m: Array
    low_m: Array
    high_m: Array
    first_run_m: Array
    first_run_headings_rad: Array


def trace_of(estimates: Estimates, scenario: Scenario) -> Trace:
    """The trace of all runs on a drive."""
    errors = position_errors(estimates.positions_m, scenario.drive.positions_m)
    low, high = np.percentile(errors, BAND_PERCENT, axis=0)
    return Trace(errors.mean(axis=0), low, high, estimates.positions_m[0], estimates.headings_rad[0])


def truth_name(case: str, drive: int) -> str:
    """The file of a drive's truth."""
    return f"{case}_{drive}_truth.tum"


def estimate_name(preset: str, case: str, drive: int, sigma_m: float) -> str:
    """The file of an estimator's first run on a drive."""
    return f"{case}_{drive}_{preset}_{sigma_m:g}m.tum"


def write_truth(path: Path, scenario: Scenario) -> None:
    """Write the truth of a drive as TUM, replacing ``path``; poses of the body in ``map``.

    Seconds since 1970, or, of a simulated drive, since its first frame.
    """
    _write(path, scenario, scenario.drive.positions_m, scenario.drive.headings_rad)


def write_estimate(path: Path, scenario: Scenario, trace: Trace) -> None:
    """Write the first run on a drive as TUM, replacing ``path``; stamps are those of the truth."""
    _write(path, scenario, trace.first_run_m, trace.first_run_headings_rad)


def _write(path: Path, scenario: Scenario, positions_m: Array, headings_rad: Array) -> None:
    count = len(positions_m)
    stamps_ns = scenario.start_ns + np.rint(scenario.times_s * 1e9).astype(np.int64)
    positions = np.column_stack([positions_m + scenario.middle_m, np.zeros(count)])
    half = 0.5 * headings_rad
    level = np.zeros(count)
    quaternions = np.column_stack([level, level, np.sin(half), np.cos(half)])
    write_tum(path, Trajectory(stamps_ns, positions, quaternions), overwrite=True)
