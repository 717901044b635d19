"""ROIAlign (He et al. 2017) in plain torch: features of boxes, on a grid of bins that is not rounded to cells.

A bin's value is the mean of bilinear samples. Sampling is separable, so the weights of a bin on the cells that it
touches are a product of those along x and those along y; `embedding_bag` then adds the weighted cells. It equals
the compiled operators of torchvision and Detectron2, and needs neither.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

BOXES_AT_ONCE = 256  # bounds the memory of the index tables


def roi_align(
    features: Tensor,
    boxes: Tensor,
    images: Tensor,
    bins: int,
    scale: float,
    *,
    samples: int = 0,
    aligned: bool = True,
) -> Tensor:
    """Pooled features (K, C, bins, bins), differentiable with respect to ``features``.

    ``features``: (N, C, H, W). ``boxes``: (K, 4) in px of the image. ``images``: (K,) long, which of the N each box
    lies in. ``scale``: cells a px. ``samples``: along each axis of a bin; 0: one a cell. ``aligned``: the centre of
    the first cell lies at half a cell; otherwise at 0, and boxes are at least one cell large.
    """
    count, channels, height, width = features.shape
    if not len(boxes):
        return features.new_zeros(0, channels, bins, bins)
    cells = features.permute(0, 2, 3, 1).reshape(count * height * width, channels)
    corners = boxes.detach().float() * scale - (0.5 if aligned else 0.0)
    begin, sides = corners[:, :2], corners[:, 2:] - corners[:, :2]
    if not aligned:
        sides = sides.clamp(min=1.0)
    if samples:
        numbers = torch.full_like(sides, samples, dtype=torch.long)
    else:
        numbers = (sides / bins).ceil().long().clamp(min=1)
    order = numbers.prod(1).argsort()  # boxes of similar cost together: little padding in the tables
    pooled = []
    for some in order.split(BOXES_AT_ONCE):  # type: ignore[no-untyped-call]
        x, weights_x = _axis(begin[some, 0], sides[some, 0], numbers[some, 0], bins, width)
        y, weights_y = _axis(begin[some, 1], sides[some, 1], numbers[some, 1], bins, height)
        rows = images[some, None, None] * (height * width) + y * width
        indices = rows[:, :, None, :, None] + x[:, None, :, None, :]
        weights = weights_y[:, :, None, :, None] * weights_x[:, None, :, None, :]
        touched = weights != 0
        counts = touched.flatten(3).sum(3).reshape(-1)
        bags = F.embedding_bag(
            indices[touched],
            cells,
            counts.cumsum(0) - counts,
            mode="sum",
            per_sample_weights=weights[touched].to(cells.dtype),
        )
        pooled.append(bags.view(len(some), bins * bins, channels))
    together = torch.cat(pooled)[order.argsort()]
    return together.transpose(1, 2).reshape(-1, channels, bins, bins)


def _axis(begin: Tensor, side: Tensor, number: Tensor, bins: int, limit: int) -> tuple[Tensor, Tensor]:
    """The cells (K, bins, R) that the bins of each box touch along one axis, and their weights.

    ``begin``, ``side``: (K,) in cells. ``number``: (K,) samples a bin. ``limit``: cells of the axis. Samples
    beyond the border by more than a cell count as 0, as in the compiled operators; nearer ones take the border's.
    """
    sample = torch.arange(int(number.max()), device=begin.device)
    bin_begin = torch.arange(bins, device=begin.device, dtype=begin.dtype)
    within = (sample + 0.5) / number[:, None, None]
    at = begin[:, None, None] + (side / bins)[:, None, None] * (bin_begin[None, :, None] + within)
    used = (sample < number[:, None, None]) & (at >= -1.0) & (at <= limit)
    at = at.clamp(0, limit - 1)
    lower = at.floor()
    fraction = at - lower
    weight = used.to(begin.dtype) / number[:, None, None]
    first = torch.where(used, lower, float(limit)).amin(-1, keepdim=True)
    first = torch.where(first >= limit, 0.0, first)  # a bin without any sample
    place = torch.where(used, lower - first, 0.0).long()
    weights = begin.new_zeros(*place.shape[:2], int(place.max()) + 2)
    weights.scatter_add_(2, place, weight * (1 - fraction))
    weights.scatter_add_(2, place + 1, weight * fraction)
    cells = first.long() + torch.arange(weights.shape[2], device=begin.device)
    return cells.clamp(max=limit - 1), weights
