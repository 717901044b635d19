"""Drive logs of simulated poles, for the tests of training."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from pole_scenes import camera, pose, road_map, see

from scpf.ingest.drive_log import MAP_ATTACHMENT, DriveLogWriter
from scpf.models.distance_settings import DistanceSettings
from scpf.models.road_map import to_geojson

LENS = camera()
QUICK = DistanceSettings(restarts=0, max_samples=120, max_search_samples=60)
START_NS = 1_700_000_000_000_000_000
FEET = tuple((15.0 + 22.0 * k, 4.5 if k % 2 else -4.0) for k in range(14))


def write_log(
    path: Path,
    *,
    frames: int = 150,
    images: bool = False,
    parts: bool = True,
    signs: Sequence[int] = (),
    posts: Sequence[int] = (),
) -> Path:
    """A drive of two metres a frame, four frames a second, past poles on both sides; some are signs or posts."""
    classes = {**dict.fromkeys(signs, "sign"), **dict.fromkeys(posts, "post")}
    poles = road_map(*FEET)
    marks = [
        replace(mark, landmark_class=classes.get(n, "light_pole")) for n, mark in enumerate(poles.landmarks)
    ]
    mapped = replace(poles, landmarks=tuple(marks))
    rng = np.random.default_rng(5)
    thick = rng.uniform(0.085, 0.095, len(FEET))
    with DriveLogWriter(path) as log:
        if parts:
            log.write_camera(START_NS, LENS)
        log.attach(MAP_ATTACHMENT, "application/geo+json", json.dumps(to_geojson(mapped)).encode())
        for k in range(frames):
            stamp, T = START_NS + k * 250_000_000, pose(2.0 * k, 0.3 * np.sin(k), 0.01 * np.cos(k))
            log.write_pose(stamp, T)
            ahead = [
                (n, see(LENS, T, foot, radius_m=thick[n]))
                for n, foot in enumerate(FEET)
                if foot[0] > 2 * k + 5
            ]
            seen = [
                replace(each, landmark_class=classes.get(n, "light_pole"))
                for n, each in ahead
                if each is not None
            ]
            log.write_instances(stamp, seen)
            if images:
                log.write_image(stamp, b"no image", "jpeg")
    return path
