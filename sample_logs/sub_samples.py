"""The one rule by which a pixel of the distorted image looks at the pinhole buffer: four sub-samples.

Each pixel is cut into four squares; the rays through their middles decide. A pixel belongs to a pole when at least
two of them see it, in the picture's mask and when the pole is drawn alone: so a visible fraction is at most 1.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scpf.sample_logs.drawing_types import NO_FACE
from scpf.sample_logs.kernels import kernel, part

LEAST = 2
"""Sub-samples of the four that make a pixel part of a mask."""


class Pixels(NamedTuple):
    """Where the middle of each pixel lies in the buffer, (H, W) each, in samples."""

    x: NDArray[np.float32]
    y: NDArray[np.float32]


class SubSamples(NamedTuple):
    """The four sub-samples of the pixel at hand, (4,) each; kernels allocate nothing themselves."""

    face: NDArray[np.int64]
    """Number of the face that is seen."""
    pole: NDArray[np.int64]
    x: NDArray[np.float64]
    """Place in the buffer."""
    y: NDArray[np.float64]


def empty_sub_samples() -> SubSamples:
    """Room for the sub-samples of one pixel."""
    return SubSamples(np.zeros(4, np.int64), np.zeros(4, np.int64), np.zeros(4), np.zeros(4))


@part
def sub_sample_steps(pixels: Any, row: Any, column: Any) -> Any:
    """Middle of a pixel in the buffer, and the steps to the next pixel on the right and below."""
    rows, columns = pixels.x.shape
    x, y = pixels.x[row, column], pixels.y[row, column]
    right = 1 if column < columns - 1 else -1
    down = 1 if row < rows - 1 else -1
    return (
        x,
        y,
        (pixels.x[row, column + right] - x) * right,
        (pixels.y[row, column + right] - y) * right,
        (pixels.x[row + down, column] - x) * down,
        (pixels.y[row + down, column] - y) * down,
    )


@part
def look(samples: Any, steps: Any, faces: Any) -> None:
    """Enter the places of the four sub-samples in the buffer, and the faces (rows, columns) that are there."""
    rows, columns = faces.shape
    x, y, right_x, right_y, down_x, down_y = steps
    for k in range(4):
        across, below = (k & 1) * 0.5 - 0.25, (k >> 1) * 0.5 - 0.25
        samples.x[k] = x + across * right_x + below * down_x
        samples.y[k] = y + across * right_y + below * down_y
        i, j = int(samples.x[k]), int(samples.y[k])
        samples.face[k] = faces[min(max(j, 0), rows - 1), min(max(i, 0), columns - 1)]


@part
def majority(samples: Any) -> Any:
    """The pole that most of the four sub-samples see, the first of equals; 0 if none is seen by two."""
    best, most = 0, LEAST - 1
    for k in range(4):
        count = 0
        for other in range(4):
            if samples.pole[other] == samples.pole[k]:
                count += 1
        if samples.pole[k] > 0 and count > most:
            best, most = samples.pole[k], count
    return best


@kernel
def count_pixels(pixels: Any, faces: Any, rows: Any, columns: Any, bounds: Any, samples: Any) -> Any:
    """How many pixels of those rows and columns (first, after the last) see the one thing that is drawn within
    the bounds of the buffer (lowest x, lowest y, highest x, highest y)."""
    low_x, low_y, high_x, high_y = bounds
    total = 0
    for row in range(rows[0], rows[1]):
        for column in range(columns[0], columns[1]):
            x, y = pixels.x[row, column], pixels.y[row, column]
            if x < low_x or x > high_x or y < low_y or y > high_y:
                continue
            look(samples, sub_sample_steps(pixels, row, column), faces)
            for k in range(4):
                samples.pole[k] = 0 if samples.face[k] == NO_FACE else 1
            total += majority(samples)
    return total
