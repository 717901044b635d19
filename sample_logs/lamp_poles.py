"""Shapes of lamps: the ring road's poles, which are the landmarks, and others that a detector may confuse."""

from __future__ import annotations

import numpy as np

from scpf.sample_logs.materials import Material
from scpf.sample_logs.mesh import Floats, Mesh, MeshBuilder, strip_faces

ELBOW_RADIUS_M = 1.05
ELBOW_END_RAD = np.pi / 2 * 0.93
"""The elbow stops short of level: arms rise a little towards the lamp."""


def road_lamp(height_m: float = 8.6, arm_m: float = 1.7, girth: float = 1.0) -> Mesh:
    """A tapered pole with a curved elbow and a flat lamp over the road, which lies towards +x.

    ``girth``: thickness of the pole, relative to the Ring Road's.
    """
    mesh = MeshBuilder()
    mesh.box([0, 0, 0.02], [0.46, 0.46, 0.06], Material.METAL)
    mesh.tube([[0, 0, 0.04], [0, 0, 0.30], [0, 0, 0.36]], [0.17, 0.16, 0.105 * girth], 16, Material.METAL)
    shaft_top = height_m - 1.15
    heights = np.linspace(0.3, shaft_top, 7)
    path = [[0.0, 0.0, z] for z in heights]
    radii = list(girth * np.interp(heights, [0.3, shaft_top], [0.098, 0.062]))
    for angle in np.linspace(0.18, ELBOW_END_RAD, 9):
        path.append([ELBOW_RADIUS_M * (1 - np.cos(angle)), 0.0, shaft_top + ELBOW_RADIUS_M * np.sin(angle)])
        radii.append(girth * (0.058 - 0.014 * angle / 1.5))
    elbow_end = np.array(path[-1])
    along_arm = np.array([np.sin(ELBOW_END_RAD), 0, np.cos(ELBOW_END_RAD)])
    arm_end = elbow_end + along_arm * max(0.25, arm_m - elbow_end[0])
    mesh.tube([*path, list(arm_end)], [*radii, 0.040 * girth], 16, Material.METAL)
    mesh.box([0.10, 0, 0.95], [0.02, 0.11, 0.30], Material.METAL)
    _add_lamp_head(mesh, arm_end)
    return mesh.build()


def _add_lamp_head(mesh: MeshBuilder, arm_end: Floats) -> None:
    """A flattened, tapered body, and the lens on its lower side."""
    rings, sides = 10, 12
    t = np.linspace(0, 1, rings)
    half_width = 0.16 * np.interp(t, [0, 0.12, 0.45, 0.8, 0.95, 1], [0.35, 0.5, 1, 1, 0.72, 0.3])
    half_height = 0.085 * np.interp(t, [0, 0.12, 0.45, 0.8, 0.95, 1], [0.6, 0.7, 1, 0.95, 0.7, 0.3])
    points = []
    for i in range(rings):
        x = -0.05 + 0.82 * t[i]
        for angle in np.linspace(0, 2 * np.pi, sides, endpoint=False):
            flat = 1.0 if np.sin(angle) > 0 else 0.55
            z = half_height[i] * np.sin(angle) * flat + 0.10 * x
            points.append(arm_end + np.array([x, half_width[i] * np.cos(angle), z]))
    mesh.add(points, strip_faces(rings, sides, closed=True), material=Material.METAL, smooth=True)
    lens = [[-0.22, -0.12, -0.062], [0.20, -0.12, -0.02], [0.20, 0.12, -0.02], [-0.22, 0.12, -0.062]]
    mesh.quad(np.array(lens)[::-1] + arm_end + [0.50, 0, 0.0], material=Material.LENS)


def banner() -> Mesh:
    """A cloth banner on two rods; hangs beside a pole, and its pole looks as if it had a flag."""
    mesh = MeshBuilder()
    for z in (4.9, 3.5):
        mesh.tube([[0, 0, z], [0, 0.78, z]], [0.015, 0.015], 6, Material.METAL)
    cloth = np.array([[0, 0.10, 3.52], [0, 0.72, 3.52], [0, 0.72, 4.88], [0, 0.10, 4.88]])
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    mesh.quad(cloth + np.array([0.006, 0, 0]), uv, Material.SIGN)
    mesh.quad((cloth - [0.006, 0, 0])[[1, 0, 3, 2]], uv, Material.SIGN)
    return mesh.build()


def path_lamp() -> Mesh:
    """A globe on a low post, as beside footpaths."""
    mesh = MeshBuilder()
    mesh.tube([[0.0, 0, 0], [0, 0, 0.5], [0, 0, 3.6]], [0.09, 0.055, 0.045], 12, Material.METAL)
    mesh.ellipsoid([0, 0, 3.85], [0.24, 0.24, 0.26], Material.LENS)
    return mesh.build()


def lot_lamp() -> Mesh:
    """A straight pole on a concrete foot with two square heads, as in car parks."""
    mesh = MeshBuilder()
    mesh.tube([[0.0, 0, 0], [0, 0, 0.75]], [0.28, 0.28], 14, Material.KERB, cap=True)
    mesh.tube([[0, 0, 0.75], [0, 0, 7.6]], [0.07, 0.07], 8, Material.METAL)
    for side in (-1, 1):
        mesh.box([side * 0.55, 0, 7.55], [0.7, 0.36, 0.16], Material.METAL)
        mesh.box([side * 0.2, 0, 7.5], [0.3, 0.06, 0.06], Material.METAL)
    return mesh.build()
