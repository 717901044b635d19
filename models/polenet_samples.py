"""Training samples of PoleNet: labelled images, their augmentation, and the targets of the three heads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from scpf.models.errors import DamagedError, MissingError
from scpf.models.grouping import CENTRE_CELL_PX, OFFSET_CELL_PX, OFFSET_SCALE_PX
from scpf.models.instances import Image
from scpf.models.segmentation import PADDING_GREY

IGNORED_ID = 255  # lamps that are neither wanted nor to be called background
LEAST_HEIGHT_PX, LEAST_AREA_PX = 24, 30  # smaller instances are neither taught nor punished
CENTRE_SPREAD_CELLS = (0.7, 1.2)  # x, y: deviation of the Gaussian on the centre map

Ids = NDArray[np.uint8]
FloatMap = NDArray[np.float32]


class LabelledImage(NamedTuple):
    """Paths of an image and of its instance ids (0 background, 1 to 254 poles, 255 ignored)."""

    image: Path
    ids: Path

    def read(self) -> tuple[Image, Ids]:
        """Image (H, W, 3) uint8 RGB and ids (H, W) uint8."""
        bgr = cv2.imread(str(self.image), cv2.IMREAD_COLOR)
        ids = cv2.imread(str(self.ids), cv2.IMREAD_UNCHANGED)
        if bgr is None or ids is None or ids.ndim != 2 or ids.shape != bgr.shape[:2] or ids.dtype != np.uint8:
            raise DamagedError(f"{self.image}: image or ids ({self.ids.name}) unreadable, or of another size")
        return np.asarray(bgr[:, :, ::-1]), np.asarray(ids)


def labelled_images(folder: Path) -> list[LabelledImage]:
    """All NAME.jpg or NAME.png of a folder that have a NAME.ids.png or (beside a .jpg) a NAME.png."""
    found = []
    for path in sorted(folder.iterdir()) if folder.is_dir() else []:
        if path.suffix not in (".jpg", ".png") or path.name.endswith(".ids.png"):
            continue
        candidates = [path.with_suffix(".ids.png")]
        if path.suffix == ".jpg":
            candidates.append(path.with_suffix(".png"))
        found += [LabelledImage(path, ids) for ids in candidates if ids.is_file()][:1]
    if not found:
        raise MissingError(
            f"{folder}: no labelled images", "NAME.jpg beside NAME.ids.png (uint8 instance ids)"
        )
    return found


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


def make_sample(source: LabelledImage, size_px: tuple[int, int], rng: np.random.Generator) -> Sample:
    """A random crop of ``size_px`` (width, height) at a random scale, flipped and degraded at random."""
    image, ids = source.read()
    image, ids, scale = _crop(image, ids, size_px, rng)
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
) -> tuple[Image, Ids, float]:
    """The crop and the scale (network px per image px) that it is to be shown at.

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
    return image[part], ids[part], scale


def degrade(image: Image, rng: np.random.Generator) -> Image:
    """What cameras do to colours: grey, swapped or tinted channels, exposure, haze, blur, noise, JPEG."""
    if rng.random() < 0.4:
        weights = rng.dirichlet((2.0, 4.0, 2.0)).astype(
            np.float32
        )  # grey cameras differ in spectral response
        image = np.repeat(cv2.transform(image, weights[None])[..., None], 3, axis=2)
    elif rng.random() < 0.4:
        image = image[:, :, rng.permutation(3)]
    levels = np.arange(256, dtype=np.float32) / 255
    contrast = rng.uniform(0.25, 0.6) if rng.random() < 0.2 else rng.uniform(0.7, 1.4)
    tone = (levels ** rng.uniform(0.6, 1.7) - 0.5) * contrast + 0.5 + rng.uniform(-0.18, 0.18)
    tint = rng.uniform(0.92, 1.08, 3) if rng.random() < 0.5 else np.ones(3)
    table = np.clip(255 * tone[:, None] * tint, 0, 255).astype(np.uint8)[None]
    image = np.asarray(cv2.LUT(np.ascontiguousarray(image), table), np.uint8)
    if rng.random() < 0.3:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), rng.uniform(0.3, 1.3)), np.uint8)
    if rng.random() < 0.5:
        channels = 1 if rng.random() < 0.5 else 3
        noise = rng.standard_normal((*image.shape[:2], channels), dtype=np.float32) * rng.uniform(0, 9)
        image = np.clip(image + noise, 0, 255).astype(np.uint8)
    if rng.random() < 0.25:
        written = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(35, 95))])[1]
        image = np.asarray(cv2.imdecode(written, cv2.IMREAD_COLOR), np.uint8)
    return image


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
        bump, peak = _bump(centre_px, cells)
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


def _bump(centre_px: NDArray[np.float64], cells: tuple[int, int]) -> tuple[FloatMap, tuple[int, int]]:
    """The Gaussian around the cell of a centre, and that cell (row, column)."""
    column, row = np.minimum(centre_px // CENTRE_CELL_PX, (cells[1] - 1, cells[0] - 1)).astype(int)
    spread_x, spread_y = CENTRE_SPREAD_CELLS
    across = np.exp(-((np.arange(cells[1]) - column) ** 2) / (2 * spread_x**2))
    down = np.exp(-((np.arange(cells[0]) - row) ** 2) / (2 * spread_y**2))
    return np.outer(down, across).astype(np.float32), (int(row), int(column))
