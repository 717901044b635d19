"""Poles seen by a pinhole camera: exact instances of vertical cylinders, for the tests of distances."""

from __future__ import annotations

import numpy as np

from scpf.models.camera import Camera, looking_ahead
from scpf.models.instances import Instance
from scpf.models.road_map import Landmark, RoadMap


def camera(width_px: int = 1024, height_px: int = 768, focal_px: float = 730.0) -> Camera:
    """A camera 1.9 m ahead of the body origin and 2.3 m above it."""
    mount = looking_ahead()
    mount[:3, 3] = [1.9, 0.0, 2.3]
    matrix = np.array([[focal_px, 0, width_px / 2], [0, focal_px, height_px / 2], [0, 0, 1.0]])
    return Camera(width_px, height_px, matrix, T_body_camera=mount)


def pose(x_m: float = 0.0, y_m: float = 0.0, yaw_rad: float = 0.0) -> np.ndarray:
    """T_map_body (4, 4) on a flat road."""
    T = np.eye(4)
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    T[:2, :2] = [[c, -s], [s, c]]
    T[:2, 3] = [x_m, y_m]
    return T


def road_map(*feet_m: tuple[float, float], up_m: float = 0.0) -> RoadMap:
    """A map of poles P0, P1, … with their feet at (east, north)."""
    marks = tuple(Landmark(f"P{k}", (x, y, up_m)) for k, (x, y) in enumerate(feet_m))
    return RoadMap(marks, np.zeros((0, 2)))


def see(
    camera: Camera,
    T_map_body: np.ndarray,
    foot_m: tuple[float, float],
    *,
    radius_m: float = 0.09,
    height_m: float = 8.0,
    landmark_id: str = "",
) -> Instance | None:
    """The instance of a pole, a cylinder on the road z = 0; None where the image shows too little of it."""
    heights = np.linspace(0.0, height_m, 400)
    points = np.column_stack([np.full((400, 2), foot_m), heights, np.ones(400)])
    in_camera = (points @ np.linalg.inv(T_map_body @ camera.T_body_camera).T)[:, :3]
    pixels = camera.project(in_camera)
    if not np.isfinite(pixels).all():
        return None
    half = camera.matrix[0, 0] * radius_m / in_camera[:, 2]
    rows = np.arange(camera.height_px)
    seen = rows[(rows >= pixels[-1, 1]) & (rows <= pixels[0, 1])]
    centre = np.interp(seen, pixels[::-1, 1], pixels[::-1, 0])
    half = np.interp(seen, pixels[::-1, 1], half[::-1])
    full = np.zeros((camera.height_px, camera.width_px), dtype=bool)
    full[seen] = np.abs(np.arange(camera.width_px) - centre[:, None]) <= half[:, None]
    if full.sum() < 10:
        return None
    ys, xs = np.flatnonzero(full.any(1)), np.flatnonzero(full.any(0))
    box = (xs[0], ys[0], xs[-1] + 1, ys[-1] + 1)
    crop = full[box[1] : box[3], box[0] : box[2]]
    return Instance(
        tuple(float(v) for v in box), crop, (int(box[0]), int(box[1])), 1.0, landmark_id=landmark_id
    )
