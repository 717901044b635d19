"""The region proposal network (Ren et al. 2015) on a feature pyramid: boxes that may hold an object."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor, nn

from scpf.models import box_ops
from scpf.models.maskrcnn_backbone import PYRAMID_CHANNELS, Convolution
from scpf.models.maskrcnn_conventions import Convention

ANCHOR_SIDES_PX = (32, 64, 128, 256, 512)  # square root of the area, one for each level of the pyramid
ASPECT_RATIOS = (0.5, 1.0, 2.0)  # height / width
FINEST_STRIDE_PX = 4
SUPPRESSION_OVERLAP = 0.7
CANDIDATES_A_LEVEL, PROPOSALS = 1000, 1000  # at inference
CANDIDATES_IN_TRAINING = 2000
UNIT_WEIGHTS = (1.0, 1.0, 1.0, 1.0)


class ProposalHead(nn.Module):
    """For every cell of every level and each of three anchors: a logit that it holds an object, and its offsets."""

    def __init__(self) -> None:
        super().__init__()
        anchors = len(ASPECT_RATIOS)
        self.conv = Convolution(PYRAMID_CHANNELS, PYRAMID_CHANNELS, 3, relu=True)
        self.objectness_logits = Convolution(PYRAMID_CHANNELS, anchors, 1)
        self.anchor_deltas = Convolution(PYRAMID_CHANNELS, 4 * anchors, 1)

    def forward(self, levels: Sequence[Tensor]) -> tuple[list[Tensor], list[Tensor]]:
        """For each level logits (N, A) and offsets (N, A, 4), by row, column and anchor."""
        logits, offsets = [], []
        for features in levels:
            shared = self.conv(features)
            logits.append(self.objectness_logits(shared).permute(0, 2, 3, 1).flatten(1).float())
            by_cell = self.anchor_deltas(shared).permute(0, 2, 3, 1)
            offsets.append(by_cell.reshape(len(features), -1, 4).float())
        return logits, offsets


def anchors(levels: Sequence[Tensor], padded_px: Sequence[int], convention: Convention) -> list[Tensor]:
    """The anchors (A, 4) in px of each level of a pyramid of images of ``padded_px`` (height, width)."""
    placed = []
    for k, features in enumerate(levels):
        height, width = features.shape[-2:]
        device = features.device
        stride_y = stride_x = FINEST_STRIDE_PX << k
        if convention.grid_strides:
            stride_y, stride_x = padded_px[0] // height, padded_px[1] // width
        y = torch.arange(height, device=device, dtype=torch.float32) * stride_y
        x = torch.arange(width, device=device, dtype=torch.float32) * stride_x
        y, x = torch.meshgrid(y, x, indexing="ij")
        corners = torch.stack([x, y, x, y], -1).reshape(-1, 1, 4)
        placed.append((corners + cell_anchors(k, convention).to(device)).reshape(-1, 4))
    return placed


def cell_anchors(level: int, convention: Convention) -> Tensor:
    """The three anchors (3, 4) of a cell, about its corner."""
    boxes = []
    for ratio in ASPECT_RATIOS:
        half_height = ANCHOR_SIDES_PX[level] * math.sqrt(ratio) / 2
        half_width = ANCHOR_SIDES_PX[level] / math.sqrt(ratio) / 2
        boxes.append([-half_width, -half_height, half_width, half_height])
    cell = torch.tensor(boxes)
    return cell.round() if convention.rounded_anchors else cell


@torch.no_grad()
def proposals(
    anchors_px: Sequence[Tensor],
    logits: Sequence[Tensor],
    offsets: Sequence[Tensor],
    size_px: Sequence[int],
    convention: Convention,
    *,
    training: bool = False,
) -> list[Tensor]:
    """For each image the best boxes (P, 4) after suppression within a level, best first.

    ``size_px``: (height, width) of the images before padding.
    """
    candidates = CANDIDATES_IN_TRAINING if training else CANDIDATES_A_LEVEL
    most = convention.proposals_in_training if training else PROPOSALS
    found = []
    for image in range(len(logits[0])):
        boxes, scores, groups = [], [], []
        for level, anchor in enumerate(anchors_px):
            score, index = logits[level][image].topk(min(candidates, len(anchor)))
            moved = box_ops.moved(anchor[index], offsets[level][image, index], UNIT_WEIGHTS)[:, 0]
            box = box_ops.clip(moved, size_px)
            whole = box_ops.larger_than(box, convention.least_proposal_px)
            boxes.append(box[whole])
            scores.append(score[whole])
            groups.append(torch.full_like(index[whole], level))
        together, score = torch.cat(boxes), torch.cat(scores)
        if convention.rank_by_probability:  # which large logits share
            score = score.sigmoid()
        kept = box_ops.suppress_by_group(together, score, torch.cat(groups), SUPPRESSION_OVERLAP)[:most]
        found.append(together[kept])
    return found


def level_of(boxes: Tensor, convention: Convention) -> Tensor:
    """The pyramid's level (K,), 0 to 3, whose features a box is pooled from (Lin et al. 2017, eq. 1)."""
    relative = box_ops.areas(boxes).clamp(min=0).sqrt() / 224
    if convention.epsilon_in_log:
        level = 4 + torch.log2(relative + convention.level_epsilon)
    else:
        level = 4 + torch.log2(relative) + convention.level_epsilon
    return level.floor().clamp(2, 5).long() - 2
