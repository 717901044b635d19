"""Instances: what a segmenter finds in an image, and the run-length form that logs and results store."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

BoolMask = NDArray[np.bool_]
Image = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Instance:
    """One segmented object of an image.

    ``box_px``: x1, y1, x2, y2 in pixels of the full image; x2 and y2 lie one past the last pixel.
    ``mask``: (h, w) bool, a crop whose upper left pixel is ``offset_px`` (x, y) of the full image.
    ``score``: probability, 0 to 1, that this is an instance of ``landmark_class``.
    ``landmark_id``: the landmark that it shows, where that is known (truth of a simulated drive), else "".
    """

    box_px: tuple[float, float, float, float]
    mask: BoolMask
    offset_px: tuple[int, int]
    score: float
    landmark_class: str = "light_pole"
    landmark_id: str = ""

    @property
    def width_px(self) -> float:
        """Width of the box (px)."""
        return self.box_px[2] - self.box_px[0]

    @property
    def height_px(self) -> float:
        """Height of the box (px)."""
        return self.box_px[3] - self.box_px[1]


class Segmenter(Protocol):
    """Anything that turns an image (H, W, 3), uint8, RGB into instances, best score first."""

    def __call__(self, image: Image) -> list[Instance]: ...


def encode_runs(mask: BoolMask) -> NDArray[np.uint32]:
    """Run lengths of ``mask`` (h, w), column by column, background first (COCO's uncompressed RLE)."""
    flat = np.concatenate(([False], mask.ravel(order="F"), [not mask[-1, -1] if mask.size else True]))
    edges = np.flatnonzero(flat[1:] != flat[:-1])
    return np.diff(np.concatenate(([0], edges))).astype(np.uint32)


def decode_runs(runs: Sequence[int] | NDArray[np.uint32], height_px: int, width_px: int) -> BoolMask:
    """The mask (height_px, width_px) of run lengths; ValueError where they do not add up to its size."""
    lengths = np.asarray(runs, dtype=np.int64)
    if height_px < 0 or width_px < 0 or lengths.sum() != height_px * width_px:
        raise ValueError(f"run lengths add up to {lengths.sum()}, not {height_px}×{width_px}")
    values = np.arange(len(lengths)) % 2 == 1
    return np.repeat(values, lengths).reshape((height_px, width_px), order="F")


def instance_from_mask(full: BoolMask, score: float = 1.0, landmark_id: str = "") -> Instance:
    """The instance of a full-image mask (H, W) with at least one pixel set."""
    rows, columns = np.flatnonzero(full.any(1)), np.flatnonzero(full.any(0))
    if not len(rows):
        raise ValueError("the mask is empty")
    y1, y2, x1, x2 = int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1
    return Instance(
        (float(x1), float(y1), float(x2), float(y2)), full[y1:y2, x1:x2].copy(), (x1, y1), score,
        landmark_id=landmark_id,
    )  # fmt: skip


def foot_px(instance: Instance) -> tuple[float, float]:
    """The pixel (x, y) where the pole stands: the middle of the mask's lowest tenth of rows.

    Lower than an arm or a lamp can reach, and, for an upright pole, at the bearing of its axis.
    """
    rows = max(1, instance.mask.shape[0] // 10)
    low = instance.mask[-rows:]
    columns = np.flatnonzero(low.any(0))
    x = 0.5 * (columns[0] + columns[-1]) if len(columns) else (instance.mask.shape[1] - 1) / 2
    return instance.offset_px[0] + float(x), instance.offset_px[1] + instance.mask.shape[0] - 1.0
