"""The ground: road, kerbs, pavements and lawns along the centre line, and the plain around them."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from scpf.sample_logs.centre_line import CentreLine
from scpf.sample_logs.materials import Material
from scpf.sample_logs.mesh import MeshBuilder
from scpf.sample_logs.scene import SceneBuilder

LANE_HALF_WIDTH_M = 3.7
CHUNK_M, STEP_M = 45.0, 1.5
PLAIN_M, PLAIN_STEP_M, PLAIN_Z_M = 1600.0, 200.0, -0.36


class _Edge(NamedTuple):
    offset_m: float
    height_m: float
    beyond: Material
    """What lies between this edge and the next one outwards."""


PROFILE = (
    _Edge(0.0, 0.0, Material.ASPHALT),
    _Edge(LANE_HALF_WIDTH_M, 0.0, Material.KERB),
    _Edge(3.75, 0.14, Material.KERB),
    _Edge(3.9, 0.14, Material.GRASS),
    _Edge(5.6, 0.15, Material.PAVEMENT),
    _Edge(7.2, 0.15, Material.GRASS),
    _Edge(16.0, -0.05, Material.GRASS),
    _Edge(26.0, -0.35, Material.GRASS),
)


def ground_height_m(offset_m: float) -> float:
    """Height above the centre line of the ground at offset_m from it, either side."""
    edges = [edge.offset_m for edge in PROFILE]
    return float(np.interp(abs(offset_m), edges, [edge.height_m for edge in PROFILE]))


def add_ground(scene: SceneBuilder, centre_line: CentreLine, start_m: float, stop_m: float) -> None:
    """Lay the road from start_m to stop_m in chunks, each a prototype of its own, and the plain below."""
    for chunk_start in np.arange(start_m, stop_m, CHUNK_M):
        _add_chunk(scene, centre_line, float(chunk_start))
    middle = centre_line.at((start_m + stop_m) / 2, 0.0)[0]
    ticks = np.arange(-PLAIN_M, PLAIN_M + 1, PLAIN_STEP_M)
    east, north = np.meshgrid(ticks, ticks)
    n, faces = len(ticks), []
    for i in range(n - 1):
        for j in range(n - 1):
            corner = i * n + j
            faces += [[corner, corner + 1, corner + n], [corner + 1, corner + n + 1, corner + n]]
    plain = MeshBuilder()
    points = np.column_stack([east.ravel(), north.ravel(), np.full(east.size, PLAIN_Z_M)])
    plain.add(points, faces, material=Material.GRASS)
    scene.place(scene.add_prototype(plain.build()), middle, is_ground=True)


def _add_chunk(scene: SceneBuilder, centre_line: CentreLine, start_m: float) -> None:
    along = np.arange(start_m, start_m + CHUNK_M + 1e-6, STEP_M)
    positions, _, normals = centre_line.at(along)
    centre = positions.mean(axis=0)
    mesh = MeshBuilder()
    mirrored = [edge._replace(offset_m=-edge.offset_m) for edge in PROFILE[:0:-1]]
    edges = [*mirrored, *PROFILE]
    for right, left in pairwise(edges):
        material = min(right, left, key=lambda edge: abs(edge.offset_m)).beyond
        points, uv = [], []
        for s_m, position, normal in zip(along, positions, normals, strict=True):
            for edge in (right, left):
                across = np.append(normal * edge.offset_m, edge.height_m)
                points.append(position + across - centre)
                uv.append([s_m, edge.offset_m])
        faces = []
        for i in range(0, 2 * (len(along) - 1), 2):
            faces += [[i, i + 2, i + 1], [i + 1, i + 2, i + 3]]
        mesh.add(points, faces, uv, material=material, smooth=True)
    # The parameters: a crossing every 137 m, the first 61 m along.
    scene.place(scene.add_prototype(mesh.build()), centre, parameters=(137.0, 61.0), is_ground=True)
