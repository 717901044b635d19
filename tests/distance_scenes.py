"""Instances with their distances, and a quick way to learn them: for the tests of distance models."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from pole_scenes import camera, pose, see

from scpf.models.distance import TrainedOn
from scpf.models.distance_settings import DistanceSettings
from scpf.models.features import measure
from scpf.models.instances import Instance

LENS = camera()
QUICK = DistanceSettings(restarts=0)
ABOUT = TrainedOn("light_pole", 1024, 768, LENS.matrix, {"logs": "synthetic"})


def scene(n: int = 160, seed: int = 0) -> tuple[list[Instance], np.ndarray]:
    """Instances of poles of many diameters around a straight road, and their distances (m)."""
    rng = np.random.default_rng(seed)
    instances, distances = [], []
    while len(instances) < n:
        foot = (rng.uniform(6, 50), rng.choice([-1, 1]) * rng.uniform(3, 6))
        seen = see(LENS, pose(), foot, radius_m=rng.uniform(0.085, 0.095), height_m=rng.uniform(7.8, 8.2))
        if seen is not None and not measure([seen], 1024, 768).too_small[0]:
            instances.append(seen)
            distances.append(np.hypot(*foot))
    return instances, np.array(distances)


def version(path: Path) -> int:
    """The format's version that a model file names."""
    with np.load(path, allow_pickle=False) as file:
        return int(json.loads(file["model.json"].tobytes())["version"])


def changed(path: Path, **members: object) -> Path:
    """A copy of a model file with other members."""
    with np.load(path, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    header = json.loads(arrays["model.json"].tobytes())
    header.update(members.pop("header", {}))  # type: ignore[call-overload]
    arrays["model.json"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    arrays.update(members)  # type: ignore[arg-type]
    np.savez(path.with_name("changed.npz"), **arrays)
    return path.with_name("changed.npz")
