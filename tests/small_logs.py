"""A small drive log that has something of everything, for tests that read it back or break it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from scpf.ingest.drive_log import MAP_ATTACHMENT, DriveLogWriter
from scpf.models.camera import Camera, looking_ahead
from scpf.models.geodesy import Origin
from scpf.models.instances import instance_from_mask
from scpf.models.road_map import Landmark, RoadMap, to_geojson

ORIGIN = Origin(43.47, -80.54, 330.0)
T0 = 1_660_847_613_703_000_000
STEP = 77_000_000
MATRIX = np.array([[700.0, 0, 320], [0, 701, 240], [0, 0, 1]])


def a_camera() -> Camera:
    mount = looking_ahead()
    mount[:3, 3] = 1.5, 0.1, 1.2
    return Camera(640, 480, MATRIX, np.array([-0.2, 0.05, 0, 0, 0]), T_body_camera=mount)


def a_pose(k: int) -> np.ndarray:
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(k / 9), -np.sin(k / 9)], [np.sin(k / 9), np.cos(k / 9)]]
    pose[:3, 3] = k, -2.0 * k, 0.1
    return pose


def image(k: int, size: int = 30_000) -> bytes:
    return np.random.default_rng(k).bytes(size)


def write(path: Path, frames: int = 40, origin: Origin | None = ORIGIN, size: int = 30_000) -> Path:
    road = RoadMap(
        (Landmark("a", (10.0, 5.0, 0.0)),), np.column_stack([np.arange(20.0), np.zeros(20)]), origin=origin
    )
    mask = np.zeros((50, 60), bool)
    mask[5:40, 20:24] = True
    with DriveLogWriter(path, origin=origin) as log:
        log.write_camera(T0, a_camera())
        for k in range(frames):
            stamp_ns = T0 + k * STEP
            log.write_image(stamp_ns, image(k, size), "jpeg")
            log.write_pose(stamp_ns, a_pose(k), 0.02**2)
            if k % 4 == 0:
                log.write_gps(stamp_ns, a_pose(k)[:2, 3], 4.0)
            log.write_instances(stamp_ns, [instance_from_mask(mask, landmark_id="a")] if k else [])
        log.attach(MAP_ATTACHMENT, "application/geo+json", json.dumps(to_geojson(road)).encode())
        log.metadata("scpf", {"made_by": "a test"})
    return path
