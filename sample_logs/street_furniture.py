"""Signs, bollards, a bus shelter, a parking lot's surface and people."""

from __future__ import annotations

import numpy as np

from scpf.sample_logs.materials import Material
from scpf.sample_logs.mesh import Floats, Mesh, MeshBuilder
from scpf.sample_logs.textures_signs import CROSSING, STOP

LOT_DEPTH_M = 17.0


def sign_post(plate: int, height_m: float = 2.5, size_m: float = 0.62) -> Mesh:
    """A thin post with a plate that faces -x; its picture is chosen by the instance's first parameter."""
    mesh = MeshBuilder()
    mesh.tube([[0.0, 0, 0], [0, 0, height_m]], [0.028, 0.028], 6, Material.METAL, cap=True)
    outline = _outline(plate) * size_m / 2
    n = len(outline)
    height = np.full(n, height_m - size_m / 2 - 0.02) + outline[:, 1]
    front = np.column_stack([np.full(n, -0.035), -outline[:, 0], height])
    uv = (outline / np.abs(outline).max(axis=0) + 1) / 2
    mesh.add(front, [[0, i, i + 1] for i in range(1, n - 1)], uv, material=Material.SIGN)
    mesh.add(
        front + np.array([0.004, 0, 0]), [[0, i + 1, i] for i in range(1, n - 1)], material=Material.METAL
    )
    return mesh.build()


def _outline(plate: int) -> Floats:
    """Outline (n, 2), counter-clockwise, about 1 from the middle."""
    if plate == STOP:
        angles = np.pi / 8 + np.arange(8) * np.pi / 4
        return np.column_stack([np.cos(angles), np.sin(angles)]) * 1.08
    if plate == CROSSING:
        return np.array([[0, -1.2], [1.2, 0], [0, 1.2], [-1.2, 0]])
    return np.array([[-0.8, -1.0], [0.8, -1], [0.8, 1], [-0.8, 1]])


def bollard() -> Mesh:
    """A post, knee-high and round."""
    mesh = MeshBuilder()
    mesh.tube([[0.0, 0, 0], [0, 0, 0.9], [0, 0, 0.98]], [0.08, 0.08, 0.03], 10, Material.PLAIN, cap=True)
    return mesh.build()


def shelter() -> Mesh:
    """A bus shelter, open towards -y."""
    mesh = MeshBuilder()
    for x in (-1.9, 1.9):
        for y in (-0.6, 0.6):
            mesh.tube([[x, y, 0], [x, y, 2.35]], [0.04, 0.04], 8, Material.METAL)
    mesh.box([0, 0, 2.42], [4.3, 1.7, 0.12], Material.RUBBER)
    mesh.box([0, 0.6, 1.25], [3.7, 0.02, 1.9], Material.GLASS)
    mesh.box([-1.9, 0, 1.25], [0.02, 1.1, 1.9], Material.GLASS)
    mesh.box([0.2, 0.25, 0.45], [2.2, 0.4, 0.06], Material.PLAIN)
    return mesh.build()


def pedestrian(rng: np.random.Generator) -> Mesh:
    """A walking person, 1.75 m tall; clothes take the tint."""
    mesh = MeshBuilder()
    stride = 0.18 * rng.uniform(0.4, 1.2)
    for side in (-1, 1):
        foot, knee = [side * stride, side * 0.09, 0.05], [side * stride * 0.5, side * 0.09, 0.45]
        mesh.tube([foot, knee, [0, side * 0.09, 0.88]], [0.06, 0.075, 0.095], 8, Material.RUBBER)
        shoulder, elbow = [0.02, side * 0.21, 1.40], [-side * 0.10, side * 0.25, 1.12]
        hand = [0.1 - side * 0.05, side * 0.24, 0.90]
        mesh.tube([shoulder, elbow, hand], [0.055, 0.05, 0.04], 8, Material.PLAIN)
    spine = [[0, 0, 0.85], [0, 0, 1.1], [0.02, 0, 1.38], [0.02, 0, 1.48]]
    mesh.tube(spine, [0.15, 0.17, 0.19, 0.08], 10, Material.PLAIN, cap=True)
    mesh.ellipsoid([0.03, 0, 1.62], [0.10, 0.085, 0.125], Material.PAVEMENT, 10, 8)
    mesh.ellipsoid([0.01, 0, 1.67], [0.105, 0.095, 0.10], Material.RUBBER, 10, 8)
    return mesh.build()


def parking_lot(width_m: float) -> Mesh:
    """The surface of a parking lot, from y = 0 to 17 m; uv in metres, by which the stalls are drawn."""
    half = width_m / 2
    mesh = MeshBuilder()
    corners = [[-half, 0, 0], [half, 0, 0], [half, LOT_DEPTH_M, 0], [-half, LOT_DEPTH_M, 0]]
    uv = [[0.0, 0], [width_m, 0], [width_m, LOT_DEPTH_M], [0, LOT_DEPTH_M]]
    mesh.quad(corners, uv, Material.PARKING_LOT)
    return mesh.build()
