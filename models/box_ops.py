"""Boxes (N, 4) as x1, y1, x2, y2 in px: overlap, suppression, and the offsets that R-CNN heads predict.

In plain torch, since the compiled operators of torchvision do not load beside every torch.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor

LARGEST_LOG_SCALE = math.log(1000 / 16)  # a head may enlarge a box by no more than this
BoxWeights = tuple[float, float, float, float]


def areas(boxes: Tensor) -> Tensor:
    """Areas (N,) in px²."""
    return (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])


def overlaps(first: Tensor, second: Tensor) -> Tensor:
    """Intersection over union (N, M) of every box of ``first`` with every box of ``second``."""
    upper_left = torch.maximum(first[:, None, :2], second[None, :, :2])
    lower_right = torch.minimum(first[:, None, 2:], second[None, :, 2:])
    sides = (lower_right - upper_left).clamp_(min=0)
    intersection = sides[..., 0] * sides[..., 1]
    return intersection / (areas(first)[:, None] + areas(second)[None] - intersection)


def suppress(boxes: Tensor, scores: Tensor, threshold: float) -> Tensor:
    """Indices of the boxes that greedy non-maximum suppression keeps, best score first.

    Greedy suppression is the one fixed point of "kept are those that no kept box of a better score overlaps".
    Applying that rule again and again reaches it after as many rounds as the longest chain of suppressions, and
    each round is one product of matrices.
    """
    order = scores.argsort(descending=True, stable=True)
    ranked = boxes[order].float()
    suppresses = (overlaps(ranked, ranked) > threshold).triu_(1).float()
    kept = torch.ones(len(ranked), dtype=torch.bool, device=boxes.device)
    while len(ranked):
        settled = kept
        kept = (settled.float() @ suppresses) == 0
        if torch.equal(kept, settled):
            break
    return order[kept]


def suppress_by_group(boxes: Tensor, scores: Tensor, groups: Tensor, threshold: float) -> Tensor:
    """As `suppress`, among boxes of the same group (N,) alone."""
    kept = [torch.zeros(0, dtype=torch.long, device=boxes.device)]
    for group in groups.unique():  # type: ignore[no-untyped-call]
        members = (groups == group).nonzero()[:, 0]
        kept.append(members[suppress(boxes[members], scores[members], threshold)])
    indices = torch.cat(kept)
    return indices[scores[indices].argsort(descending=True, stable=True)]


def clip(boxes: Tensor, size_px: Sequence[int]) -> Tensor:
    """Boxes (..., 4) cut at the borders of an image of ``size_px`` (height, width)."""
    height, width = size_px
    x, y = boxes[..., 0::2].clamp(0, width), boxes[..., 1::2].clamp(0, height)
    return torch.stack([x[..., 0], y[..., 0], x[..., 1], y[..., 1]], -1)


def larger_than(boxes: Tensor, side_px: float) -> Tensor:
    """Whether both sides of each box are longer than ``side_px``: (N,) bool."""
    return ((boxes[:, 2:] - boxes[:, :2]) > side_px).all(1)


def offsets(boxes: Tensor, targets: Tensor, weights: BoxWeights) -> Tensor:
    """What a head should predict (N, 4) to move ``boxes`` onto ``targets`` (Girshick et al. 2014, appendix C)."""
    sides, target_sides = boxes[:, 2:] - boxes[:, :2], targets[:, 2:] - targets[:, :2]
    centres, target_centres = boxes[:, :2] + 0.5 * sides, targets[:, :2] + 0.5 * target_sides
    moved, scaled = (target_centres - centres) / sides, (target_sides / sides).log()
    return torch.cat([moved, scaled], 1) * boxes.new_tensor(weights)


def moved(boxes: Tensor, predicted: Tensor, weights: BoxWeights) -> Tensor:
    """``boxes`` (N, 4) moved by what a head predicted for each of K classes (N, 4 K): (N, K, 4). Undoes `offsets`."""
    predicted = predicted.float().view(len(boxes), -1, 4) / boxes.new_tensor(weights)
    sides = (boxes[:, 2:] - boxes[:, :2])[:, None]
    centres = boxes[:, None, :2] + 0.5 * sides + predicted[..., :2] * sides
    half = 0.5 * sides * predicted[..., 2:].clamp(max=LARGEST_LOG_SCALE).exp()
    return torch.cat([centres - half, centres + half], -1)
