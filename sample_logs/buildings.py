"""Buildings: plain blocks whose windows the shading draws, with a cornice, a roof house and an entrance."""

from __future__ import annotations

import math

import numpy as np

from scpf.sample_logs.materials import Material
from scpf.sample_logs.mesh import Mesh, MeshBuilder


def building(rng: np.random.Generator, width_m: float, depth_m: float, height_m: float) -> Mesh:
    """A block centred on the origin with its entrance towards -y; uv of walls in metres along and up."""
    mesh = MeshBuilder()
    x, y = width_m / 2, depth_m / 2
    corners = np.array([(-x, -y), (x, -y), (x, y), (-x, y)])
    for i in range(4):
        a, b = corners[i], corners[(i + 1) % 4]
        length, middle = float(np.linalg.norm(b - a)), (a + b) / 2
        wall = [[*a, -0.5], [*b, -0.5], [*b, height_m], [*a, height_m]]
        u = 100.0 * i  # so that the windows of the four walls differ
        uv = [[u, -0.5], [u + length, -0.5], [u + length, height_m], [u, height_m]]
        mesh.quad(wall, uv, Material.FACADE)
        turn = math.atan2(b[1] - a[1], b[0] - a[0])
        mesh.box([*middle, height_m + 0.06], [length + 0.5, 0.5, 0.16], Material.PAVEMENT, turn)
    mesh.quad([[*corner, height_m - 0.35] for corner in corners], material=Material.PLAIN)
    across = rng.uniform(-0.3, 0.3, 2) * width_m
    mesh.box([across[0], 0, height_m + 1.2], [width_m * 0.22, depth_m * 0.35, 2.6], Material.PLAIN)
    mesh.box([across[1], -y - 1.0, 3.1], [5.5, 2.2, 0.25], Material.PAVEMENT)
    mesh.box([across[1], -y - 0.02, 1.25], [3.2, 0.12, 2.5], Material.GLASS)
    return mesh.build()
