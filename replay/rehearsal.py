"""A few steps before the first frame, for nobody to see: what Numba compiles is compiled, or read, by then.

A machine's first replay compiles for some seconds (5 with the paper's settings, 15 with this project's). Without a
rehearsal they would fall on whichever frame first shows a landmark, and on its latency and the rate.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scpf.models.camera import Camera
from scpf.models.instances import Instance
from scpf.models.road_map import RoadMap
from scpf.replay.drive import Drive
from scpf.replay.pipeline import Pipeline
from scpf.replay.settings import Settings
from scpf.replay.step import Frame

Array = NDArray[np.float64]

AHEAD_M = 15.0  # where the landmark stands in the rehearsal
POLE_TOP_M, POLE_WIDTH_M = 7.0, 0.2
MOST_PX = 1 << 22  # a log may claim any picture and any lens; this pole has 5,000 px in a usual one
STEPS = 3


def rehearse(settings: Settings, drive: Drive) -> None:
    """Run `STEPS` steps of a pipeline of their own, before the first landmark of the map.

    Does nothing where the drive lacks what a landmark constraint needs: then little is compiled.
    """
    if drive.camera is None or drive.road_map is None or drive.model is None or not drive.road_map.landmarks:
        return
    pole = _pole_ahead(drive.camera)
    if pole is None:
        return
    pole = replace(pole, landmark_class=drive.road_map.landmarks[0].landmark_class)
    pipeline = Pipeline(settings, lambda frame: [pole], drive.model, drive.camera, drive.road_map)
    state = _before_the_first_landmark(drive.road_map)
    pipeline.start(state)
    for k in range(STEPS):
        fix = state[:2] + k * state[2:] / 13
        pipeline.step(Frame(k, 0, b"", "", None, 1 / 13, None, fix, 9.0))


def _pole_ahead(camera: Camera) -> Instance | None:
    """A pole `AHEAD_M` before the vehicle as the camera sees it; None where it looks elsewhere."""
    R_body_camera, origin_m = camera.T_body_camera[:3, :3], camera.T_body_camera[:3, 3]
    ends_m = np.array([[AHEAD_M, 0.0, 0.0], [AHEAD_M, 0.0, POLE_TOP_M]])
    foot, top = camera.project((ends_m - origin_m) @ R_body_camera)
    if not np.isfinite([*foot, *top]).all():
        return None
    width = camera.matrix[0, 0] * POLE_WIDTH_M / AHEAD_M
    x1, x2 = (round(min(max(x, 0.0), camera.width_px)) for x in (foot[0] - width / 2, foot[0] + width / 2))
    y1, y2 = (round(min(max(y, 0.0), camera.height_px)) for y in (top[1], foot[1]))
    if not 0 < (x2 - x1) * (y2 - y1) <= MOST_PX:
        return None
    return Instance((x1, y1, x2, y2), np.ones((y2 - y1, x2 - x1), bool), (x1, y1), 1.0)


def _before_the_first_landmark(road_map: RoadMap) -> Array:
    """The state (x, y, vx, vy) of a vehicle that drives towards it along the road."""
    position_m = np.array(road_map.landmarks[0].position_m[:2])
    yaw = road_map.direction_near(position_m, np.array([1.0, 0.0])) or 0.0
    along = np.array([np.cos(yaw), np.sin(yaw)])
    return np.concatenate([position_m - AHEAD_M * along, 8.0 * along])
