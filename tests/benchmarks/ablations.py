"""What each part of the default preset buys: it without that part, on the protocol.

    python tests/benchmarks/ablations.py [runs] [first drive] [drives]

Run by hand: some minutes for 10 runs of two drives. Prints the mean position error (m) with GPS of 3 / 10 m of every
variant in every case, then the NEES of the position (2 is right), and how many runs diverged.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any, Final

import numpy as np

from scpf.replay.evaluation_metrics import measure
from scpf.replay.evaluation_presets import PRESETS
from scpf.replay.evaluation_runs import run_estimator
from scpf.replay.protocol import CASES, make_scenario

SIGMAS_M = (3.0, 10.0)
DEFAULT = PRESETS["default"]
VARIANTS: Final[dict[str, dict[str, Any]]] = {
    "default": {},
    "told which pole it sees": {"known": True},
    "matched around the estimate": {"per_particle": False},
    "without bearings": {"bearing_deviation_rad": None},
    "without the road's direction": {"heading_deviation_rad": None},
    "without the road's edges": {"road": False},
    "always tempered by 0.21": {"tempering": 0.21},
    "never tempered": {"tempering": 1.0},
    "with the particles' own covariance": {"tempering": 0.21, "consider": None},
    "with first velocities as stated": {"velocity_doubt": 1.0},
}


def main(runs: int, first: int, drives: int) -> None:
    """Print a row for each variant."""
    print(f"{'mean error, m; NEES':36s}" + "".join(f"{case:>27s}" for case in CASES), "  diverged")
    scenarios = {
        (case, drive): make_scenario(CASES[case], drive)
        for case in CASES
        for drive in range(first, first + drives)
    }
    for name, changes in VARIANTS.items():
        settings = replace(DEFAULT, **{key: value for key, value in changes.items() if key != "known"})
        cells, lost = [], 0
        for case in CASES:
            figures = np.zeros((2, len(SIGMAS_M)))
            for s, sigma_m in enumerate(SIGMAS_M):
                for drive in range(first, first + drives):
                    scenario = scenarios[case, drive]
                    seeds = range(1000 * drive, 1000 * drive + runs)
                    found = run_estimator(settings, scenario, sigma_m, seeds, "known" in changes)
                    truth = scenario.drive
                    poles = np.array([len(frame) for frame in scenario.detections])
                    pair = (found.positions_m, found.covariances_m2)
                    metrics = measure(*pair, truth.positions_m, truth.headings_rad, sigma_m, poles)
                    figures[:, s] += np.array([metrics.mean_m, metrics.nees]) / drives
                    lost += metrics.diverged_runs
            (near, far), (nees, nees_far) = figures
            cells.append(f"{near:.2f} / {far:.2f}; {nees:.1f} / {nees_far:.1f}")
        print(f"{name:36s}" + "".join(f"{cell:>27s}" for cell in cells), f"  {lost}", flush=True)


if __name__ == "__main__":
    given = [int(each) for each in sys.argv[1:]]
    main(*(given + [10, 0, 2][len(given) :]))
