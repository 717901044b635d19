"""Images into Mask R-CNN and masks out of it, each as the convention of the weights has it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
import torch.nn.functional as F
from PIL import Image as PillowImage
from torch import Tensor

from scpf.models.instances import BoolMask, Image
from scpf.models.maskrcnn_conventions import Convention

MASK_THRESHOLD = 0.5
MaskCrop = tuple[BoolMask, tuple[int, int]]  # bool (h, w), and x, y of its upper left pixel in the image


def network_size(
    size_px: Sequence[int], short_px: int, long_px: int, convention: Convention
) -> tuple[int, int]:
    """The (height, width) to which an image of ``size_px`` (height, width) is scaled."""
    height, width = size_px
    if not convention.antialias:
        scale = min(short_px / min(height, width), long_px / max(height, width))
        return max(1, int(height * scale)), max(1, int(width * scale))
    # Detectron2 scales the short side first and rounds once, at the end.
    scale = short_px / min(height, width)
    scaled = (short_px, scale * width) if height < width else (scale * height, float(short_px))
    if max(scaled) > long_px:
        shrink = long_px / max(scaled)
        scaled = (scaled[0] * shrink, scaled[1] * shrink)
    return max(1, int(scaled[0] + 0.5)), max(1, int(scaled[1] + 0.5))


def network_image(image: Image, short_px: int, long_px: int, convention: Convention) -> Tensor:
    """An image (H, W, 3), uint8 RGB, scaled for the network: (3, h, w), 0 to 255, not normalised."""
    height, width = network_size(image.shape[:2], short_px, long_px, convention)
    if convention.antialias:
        shrunk = PillowImage.fromarray(image).resize((width, height), PillowImage.Resampling.BILINEAR)
        return torch.from_numpy(np.array(shrunk)).permute(2, 0, 1)
    x = torch.from_numpy(np.ascontiguousarray(image)).permute(2, 0, 1).float()
    # torchvision scales by the factor, not by the ratio of the sizes, which the rounding has changed a little.
    factor = min(short_px / min(image.shape[:2]), long_px / max(image.shape[:2]))
    return F.interpolate(x[None], scale_factor=factor, mode="bilinear", recompute_scale_factor=True)[0]


def paste(
    mask: Tensor, box: Sequence[float], size_px: Sequence[int], convention: Convention
) -> MaskCrop | None:
    """The mask (28, 28) of ``box`` (x1, y1, x2, y2) at the resolution of an image (height, width); None if empty."""
    crop = (_pasted_whole if convention.pasted_whole else _pasted)(mask, box, size_px)
    if crop is None:
        return None
    soft, (left, top) = crop
    inside = (soft >= MASK_THRESHOLD).numpy()
    rows, columns = np.flatnonzero(inside.any(1)), np.flatnonzero(inside.any(0))
    if not len(rows):
        return None
    tight = inside[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].copy()
    return tight, (left + int(columns[0]), top + int(rows[0]))


def _pasted(
    mask: Tensor, box: Sequence[float], size_px: Sequence[int]
) -> tuple[Tensor, tuple[int, int]] | None:
    """As Detectron2 pastes: the mask sampled at the centre of each pixel."""
    height, width = size_px
    left, top = max(int(np.floor(box[0])) - 1, 0), max(int(np.floor(box[1])) - 1, 0)
    right, bottom = min(int(np.ceil(box[2])) + 1, width), min(int(np.ceil(box[3])) + 1, height)
    if right <= left or bottom <= top:
        return None
    corners = torch.tensor(box, dtype=torch.float32)
    x = (torch.arange(left, right) + 0.5 - corners[0]) / (corners[2] - corners[0]) * 2 - 1
    y = (torch.arange(top, bottom) + 0.5 - corners[1]) / (corners[3] - corners[1]) * 2 - 1
    grid = torch.stack(torch.meshgrid(x, y, indexing="xy"), -1)
    return F.grid_sample(mask[None, None], grid[None], align_corners=False)[0, 0], (left, top)


def _pasted_whole(
    mask: Tensor, box: Sequence[float], size_px: Sequence[int]
) -> tuple[Tensor, tuple[int, int]] | None:
    """As torchvision pastes: padded by one cell, then scaled to the box on whole pixels."""
    height, width = size_px
    padded = F.pad(mask, (1, 1, 1, 1))
    grown = padded.shape[0] / mask.shape[0]
    x1, y1, x2, y2 = torch.tensor(box, dtype=torch.float32)
    half_width, half_height = (x2 - x1) * 0.5 * grown, (y2 - y1) * 0.5 * grown
    centre_x, centre_y = (x2 + x1) * 0.5, (y2 + y1) * 0.5
    left, right = int(centre_x - half_width), int(centre_x + half_width)
    top, bottom = int(centre_y - half_height), int(centre_y + half_height)
    size = (max(bottom - top + 1, 1), max(right - left + 1, 1))
    soft = F.interpolate(padded[None, None], size=size, mode="bilinear", align_corners=False)[0, 0]
    x_from, y_from = max(left, 0), max(top, 0)
    x_to, y_to = min(right + 1, width), min(bottom + 1, height)
    if x_to <= x_from or y_to <= y_from:
        return None
    return soft[y_from - top : y_to - top, x_from - left : x_to - left], (x_from, y_from)
