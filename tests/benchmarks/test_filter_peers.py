"""A step of the filter beside those that one would otherwise take: `particles` and filterpy's idiom.

Not run by default; the two are no dependencies, and are skipped where they are missing. By hand (a minute):

    pip install --no-deps --target /tmp/peers particles filterpy
    SCPF_BENCHMARK=1 PYTHONPATH=/tmp/peers pytest tests/benchmarks/test_filter_peers.py -s

All have the paper's model: 500 particles, three landmarks, road, speed, GPS, systematic resampling in every step; the
peers the same likelihood in numpy. CPU time, rounds in turn in one process: on a busy machine the ratios hold.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from scpf.models.batch_filter import BatchFilter
from scpf.models.compiled_terms import Fix, Range, Road, Speed, VelocityMotion, road_cubics
from scpf.models.constraints import LandmarkConstraint, RoadConstraint, SpeedConstraint, log_probability
from scpf.models.motion import ConstantVelocity
from scpf.models.particle_filter import PositionFix
from scpf.models.road_map import RoadSegment

pytestmark = pytest.mark.skipif(
    "SCPF_BENCHMARK" not in os.environ, reason="a benchmark: SCPF_BENCHMARK=1 runs it"
)
STEPS, ROUNDS, PARTICLES = 300, 9, 500
DT_S, GPS_M2, RANGE_M2 = 1 / 13, 9.0, 0.64
MOTION = ConstantVelocity(11.0)
FIRST_M2 = np.array([10.0, 10.0, 2.5, 2.5])
MARKS = np.array([[20.0, 6.0], [35.0, -6.0], [50.0, 6.5]])
RANGES_M = np.hypot(*MARKS.T)
SEGMENT = RoadSegment(np.zeros(2), np.array([0.0, 0.01, 1e-4, 1e-6]), False)


def ours() -> Callable[[int], None]:
    """The compiled filter, its terms made anew in each step as in a drive."""
    filter_ = BatchFilter(VelocityMotion(MOTION), [1], PARTICLES)
    filter_.initialise(np.zeros((1, 4)), np.sqrt(FIRST_M2))
    marks = np.column_stack([MARKS, np.zeros(3)]).astype(np.float32)
    cubics, here, fix = road_cubics([SEGMENT]), np.array([0]), np.zeros((1, 2))
    which = [np.array([k]) for k in range(3)]
    deviation_m = float(np.sqrt(RANGE_M2))

    def run(steps: int) -> None:
        for _ in range(steps):
            filter_.predict(DT_S)
            terms = [Range(marks, k, float(m), deviation_m) for k, m in zip(which, RANGES_M, strict=True)]
            filter_.update([Fix(fix, GPS_M2), Road(cubics, here), Speed(), *terms])

    return run


def log_likelihood(states: np.ndarray) -> np.ndarray:
    """What a step observes, as compactly as numpy allows: the same for both peers."""
    from scipy.special import log_ndtr

    x, y, vx, vy = states.T
    b0, b1, b2, b3 = SEGMENT.coefficients
    total = -0.5 * (x**2 + y**2) / GPS_M2
    total -= np.maximum(np.abs(y - (b0 + x * (b1 + x * (b2 + x * b3)))) - 4.0, 0.0) / 0.25
    total -= np.maximum(np.hypot(vx, vy) - 12.0, 0.0)
    # Without its constant, erfc(u / √2) is the normal distribution function of −u.
    off = np.abs(np.hypot(x[:, None] - MARKS[:, 0], y[:, None] - MARKS[:, 1]) - RANGES_M)
    result: np.ndarray = total + log_ndtr(-off / np.sqrt(RANGE_M2)).sum(1)
    return result


def of_particles() -> Callable[[int], None]:
    """Chopin's `particles`: a Feynman-Kac model whose motion and potential are written in numpy."""
    particles = pytest.importorskip("particles", reason="particles is not installed: see this file's head")
    rng = np.random.default_rng(0)

    class Model(particles.FeynmanKac):  # type: ignore[misc, name-defined]
        def __init__(self, steps: int) -> None:
            self.T = steps

        def M0(self, count: int) -> Any:
            return np.sqrt(FIRST_M2) * rng.standard_normal((count, 4))

        def M(self, t: int, states: Any) -> Any:
            return MOTION.propagate(states, DT_S, rng)

        def logG(self, t: int, before: Any, states: Any) -> Any:
            return log_likelihood(states)

    def run(steps: int) -> None:
        particles.SMC(fk=Model(steps), N=PARTICLES, resampling="systematic", ESSrmin=1.0).run()

    return run


def of_filterpy() -> Callable[[int], None]:
    """filterpy has resampling alone; the loop around it is the one of its book."""
    monte_carlo = pytest.importorskip(
        "filterpy.monte_carlo", reason="filterpy is not installed: see this file's head"
    )
    rng = np.random.default_rng(0)

    def run(steps: int) -> None:
        states = np.sqrt(FIRST_M2) * rng.standard_normal((PARTICLES, 4))
        for _ in range(steps):
            states = MOTION.propagate(states, DT_S, rng)
            joint = log_likelihood(states)
            weights = np.exp(joint - joint.max())
            weights /= weights.sum()
            mean = np.average(states, weights=weights, axis=0)
            np.average((states - mean) ** 2, weights=weights, axis=0)
            states = states[monte_carlo.systematic_resample(weights)]

    return run


def test_the_peers_weigh_as_the_constraints_do() -> None:
    states = np.random.default_rng(0).normal(0.0, 4.0, (200, 4))
    rings = [LandmarkConstraint("", at, float(m), RANGE_M2) for at, m in zip(MARKS, RANGES_M, strict=True)]
    wanted = log_probability([RoadConstraint(SEGMENT), SpeedConstraint(), *rings], states)
    wanted += PositionFix(np.zeros(2), GPS_M2).log_likelihood(states)
    assert np.ptp(log_likelihood(states) - wanted) < 1e-9


@pytest.mark.parametrize(
    ("name", "peer", "least"), [("particles", of_particles, 9), ("filterpy", of_filterpy, 15)]
)
def test_a_step_costs_a_fraction_of_a_peer_s(
    name: str, peer: Callable[[], Callable[[int], None]], least: float
) -> None:
    runs = {"ours": ours(), name: peer()}
    best: dict[str, float] = {}
    for run in runs.values():
        run(3)
    for _ in range(ROUNDS):
        for who, run in runs.items():
            begun = time.thread_time()
            run(STEPS)
            best[who] = min(best.get(who, np.inf), (time.thread_time() - begun) / STEPS * 1e6)
    ratio = best[name] / best["ours"]
    print(f"\nCPU a step: ours {best['ours']:.1f} µs, {name} {best[name]:.0f} µs: 1 / {ratio:.1f}")
    assert ratio >= least
