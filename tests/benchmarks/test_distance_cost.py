"""What the distances of a frame with 3 instances cost: CPU time, the best of interleaved rounds.

Not run by default. By hand (seconds):

    SCPF_BENCHMARK=1 pytest tests/benchmarks/test_distance_cost.py -s
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from pole_scenes import camera, pose, see  # the tests' scenes; this folder is no part of their path

from scpf.models import distance_file
from scpf.models.distance import DistanceModel
from scpf.models.features import measure

pytestmark = pytest.mark.skipif(
    "SCPF_BENCHMARK" not in os.environ, reason="a benchmark: SCPF_BENCHMARK=1 runs it"
)
CALLS = 300
ROUNDS = 9
SIZE = (1024, 768)


def best_us(steps: dict[str, Callable[[], object]]) -> dict[str, float]:
    """The least mean CPU time of a call of each step (µs)."""
    best = {}
    for step in steps.values():
        step()
    for _ in range(ROUNDS):
        for name, step in steps.items():
            begun = time.thread_time()
            for _ in range(CALLS):
                step()
            best[name] = min(best.get(name, np.inf), (time.thread_time() - begun) / CALLS * 1e6)
    return best


def test_prediction_for_3_instances() -> None:
    """At most 100 µs from their features, by the model that ships: 208 samples close, 500 far."""
    model = DistanceModel.load(Path(distance_file.__file__).with_name("distance.npz"))
    feet = {"close and far": (9.0, 18.0, 30.0), "far": (24.0, 30.0, 36.0), "close": (8.0, 9.0, 10.0)}
    for name, ahead in feet.items():
        seen = [see(camera(), pose(), (x, 4.0)) for x in ahead]
        instances = [each for each in seen if each is not None]
        features = measure(instances, *SIZE, model.features)
        assert len(instances) == 3
        assert not features.too_small.any()
        found = best_us(
            {
                "gate and experts": lambda f=features: model.predict_features(f),  # type: ignore[misc]
                "features of masks": lambda i=instances: measure(i, *SIZE, model.features),  # type: ignore[misc]
                "every feature": lambda i=instances: measure(i, *SIZE),  # type: ignore[misc]
                "all of predict": lambda i=instances: model.predict(i, *SIZE),  # type: ignore[misc]
            }
        )
        experts = [model.names[k] for k in model.choose(features)]
        print(
            f"\n3 instances, {name} ({', '.join(experts)}): "
            + ", ".join(f"{k} {us:.0f} µs" for k, us in found.items())
        )
        assert found["gate and experts"] <= 100.0
