"""The lens: where each pixel of the distorted image looks in a wide pinhole buffer of twice its resolution."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.camera import Camera
from scpf.models.errors import InputError
from scpf.sample_logs.drawing_types import View
from scpf.sample_logs.shading_reflection import TABLE_STEP, PixelTable
from scpf.sample_logs.sub_samples import Pixels

SAMPLES_PER_PIXEL: Final = 2
"""Of the buffer, in each direction."""
MARGIN: Final = 2
LARGEST_BUFFER: Final = 80_000_000
"""Samples; 640 MB."""
LARGEST_ERROR_PX: Final = 0.05
NEAR_M: Final = 0.15
SMALLEST_AXIAL: Final = 0.26
"""Cosine of the largest angle off the axis."""


@dataclass(frozen=True, eq=False)
class Lens:
    """A camera's rays, and the pinhole buffer that holds what they see."""

    rows: int
    columns: int
    view: View
    pixels: Pixels
    x: NDArray[np.float32]
    """(H, W), x / z of the ray of each pixel in the camera's frame."""
    y: NDArray[np.float32]
    vignetting: NDArray[np.float32]
    """(H, W), share of the light that reaches a pixel."""
    table: PixelTable
    edges: tuple[float, float, float, float]
    """Smallest and largest x / z, then y / z, that the buffer holds."""
    pixel_rad: float
    """Angle that a pixel in the middle covers."""


def lens_of(camera: Camera) -> Lens:
    """The lens of any camera whose rays all go forward.

    Raises InputError where the lens model cannot be inverted over the image, or sees too wide for a pinhole buffer.
    """
    x, y = _ray_slopes(camera)
    focal = SAMPLES_PER_PIXEL * float(camera.matrix[0, 0])
    edges = float(x.min()), float(x.max()), float(y.min()), float(y.max())
    columns = math.ceil((edges[1] - edges[0]) * focal) + 2 * MARGIN
    rows = math.ceil((edges[3] - edges[2]) * focal) + 2 * MARGIN
    if rows * columns > LARGEST_BUFFER:
        hint = "the simulator draws wide lenses at smaller sizes"
        raise InputError(f"the lens is too wide: it needs a buffer of {columns}×{rows} samples", hint)
    view = View(False, focal, MARGIN - edges[0] * focal, MARGIN - edges[2] * focal, NEAR_M)
    pixels = Pixels(
        (x * focal + view.centre_x).astype(np.float32), (y * focal + view.centre_y).astype(np.float32)
    )
    # Natural vignetting is cos⁴ = (1 + r²)⁻²; lenses of this kind are corrected to about half of it.
    vignetting = (1.0 + x * x + y * y) ** -0.8
    return Lens(
        rows,
        columns,
        view,
        pixels,
        x.astype(np.float32),
        y.astype(np.float32),
        vignetting.astype(np.float32),
        _pixel_table(camera, view, rows, columns),
        edges,
        1.0 / float(camera.matrix[0, 0]),
    )


def _ray_slopes(camera: Camera) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """x / z and y / z (H, W) of the ray through the middle of each pixel, checked against the projection."""
    height, width = camera.height_px, camera.width_px
    column, row = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    asked = np.column_stack([column.ravel(), row.ravel()])
    rays = camera.rays(asked)
    if not rays[:, 2].min() > SMALLEST_AXIAL:
        hint = "the simulator draws lenses that see up to 75° off their axis"
        raise InputError("the lens sees too wide for a pinhole buffer", hint)
    coarse = slice(None, None, 97)
    off = np.abs(camera.project(rays[coarse]) - asked[coarse])
    corners = [0, width - 1, (height - 1) * width, height * width - 1]
    off_corners = np.abs(camera.project(rays[corners]) - asked[corners])
    worst = max(float(off.max()), float(off_corners.max()))
    if not worst <= LARGEST_ERROR_PX:
        raise InputError(
            f"the lens model cannot be inverted over the image: off by up to {worst:.2g} px",
            "are the distortion coefficients those of this image size?",
        )
    shape = (height, width)
    return (rays[:, 0] / rays[:, 2]).reshape(shape), (rays[:, 1] / rays[:, 2]).reshape(shape)


def _pixel_table(camera: Camera, view: View, rows: int, columns: int) -> PixelTable:
    """Where in the image the lens shows places of the buffer."""
    x, y = np.meshgrid(
        np.arange(0, columns + TABLE_STEP, TABLE_STEP), np.arange(0, rows + TABLE_STEP, TABLE_STEP)
    )
    slopes = [(x - view.centre_x) / view.focal, (y - view.centre_y) / view.focal]
    pixels = camera.project(np.stack([*slopes, np.ones(x.shape)], axis=-1).reshape(-1, 3))
    column, row = pixels.T.reshape(2, *x.shape).astype(np.float32)
    return PixelTable(np.ascontiguousarray(column), np.ascontiguousarray(row))
