"""What wet ground mirrors: things that are in the picture already, found by walking along the mirrored ray.

Screen-space reflection (Sousa, Kasyan and Schulz, "Secrets of CryENGINE 3 graphics technology", 2011). The picture is
shaded from the top row down, and what level ground mirrors lies above it in the picture.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scpf.sample_logs.kernels import inlined, minus, part
from scpf.sample_logs.shading_textures import GRAIN, plane_noise

TABLE_STEP = 16
"""Samples of the buffer from one entry of the table to the next."""
NEARNESS_STEP = 4
STEPS, FIRST_STEP_M, GROWTH = 9, 0.5, 1.55
"""The last step reaches some 50 m."""
RIPPLES = 0.035
EDGE_SHARE = 0.12
LEAST_SHARE = 0.06
"""Less mirrored light than this is not worth the walk: the sky stands for it."""


class PixelTable(NamedTuple):
    """Which pixel of the image shows a place of the buffer, at every 16th sample."""

    column: NDArray[np.float32]
    row: NDArray[np.float32]


class Done(NamedTuple):
    """What is finished of the picture while it is being shaded."""

    image: Any
    """(H, W, 3), the rows above the one at hand."""
    nearness: Any
    """Of the whole buffer, every 4th sample in each direction: small enough to stay in the cache."""
    table: Any


@part
def rippled(noise: Any, point: Any, reflected: Any, gloss: Any) -> Any:
    """A mirrored direction, disturbed by drops in a puddle, and more by the grain of wet asphalt."""
    x, y, z = reflected
    ripple = RIPPLES * (1.2 - gloss) * plane_noise(noise, GRAIN, point, 0.7, 0.02)
    return x + ripple, y - ripple, max(z + ripple, 0.01)


@part
def _in_camera(T_map_camera: Any, a: Any) -> Any:
    """A direction of map in the camera's frame."""
    T = T_map_camera
    return (
        T[0, 0] * a[0] + T[1, 0] * a[1] + T[2, 0] * a[2],
        T[0, 1] * a[0] + T[1, 1] * a[1] + T[2, 1] * a[2],
        T[0, 2] * a[0] + T[1, 2] * a[1] + T[2, 2] * a[2],
    )


@part
def _pixel(table: Any, x: Any, y: Any) -> Any:
    """Row and column of the image that show the place (x, y) of the buffer."""
    i, j = int(x / TABLE_STEP), int(y / TABLE_STEP)
    right, down = x / TABLE_STEP - i, y / TABLE_STEP - j
    w_a, w_b = (1 - right) * (1 - down), right * (1 - down)
    w_c, w_d = (1 - right) * down, right * down
    column, row = table.column, table.row
    return (
        row[j, i] * w_a + row[j, i + 1] * w_b + row[j + 1, i] * w_c + row[j + 1, i + 1] * w_d,
        column[j, i] * w_a + column[j, i + 1] * w_b + column[j + 1, i] * w_c + column[j + 1, i + 1] * w_d,
    )


@inlined
def mirrored_thing(done: Any, row: Any, eye: Any, point: Any, reflected: Any, jitter: Any) -> Any:
    """How far the mirrored ray from a point is known to meet a thing that the rows above show, 0 to 1, and the
    thing's colour; what lies near the upper edge of the picture fades, for beyond it nothing is known."""
    T, image, nearness = eye.T_map_camera, done.image, done.nearness
    start = _in_camera(T, minus(point, (T[0, 3], T[1, 3], T[2, 3])))
    step = _in_camera(T, reflected)
    rows, columns = nearness.shape
    trust, thing = 0.0, (0.0, 0.0, 0.0)
    length, away = FIRST_STEP_M, FIRST_STEP_M * (0.5 + jitter)
    for _ in range(STEPS):
        depth = start[2] + step[2] * away
        if depth <= 0.2:
            break
        x = eye.focal * (start[0] + step[0] * away) / depth + eye.centre_x
        y = eye.focal * (start[1] + step[1] * away) / depth + eye.centre_y
        i, j = int(y / NEARNESS_STEP), int(x / NEARNESS_STEP)
        if x < 0.0 or y < 0.0 or i >= rows or j >= columns:
            break
        near = nearness[i, j]
        # A face a little nearer than the ray is one that the ray has just gone behind.
        if near * depth > 1.0 and near * (depth - 1.5 * length - 0.3) < 1.0:
            at_row, at_column = _pixel(done.table, x, y)
            i, j = int(at_row), int(at_column)
            if 0 <= i < row and 0 <= j < image.shape[1]:
                trust = min(1.0, i / (EDGE_SHARE * image.shape[0]))
                thing = (np.float64(image[i, j, 0]), np.float64(image[i, j, 1]), np.float64(image[i, j, 2]))
            break
        length *= GROWTH
        away += length
    return trust, thing
