"""What the rasteriser works on: the buffer, the view, and the packed meshes, as kernels take them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

NO_FACE = -1


class Buffer(NamedTuple):
    """What is seen at each sample; both arrays (rows, columns)."""

    nearness: NDArray[np.float32]
    """1 / depth in a perspective view, height towards the viewer in an orthographic one: larger wins."""
    face: NDArray[np.int32]
    """Number of the face, counted over the drawn instances in their order; -1 where there is none."""


class View(NamedTuple):
    """How points of the view's frame (x right, y down, z forward) fall on the buffer."""

    is_orthographic: bool
    """Then x and y are buffer coordinates already, and larger z is nearer."""
    focal: float
    """In samples."""
    centre_x: float
    centre_y: float
    near_m: float


class Meshes(NamedTuple):
    """The packed prototypes of a Scene, as kernels take them."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    uv: NDArray[np.float32]
    normals: NDArray[np.float32]
    materials: NDArray[np.uint8]
    first_vertex: NDArray[np.int64]
    first_face: NDArray[np.int64]
    face_count: NDArray[np.int64]
    vertex_count: NDArray[np.int64]
    alpha_card: NDArray[np.int64]
    cull_backfaces: NDArray[np.bool_]


class Cards(NamedTuple):
    """Alpha of the leaf cards, all mip levels."""

    alpha: NDArray[np.uint8]
    offset: NDArray[np.int64]
    size: int


class Scratch(NamedTuple):
    """Room to work in; kernels allocate nothing themselves."""

    points: NDArray[np.float64]
    """(largest number of vertices, 3)."""
    polygon: NDArray[np.float64]
    """(4, 3), a triangle after the near plane has cut it."""


def empty_buffer(rows: int, columns: int) -> Buffer:
    """A buffer to be cleared and drawn into."""
    return Buffer(np.empty((rows, columns), np.float32), np.empty((rows, columns), np.int32))


def scratch_for(meshes: Meshes) -> Scratch:
    """Room to draw any of the prototypes."""
    return Scratch(np.zeros((int(meshes.vertex_count.max()), 3)), np.zeros((4, 3)))
