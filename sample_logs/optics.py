"""What lens and movement do to the picture before the sensor: scattered light, motion blur, point spread."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from scpf.sample_logs.kernels import kernel

Image = NDArray[np.float32]
BRIGHT, BRIGHTEST = 1.6, 12.0
"""Light above the first scatters visibly; more than the second is not counted."""
SCATTERED = 0.55
LEAST_BLUR_PX = 0.8


def add_glare(image: Image) -> None:
    """Add the halos that bright lights get in the lens, to ``image`` (H, W, 3), in place."""
    height, width = image.shape[:2]
    # A width of the halo that is a share of the picture's, whatever its size.
    small = cv2.resize(image, (max(1, width // 8), max(1, height // 8)), interpolation=cv2.INTER_AREA)
    bright = np.minimum(np.maximum(small - BRIGHT, 0), BRIGHTEST)
    sizes = (3 * width / 2048, 12 * width / 2048)
    halo = sum(cv2.GaussianBlur(bright, (0, 0), max(size, 0.3)) for size in sizes)
    image += cv2.resize(halo, (width, height), interpolation=cv2.INTER_LINEAR) * np.float32(SCATTERED / 2)


def point_spread(image: Image) -> Image:
    """The picture (H, W, 3) as the lens draws it: a point becomes a spot of about half a pixel."""
    sigma_px = 0.12 + 0.55 * image.shape[1] / 2048
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px, borderType=cv2.BORDER_REPLICATE), np.float32)


def motion_blur(
    image: Image,
    depth_m: NDArray[np.float32],
    x: NDArray[np.float32],
    y: NDArray[np.float32],
    focal_px: tuple[float, float],
    velocity_mps: NDArray[np.float64],
    rate_radps: NDArray[np.float64],
    exposure_s: float,
    blurred: Image,
) -> None:
    """Fill ``blurred`` with the picture smeared by the movement of the camera during the exposure, about its middle.

    ``velocity_mps`` and ``rate_radps`` (3,) are in the camera's frame; ``x`` and ``y`` (H, W) are the slopes of the
    rays. Flow of a still scene: Longuet-Higgins and Prazdny, "The interpretation of a moving retinal image" (1980).
    """
    v, w = velocity_mps, rate_radps
    movement = (float(v[0]), float(v[1]), float(v[2]), float(w[0]), float(w[1]), float(w[2]))
    _smear(image, depth_m, x, y, (focal_px[0] * exposure_s, focal_px[1] * exposure_s), movement, blurred)


@kernel
def _smear(image: Any, depth_m: Any, x: Any, y: Any, scale: Any, movement: Any, blurred: Any) -> None:
    rows, columns = depth_m.shape
    vx, vy, vz, wx, wy, wz = movement
    for row in range(rows):
        for column in range(columns):
            a, b, near = x[row, column], y[row, column], 1.0 / depth_m[row, column]
            across = ((-vx + a * vz) * near + a * b * wx - (1 + a * a) * wy + b * wz) * scale[0]
            down = ((-vy + b * vz) * near + (1 + b * b) * wx - a * b * wy - a * wz) * scale[1]
            length = math.sqrt(across * across + down * down)
            if length < LEAST_BLUR_PX:
                for c in range(3):
                    blurred[row, column, c] = image[row, column, c]
                continue
            count = min(9, 3 + int(length * 0.5))
            red = green = blue = 0.0
            taken = 0
            for k in range(count):
                moment = (k + 0.5) / count - 0.5
                i, j = math.floor(column + across * moment + 0.5), math.floor(row + down * moment + 0.5)
                if 0 <= i < columns and 0 <= j < rows:
                    red += image[j, i, 0]
                    green += image[j, i, 1]
                    blue += image[j, i, 2]
                    taken += 1
            # The middle moment is always within the picture, or next to it where the count is even.
            if taken == 0:
                red, green, blue = image[row, column, 0], image[row, column, 1], image[row, column, 2]
                taken = 1
            blurred[row, column, 0] = red / taken
            blurred[row, column, 1] = green / taken
            blurred[row, column, 2] = blue / taken
