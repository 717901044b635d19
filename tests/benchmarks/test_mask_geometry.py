"""How far the masks of a simulated drive lie from the poles' axes, projected by OpenCV with the published calibration.

Not run by default. By hand (about a minute):

    SCPF_BENCHMARK=1 pytest tests/benchmarks/test_mask_geometry.py -s
"""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from scpf.ingest.calibration import read_camera, to_yaml
from scpf.sample_logs.basler import basler_camera
from scpf.sample_logs.drive_frames import DriveSettings, SimulatedDrive
from scpf.sample_logs.renderer import Renderer
from scpf.sample_logs.scene import Scene
from scpf.sample_logs.world import build_world

pytestmark = pytest.mark.skipif(
    "SCPF_BENCHMARK" not in os.environ, reason="a benchmark: SCPF_BENCHMARK=1 runs it"
)
MEAN_BAR_PX, DEVIATION_BAR_PX = 0.5, 1.0
SHAFT_M = (0.6, 7.0)
"""The straight part of a pole, above its foot and below its elbow."""
FURTHEST_M = 60.0
WHOLE = 0.97
"""A foot is sunk into the ground by a centimetre."""
EVERY = 26


def axes_in_map(scene: Scene) -> dict[int, NDArray[np.float64]]:
    """Points (n, 3) on the axis of each pole as it leans, by its number."""
    heights = np.column_stack([np.zeros((300, 2)), np.linspace(*SHAFT_M, 300), np.ones(300)])
    poles = np.flatnonzero((scene.instance_id > 0) & (scene.instance_id < 1000))
    return {int(scene.instance_id[n]): heights @ scene.T_map_local[n].T for n in poles}


def off_the_axis(mask: NDArray[np.bool_], axis_px: NDArray[np.float64]) -> list[float]:
    """Middle of the mask less the axis, px, in every row between the axis' ends that holds a mask in one piece."""
    order, off = np.argsort(axis_px[:, 1]), []
    first, last = max(int(np.ceil(axis_px[:, 1].min())), 0), min(int(axis_px[:, 1].max()), len(mask) - 1)
    for row in range(first, last + 1):
        columns = np.flatnonzero(mask[row])
        if len(columns) and columns[-1] - columns[0] == len(columns) - 1:
            axis = np.interp(row, axis_px[order, 1], axis_px[order, 0])
            off.append(float((columns[0] + columns[-1]) / 2 - axis))
    return off


@pytest.mark.parametrize("width_px", [2048, 1024])
def test_masks_lie_on_the_axes(width_px: int, tmp_path: Path) -> None:
    """Over the poles that nothing hides within 60 m, along 400 m of the Ring Road."""
    drive = SimulatedDrive(
        DriveSettings(0.0, 55.0, 0, weather="overcast", width_px=width_px, map_error_m=0.0)
    )
    (tmp_path / "camera.yaml").write_bytes(to_yaml(drive.camera))
    camera = read_camera(tmp_path / "camera.yaml")
    vehicle, road = drive.vehicle, drive.road
    ends = float(vehicle.frames.s_m[0]), float(vehicle.frames.s_m[-1])
    world = build_world(road.centre_line, road.poles, seed=0, route_m=ends)
    renderer = Renderer(world.scene, world.textures, basler_camera(width_px), drive.weather, seed=0)
    axes, off, poles = axes_in_map(world.scene), [], 0
    for index in range(0, len(vehicle), EVERY):
        T_map_body = vehicle.T_map_body[index]
        frame = renderer.render(T_map_body, speed_mps=0.0, yaw_rate_radps=0.0, frame_seed=index)
        T_camera_map = np.linalg.inv(T_map_body @ camera.T_body_camera)
        turn, _ = cv2.Rodrigues(T_camera_map[:3, :3])
        for number, visible in frame.visible_fraction.items():
            axis_m = axes[number]
            if visible < WHOLE or np.hypot(*(axis_m[0, :2] - T_map_body[:2, 3])) > FURTHEST_M:
                continue
            axis_px, _ = cv2.projectPoints(
                axis_m, turn, T_camera_map[:3, 3], camera.matrix, camera.distortion
            )
            rows = off_the_axis(frame.instance_ids == number, axis_px.reshape(-1, 2))
            off += rows
            poles += bool(rows)
    mean, deviation = float(np.mean(off)), float(np.std(off))
    print(f"{width_px} px: {poles} poles, {len(off)} rows: mean {mean:+.3f} px, deviation {deviation:.3f} px")
    assert poles >= 15
    assert abs(mean) <= MEAN_BAR_PX
    assert deviation <= DEVIATION_BAR_PX
