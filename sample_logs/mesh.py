"""Triangle meshes and the few shapes that everything in the simulated world is put together from.

Coordinates are metres in the object's own frame: x forward (or towards the road), y left, z up, faces
counter-clockwise seen from outside.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scpf.sample_logs.materials import Material

Floats = NDArray[np.float64]


class Mesh(NamedTuple):
    """One triangle mesh: V vertices, F faces; texture coordinates and normals belong to face corners."""

    vertices: NDArray[np.float32]
    """(V, 3), metres."""
    faces: NDArray[np.int32]
    """(F, 3), indices of vertices."""
    uv: NDArray[np.float32]
    """(F, 3, 2), metres along the surface, or 0..1 over a card or a sign."""
    normals: NDArray[np.float32]
    """(F, 3, 3), unit length."""
    materials: NDArray[np.uint8]
    """(F,), numbers of Material."""


class MeshBuilder:
    """Collects shapes and joins them to one Mesh."""

    def __init__(self) -> None:
        self._parts: list[tuple[Any, ...]] = []
        self._vertex_count = 0

    def add(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        uv: ArrayLike | None = None,
        normals: ArrayLike | None = None,
        material: ArrayLike = Material.PLAIN,
        smooth: bool = False,
    ) -> None:
        """Add triangles: vertices (V, 3), faces (F, 3); uv (V, 2) or (F, 3, 2), normals (V, 3) or (F, 3, 3).

        Without normals each face gets its own, or with ``smooth`` the mean around each vertex.
        ``material`` is one number or one per face.
        """
        points = np.asarray(vertices, np.float64)
        index = np.asarray(faces, np.int64).reshape(-1, 3)
        corner_uv = np.zeros((len(index), 3, 2)) if uv is None else np.asarray(uv, np.float64)
        if corner_uv.ndim == 2:
            corner_uv = corner_uv[index]
        if normals is None:
            corner_normals = _normals(points, index, smooth)
        else:
            given = np.asarray(normals, np.float64)
            corner_normals = given[index] if given.ndim == 2 else given
        numbers = np.broadcast_to(np.asarray(material, np.uint8), (len(index),))
        self._parts.append((points, index + self._vertex_count, corner_uv, unit(corner_normals), numbers))
        self._vertex_count += len(points)

    def quad(
        self, corners: ArrayLike, uv: ArrayLike | None = None, material: Material = Material.PLAIN
    ) -> None:
        """Add the flat four-cornered face ``corners`` (4, 3)."""
        self.add(corners, [[0, 1, 2], [0, 2, 3]], uv, material=material)

    def tube(
        self,
        path: ArrayLike,
        radii_m: ArrayLike,
        sides: int,
        material: Material,
        cap: bool = False,
    ) -> None:
        """Add a tube of ``sides`` sides along path (n, 3) with one radius per point; ``cap`` closes its end."""
        points, radii = np.asarray(path, np.float64), np.asarray(radii_m, np.float64)
        angles = np.linspace(0, 2 * np.pi, sides, endpoint=False)
        rings, uv, length = [], [], 0.0
        across = np.array([1.0, 0, 0]) if abs(points[1, 2] - points[0, 2]) > 0 else np.array([0, 0, 1.0])
        for i, point in enumerate(points):
            along = unit(points[min(i + 1, len(points) - 1)] - points[max(i - 1, 0)])
            across = unit(across - along * (across @ along))
            third = np.cross(along, across)
            if i:
                length += float(np.linalg.norm(point - points[i - 1]))
            rings.append(
                point + radii[i] * (np.outer(np.cos(angles), across) + np.outer(np.sin(angles), third))
            )
            uv.append(np.column_stack([angles / (2 * np.pi), np.full(sides, length)]))
        self.add(
            np.concatenate(rings),
            strip_faces(len(points), sides, closed=True),
            np.concatenate(uv),
            material=material,
            smooth=True,
        )
        if cap:
            lid = [[i, (i + 1) % sides, sides] for i in range(sides)]
            self.add(np.vstack([rings[-1], points[-1:]]), lid, material=material)

    def box(self, centre_m: ArrayLike, size_m: ArrayLike, material: Material, yaw_rad: float = 0.0) -> None:
        """Add a box of size_m (3,) about centre_m (3,), turned by yaw_rad; uv in metres on each side."""
        half, turn = np.asarray(size_m, np.float64) / 2, rotation_z(yaw_rad)
        for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1), (2, 1), (2, -1)):
            out = np.eye(3)[axis] * sign
            u = np.eye(3)[0 if axis == 2 else 1 - axis] * (1 if axis == 2 else sign * (1 - 2 * axis))
            v = np.cross(out, u)
            a, b, d = np.abs(u) @ half, np.abs(v) @ half, half[axis]
            corners = [out * d + u * p * a + v * q * b for p, q in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            uv = [[0, 0], [2 * a, 0], [2 * a, 2 * b], [0, 2 * b]]
            self.quad(np.array(corners) @ turn.T + np.asarray(centre_m, np.float64), uv, material)

    def ellipsoid(
        self, centre_m: ArrayLike, radii_m: ArrayLike, material: Material, columns: int = 12, rows: int = 8
    ) -> None:
        """Add an ellipsoid about centre_m (3,) with radii_m (3,)."""
        polar = np.repeat(np.pi * np.arange(rows + 1) / rows, columns)
        round_ = np.tile(2 * np.pi * np.arange(columns) / columns, rows + 1)
        sphere = np.column_stack(
            [np.sin(polar) * np.cos(round_), np.sin(polar) * np.sin(round_), -np.cos(polar)]
        )
        radii = np.asarray(radii_m, np.float64)
        self.add(
            sphere * radii + np.asarray(centre_m, np.float64),
            strip_faces(rows + 1, columns, closed=True),
            normals=sphere / radii,
            material=material,
        )

    def build(self) -> Mesh:
        """The mesh of everything that was added."""
        vertices, faces, uv, normals, materials = (
            np.concatenate(parts) for parts in zip(*self._parts, strict=True)
        )
        return Mesh(
            vertices.astype(np.float32),
            faces.astype(np.int32),
            uv.astype(np.float32),
            normals.astype(np.float32),
            materials.astype(np.uint8),
        )


def strip_faces(rings: int, points: int, closed: bool) -> NDArray[np.int64]:
    """Faces (F, 3) that join ``rings`` rings of ``points`` points each, round to the first where closed."""
    faces = []
    for i in range(rings - 1):
        for j in range(points if closed else points - 1):
            a, b = i * points + j, i * points + (j + 1) % points
            faces += [[a, b, a + points], [b, b + points, a + points]]
    return np.array(faces, np.int64)


def rotation_z(yaw_rad: float) -> Floats:
    """The rotation (3, 3) by yaw_rad about z, counter-clockwise seen from above."""
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def unit(vectors: Floats) -> Floats:
    """The vectors (..., 3) at length 1; upwards where one has no length, as of a face without area."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    up = np.broadcast_to([0.0, 0.0, 1.0], vectors.shape)
    return np.where(lengths > 1e-12, vectors / np.maximum(lengths, 1e-12), up)


def _normals(points: Floats, faces: NDArray[np.int64], smooth: bool) -> Floats:
    a, b, c = (points[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    if not smooth:
        return np.repeat(unit(across)[:, None], 3, axis=1)
    sums = np.zeros_like(points)
    for k in range(3):
        np.add.at(sums, faces[:, k], across)
    return sums[faces]
