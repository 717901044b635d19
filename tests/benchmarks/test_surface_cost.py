"""What the constraint surface of a replayed frame costs: CPU time of 121 × 121 cells, three detections.

Not run by default. By hand (seconds):

    SCPF_BENCHMARK=1 pytest tests/benchmarks/test_surface_cost.py -s
"""

from __future__ import annotations

import os
import time

import numpy as np
import pytest

from scpf.models.bearing_constraint import HeadingConstraint
from scpf.models.constraints import Constraint, LandmarkConstraint, RoadConstraint, SpeedConstraint
from scpf.models.matched_landmarks import MatchedLandmarks, Sighting
from scpf.models.road_map import RoadSegment
from scpf.replay.settings import SurfaceSettings
from scpf.replay.surface import constraint_surface

pytestmark = pytest.mark.skipif(
    "SCPF_BENCHMARK" not in os.environ, reason="a benchmark: SCPF_BENCHMARK=1 runs it"
)
ROUNDS = 40
GRID = SurfaceSettings(121, 0.5)
SEEN = np.array([[20.0, 6.0], [35.0, -6.0], [50.0, 6.5]])
MAPPED = np.column_stack([np.arange(-10.0, 90.0, 15.0), np.resize([6.0, -6.0], 7)])
BOTH: list[Constraint] = [
    RoadConstraint(RoadSegment(np.zeros(2), np.array([0.0, 0.01, 1e-4, 1e-6]), False)),
    SpeedConstraint(),
]


def test_both_surfaces_of_each_preset() -> None:
    ranges, bearings = np.hypot(*SEEN.T).tolist(), np.arctan2(SEEN[:, 1], SEEN[:, 0]).tolist()
    rings = [LandmarkConstraint("", at, far, 0.64) for at, far in zip(SEEN, ranges, strict=True)]
    sightings = [Sighting(far, 0.8, angle, 0.05) for far, angle in zip(ranges, bearings, strict=True)]
    presets: dict[str, tuple[list[Constraint], int]] = {
        "paper": ([*BOTH, *rings], 4),
        "default": ([*BOTH, HeadingConstraint(0.0, 0.12), MatchedLandmarks(MAPPED, sightings)], 6),
    }
    for name, (constraints, size) in presets.items():
        mean = np.zeros(size)
        mean[2] = 8.0
        best = np.inf
        for _ in range(ROUNDS):
            begun = time.thread_time()
            constraint_surface(constraints, mean, GRID)
            best = min(best, (time.thread_time() - begun) * 1e3)
        print(f"\n{name}: {best:.2f} ms of CPU")
        assert best <= 2.0
