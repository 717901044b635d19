"""Training samples of PoleNet: crops of labelled images, and the targets of the three heads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from scpf.models.augmentation import degrade
from scpf.models.grouping import CENTRE_CELL_PX, OFFSET_CELL_PX, OFFSET_SCALE_PX
from scpf.models.instances import Image
from scpf.models.labelled_images import IGNORED_ID, Ids, LabelledImage
from scpf.models.pole_pasting import paste_poles
from scpf.models.segmentation import PADDING_GREY

LEAST_HEIGHT_PX, LEAST_AREA_PX = 24, 30  # smaller instances are neither taught nor punished
LEAST_SPREAD_CELLS = (0.7, 1.2)  # x, y: deviation of the Gaussian on the centre map,
SPREAD_SHARE = (0.2, 0.1)  # and that of a large pole, as a share of its width at the centre and of its height
HORIZON = 0.48  # where it lies, as a share of a picture's height, for all that is known

FloatMap = NDArray[np.float32]


class Sample(NamedTuple):
    """An augmented image with its targets; cells as in `grouping`.

    ``image`` (H, W, 3) uint8; ``cover`` (H, W) share of the pixel that is pole; ``valid`` (H, W) 0 where ignored;
    ``centre`` (H/8, W/8) with 1 at a centre; ``centre_valid`` likewise; ``offsets`` (2, H/4, W/4);
    ``offsets_valid`` (H/4, W/4).
    """

    image: Image
    cover: FloatMap
    valid: FloatMap
    centre: FloatMap
    centre_valid: FloatMap
    offsets: FloatMap
    offsets_valid: FloatMap


def make_sample(
    source: LabelledImage,
    size_px: tuple[int, int],
    rng: np.random.Generator,
    donor: LabelledImage | None = None,
) -> Sample:
    """A random crop of ``size_px`` (width, height) at a random scale, flipped and degraded at random.

    Poles of the ``donor``, where there is one, are pasted into it.
    """
    picture = source.read()
    image, ids, scale, top = _crop(picture.image, picture.ids(), size_px, rng)
    if donor is not None:
        image, ids = image.copy(), ids.copy()
        paste_poles(image, ids, donor.read(), HORIZON * len(picture.image) - top, rng)
    if rng.random() < 0.5:
        image, ids = image[:, ::-1], ids[:, ::-1]
    image = np.ascontiguousarray(image)
    width, height = size_px
    shown = (round(image.shape[1] * scale), round(image.shape[0] * scale))
    shown = (max(1, min(shown[0], width)), max(1, min(shown[1], height)))
    method = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    framed = np.full((height, width, 3), PADDING_GREY, np.uint8)
    framed[: shown[1], : shown[0]] = degrade(
        np.asarray(cv2.resize(image, shown, interpolation=method), np.uint8), rng
    )
    return targets(framed, np.ascontiguousarray(ids), shown)


def _crop(
    image: Image, ids: Ids, size_px: tuple[int, int], rng: np.random.Generator
) -> tuple[Image, Ids, float, int]:
    """The crop, the scale (network px per image px) that it is to be shown at, and its first row.

    Half of the samples look near a pole. A fifth is zoomed in so far that a pole fills the frame, and a fifth zoomed
    out so far that poles are tiny.
    """
    scales = ((0.7, 1.35), (1.35, 3.2), (0.3, 0.7))[rng.choice(3, p=[0.6, 0.2, 0.2])]
    scale = float(np.exp(rng.uniform(*np.log(scales))))
    height, width = ids.shape
    wide, high = min(width, int(size_px[0] / scale)), min(height, int(size_px[1] / scale))
    x1, y1 = int(rng.integers(0, width - wide + 1)), int(rng.integers(0, height - high + 1))
    pixels = np.flatnonzero((ids > 0) & (ids < IGNORED_ID)) if rng.random() < 0.5 else np.zeros(0, np.int64)
    if len(pixels):
        y, x = divmod(int(rng.choice(pixels)), width)
        x1 = int(np.clip(x - rng.uniform(0.1, 0.9) * wide, 0, width - wide))
        y1 = int(np.clip(y - rng.uniform(0.1, 0.9) * high, 0, height - high))
    part = np.s_[y1 : y1 + high, x1 : x1 + wide]
    return image[part], ids[part], scale, y1


def targets(framed: Image, ids: Ids, shown_px: Sequence[int]) -> Sample:
    """Targets of ``ids``, which cover the upper left ``shown_px`` (width, height) of the ``framed`` image."""
    height, width = framed.shape[:2]
    shown_width, shown_height = shown_px
    scale = np.array([shown_width / ids.shape[1], shown_height / ids.shape[0]])
    cover, valid = np.zeros((height, width), np.float32), np.ones((height, width), np.float32)
    cover[:shown_height, :shown_width] = _shrink(
        ((ids > 0) & (ids < IGNORED_ID)).astype(np.float32), shown_px
    )
    ignored = ids == IGNORED_ID
    if ignored.any():
        valid[:shown_height, :shown_width] = _shrink(ignored.astype(np.float32), shown_px) < 0.05
    cells = (height // CENTRE_CELL_PX, width // CENTRE_CELL_PX)
    centre, centre_valid = np.zeros(cells, np.float32), np.ones(cells, np.float32)
    centre_valid[cv2.resize(valid, cells[::-1], interpolation=cv2.INTER_AREA) < 0.9] = 0
    quarter = (height // OFFSET_CELL_PX, width // OFFSET_CELL_PX)
    offsets, offsets_valid = np.zeros((2, *quarter), np.float32), np.zeros(quarter, np.float32)
    for i, box in enumerate(ndimage.find_objects(ids), start=1):
        if box is None or i == IGNORED_ID:
            continue
        y, x = np.nonzero(ids[box] == i)
        corner = np.array([box[1].start, box[0].start])
        middle = centre_of(x, y, box[0].stop - box[0].start)
        centre_px = (corner + middle) * scale
        high, area = (box[0].stop - box[0].start) * scale[1], len(x) * scale.prod()
        bump, peak = _bump(centre_px, (area / high, high), cells)
        if high < LEAST_HEIGHT_PX or area < LEAST_AREA_PX:
            centre_valid[bump > 0.1] = 0
            continue
        np.maximum(centre, bump, out=centre)
        centre[peak] = 1.0
        centre_valid[peak] = 1.0
        column = (((x + corner[0] + 0.5) * scale[0]) // OFFSET_CELL_PX).astype(int)
        row = (((y + corner[1] + 0.5) * scale[1]) // OFFSET_CELL_PX).astype(int)
        for axis, cell in enumerate((column, row)):
            cell_px = (cell + 0.5) * OFFSET_CELL_PX
            offsets[axis, row, column] = (centre_px[axis] - cell_px) / OFFSET_SCALE_PX[axis]
        offsets_valid[row, column] = 1
    return Sample(framed, cover, valid, centre, centre_valid, offsets, offsets_valid)


def centre_of(x: NDArray[np.int64], y: NDArray[np.int64], height: int) -> tuple[float, float]:
    """Centre of an instance of pixels (x, y) in its box: half height, and the median column there."""
    middle = height / 2
    central = np.abs(y + 0.5 - middle) <= max(3.0, 0.15 * height)
    return float(np.median(x[central] if central.any() else x)) + 0.5, middle


def _shrink(share: FloatMap, size_px: Sequence[int]) -> FloatMap:
    method = cv2.INTER_AREA if size_px[0] < share.shape[1] else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(share, tuple(size_px), interpolation=method), np.float32)


def _bump(
    centre_px: NDArray[np.float64], size_px: tuple[float, float], cells: tuple[int, int]
) -> tuple[FloatMap, tuple[int, int]]:
    """The Gaussian around the cell of a centre, and that cell (row, column).

    ``size_px``: (mean width, height) of the pole. Where half its height lies is seen the less exactly the taller it is.
    """
    column, row = np.minimum(centre_px // CENTRE_CELL_PX, (cells[1] - 1, cells[0] - 1)).astype(int)
    spread_x, spread_y = (
        max(least, share * size / CENTRE_CELL_PX)
        for least, share, size in zip(LEAST_SPREAD_CELLS, SPREAD_SHARE, size_px, strict=True)
    )
    across = np.exp(-((np.arange(cells[1]) - column) ** 2) / (2 * spread_x**2))
    down = np.exp(-((np.arange(cells[0]) - row) ** 2) / (2 * spread_y**2))
    return np.outer(down, across).astype(np.float32), (int(row), int(column))
