"""What a step of the compiled filter costs, beside the numpy filter: CPU time in one interleaved run.

Not run by default. By hand (a minute):

    SCPF_BENCHMARK=1 pytest tests/benchmarks/test_filter_cost.py -s
"""

from __future__ import annotations

import os
import time

import numpy as np
import pytest

from scpf.models.batch_filter import BatchFilter
from scpf.models.compiled_terms import Fix, Range, Road, Speed, VelocityMotion, road_cubics
from scpf.models.constraints import LandmarkConstraint, RoadConstraint, SpeedConstraint
from scpf.models.motion import ConstantVelocity
from scpf.models.particle_filter import FilterSettings, ParticleFilter, PositionFix
from scpf.models.road_map import RoadSegment
from scpf.replay.evaluation_presets import PRESETS
from scpf.replay.evaluation_runs import run_estimator
from scpf.replay.protocol import CASES, make_scenario

pytestmark = pytest.mark.skipif(
    "SCPF_BENCHMARK" not in os.environ, reason="a benchmark: SCPF_BENCHMARK=1 runs it"
)
STEPS = 500
ROUNDS = 9
MARKS = np.array([[20.0, 6.0], [35.0, -6.0], [50.0, 6.5]])
SEGMENT = RoadSegment(np.zeros(2), np.array([0.0, 0.01, 1e-4, 1e-6]), False)


def test_a_step_of_500_particles_with_3_landmarks() -> None:
    compiled = BatchFilter(VelocityMotion(ConstantVelocity(11.0)), [1])
    compiled.initialise(np.zeros((1, 4)), np.ones(4))
    plain = ParticleFilter(ConstantVelocity(11.0), FilterSettings(), np.random.default_rng(0))
    plain.initialise(np.zeros(4))
    ranges = np.hypot(*MARKS.T)
    cubics, marks = road_cubics([SEGMENT]), np.column_stack([MARKS, np.zeros(3)]).astype(np.float32)
    which, here, fix = [np.array([k]) for k in range(3)], np.array([0]), np.zeros((1, 2))

    def compiled_step() -> None:
        compiled.predict(1 / 13)
        terms = [Range(marks, one, float(r), 0.8) for one, r in zip(which, ranges, strict=True)]
        compiled.update([Fix(fix, 9.0), Road(cubics, here), Speed(), *terms])

    def plain_step() -> None:
        plain.predict(1 / 13)
        rings = [LandmarkConstraint("a", mark, float(r), 0.64) for mark, r in zip(MARKS, ranges, strict=True)]
        plain.update([RoadConstraint(SEGMENT), SpeedConstraint(), *rings], PositionFix(fix[0], 9.0))

    best = {}
    for _ in range(ROUNDS):
        for name, step in (("compiled", compiled_step), ("numpy", plain_step)):
            begun = time.thread_time()
            for _ in range(STEPS):
                step()
            best[name] = min(best.get(name, np.inf), (time.thread_time() - begun) / STEPS * 1e6)
    print("\nCPU a step: " + ", ".join(f"{name} {us:.1f} µs" for name, us in best.items()))
    assert best["compiled"] < best["numpy"] / 3


def test_50_runs_of_4000_frames() -> None:
    scenario = make_scenario(CASES["S0"], 0)
    for name, known in (("paper", True), ("default", False)):
        begun = time.process_time()
        run_estimator(PRESETS[name], scenario, 3.0, range(50), known)
        print(f"\n50 × 4000 × 500, {name}: {time.process_time() - begun:.1f} s of CPU")
