"""What Mask R-CNN is trained to make small: five losses (Ren et al. 2015, eq. 1; He et al. 2017, section 3).

Each convention has its own regression loss and mask targets, and here gives the losses of its original. The batch
norms stay frozen, and so do the first layers (`freeze_first_stages`), as both originals train by default.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from scpf.models import box_ops, maskrcnn_rpn
from scpf.models.maskrcnn import MaskRCNN
from scpf.models.maskrcnn_heads import BOX_WEIGHTS
from scpf.models.maskrcnn_rpn import UNIT_WEIGHTS
from scpf.models.roi_align import roi_align

ANCHORS_AN_IMAGE, ANCHORS_POSITIVE = 256, 0.5
ANCHOR_BACKGROUND, ANCHOR_OBJECT = 0.3, 0.7  # overlap below which, and from which, an anchor counts as such
REGIONS_AN_IMAGE, REGIONS_POSITIVE = 512, 0.25
REGION_OBJECT = 0.5
MASK_SIDE = 28


@dataclass(frozen=True)
class Target:
    """What an image shows: boxes (n, 4) in px of the network's image, classes (n,) from 0, masks (n, H, W) bool."""

    boxes: Tensor
    classes: Tensor
    masks: Tensor


def freeze_first_stages(net: MaskRCNN) -> None:
    """Leaves the stem and the first stage as they are: edges and colours are the same everywhere."""
    for part in (net.backbone.bottom_up.stem, net.backbone.bottom_up.get_submodule("res2")):
        part.requires_grad_(False)


def losses(
    net: MaskRCNN,
    normalised: Tensor,
    targets: Sequence[Target],
    generator: torch.Generator | None = None,
) -> Mapping[str, Tensor]:
    """The losses of a batch, to be added up: ``objectness``, ``proposal_box``, ``class``, ``box`` and ``mask``.

    ``normalised``: images (N, 3, H, W) as `MaskRCNN.normalise` gives them. ``generator`` draws the anchors and
    proposals that count.
    """
    size_px = normalised.shape[-2:]
    levels, padded_px = net.features(normalised)
    logits, offsets = net.proposal_generator["rpn_head"](levels)
    anchors = maskrcnn_rpn.anchors(levels, padded_px, net.convention)
    found = _proposal_losses(net, anchors, logits, offsets, targets, generator)
    proposals = maskrcnn_rpn.proposals(
        anchors,
        [level.detach() for level in logits],
        [level.detach() for level in offsets],
        size_px,
        net.convention,
        training=True,
    )
    return {**found, **_region_losses(net, levels, proposals, targets, generator)}


def _proposal_losses(
    net: MaskRCNN,
    anchors: Sequence[Tensor],
    logits: Sequence[Tensor],
    offsets: Sequence[Tensor],
    targets: Sequence[Target],
    generator: torch.Generator | None,
) -> dict[str, Tensor]:
    together = torch.cat(list(anchors))
    all_logits, all_offsets = torch.cat(list(logits), 1), torch.cat(list(offsets), 1)
    objectness, box = all_logits.sum() * 0, all_offsets.sum() * 0
    for image, target in enumerate(targets):
        labels, which = match(together, target.boxes, ANCHOR_BACKGROUND, ANCHOR_OBJECT, best_too=True)
        positive, negative = draw(labels, ANCHORS_AN_IMAGE, ANCHORS_POSITIVE, generator)
        drawn = torch.cat([positive, negative])
        objectness = objectness + F.binary_cross_entropy_with_logits(
            all_logits[image, drawn], (labels[drawn] == 1).float(), reduction="sum"
        )
        wanted = box_ops.offsets(together[positive], target.boxes[which[positive]], UNIT_WEIGHTS)
        box = box + _regression(all_offsets[image, positive], wanted, net)
    count = ANCHORS_AN_IMAGE * len(targets)
    return {"objectness": objectness / count, "proposal_box": box / count}


def _region_losses(
    net: MaskRCNN,
    levels: Sequence[Tensor],
    proposals: Sequence[Tensor],
    targets: Sequence[Target],
    generator: torch.Generator | None,
) -> dict[str, Tensor]:
    heads = net.roi_heads
    drawn, classes, object_boxes, object_classes, wanted, masks = [], [], [], [], [], []
    for own, target in zip(proposals, targets, strict=True):
        boxes = torch.cat([own, target.boxes])  # the true ones too: early proposals hit few objects
        labels, which = match(boxes, target.boxes, REGION_OBJECT, REGION_OBJECT)
        positive, negative = draw(labels, REGIONS_AN_IMAGE, REGIONS_POSITIVE, generator)
        hit = which[positive]
        drawn.append(boxes[torch.cat([positive, negative])])
        background = torch.full_like(negative, heads.classes)
        classes.append(torch.cat([target.classes[hit], background]))
        object_boxes.append(boxes[positive])
        object_classes.append(target.classes[hit])
        wanted.append(box_ops.offsets(boxes[positive], target.boxes[hit], BOX_WEIGHTS))
        masks.append(mask_targets(target.masks, boxes[positive], hit, net))
    all_classes = torch.cat(classes)
    logits, offsets = heads.predict_boxes(levels, drawn)
    objects = (all_classes < heads.classes).nonzero()[:, 0]
    predicted = offsets.view(len(offsets), -1, 4)[objects, all_classes[objects]]
    mask_logits = heads.predict_masks(levels, object_boxes, torch.cat(object_classes))
    mask = F.binary_cross_entropy_with_logits(mask_logits, torch.cat(masks), reduction="sum")
    return {
        "class": F.cross_entropy(logits, all_classes),
        "box": _regression(predicted, torch.cat(wanted), net) / max(len(all_classes), 1),
        "mask": mask / max(mask_logits.numel(), 1),
    }


def _regression(predicted: Tensor, wanted: Tensor, net: MaskRCNN) -> Tensor:
    """The summed smooth L1 loss of offsets; without a beta it is the plain one."""
    beta = net.convention.smooth_l1_beta
    return F.smooth_l1_loss(predicted, wanted, reduction="sum", beta=beta)


def match(
    boxes: Tensor, truth: Tensor, background: float, found: float, *, best_too: bool = False
) -> tuple[Tensor, Tensor]:
    """For each box (N,): 1 object, 0 background or -1 neither, by its overlap; and which of ``truth`` it overlaps most.

    ``best_too``: the best boxes of a true one are objects however little they overlap it.
    """
    if not len(truth):
        nothing = torch.zeros(len(boxes), dtype=torch.long, device=boxes.device)
        return nothing, nothing
    overlap = box_ops.overlaps(truth, boxes)
    most, which = overlap.max(0)
    labels = torch.full_like(which, -1)
    labels[most < background] = 0
    labels[most >= found] = 1
    if best_too:
        best = overlap == overlap.max(1, keepdim=True).values
        labels[best.any(0) & (most > 0)] = 1
    return labels, which


def draw(
    labels: Tensor, count: int, share: float, generator: torch.Generator | None
) -> tuple[Tensor, Tensor]:
    """Indices of ``count`` drawn boxes: objects, at most that share of them, and background for the rest."""
    objects, background = (labels == 1).nonzero()[:, 0], (labels == 0).nonzero()[:, 0]
    positive = min(len(objects), int(count * share))
    negative = min(len(background), count - positive)

    def shuffled(indices: Tensor) -> Tensor:
        # On the CPU, so that a seed draws the same on any device.
        return indices[torch.randperm(len(indices), generator=generator).to(indices.device)]

    return shuffled(objects)[:positive], shuffled(background)[:negative]


def mask_targets(masks: Tensor, boxes: Tensor, which: Tensor, net: MaskRCNN) -> Tensor:
    """Of each box (K, 4) what share of each of its 28 × 28 cells the mask ``which`` (K,) covers, (K, 28, 28)."""
    if not len(boxes):
        return boxes.new_zeros(0, MASK_SIDE, MASK_SIDE)
    binary = net.convention.binary_mask_targets
    share = roi_align(masks[:, None].float(), boxes, which, MASK_SIDE, 1.0, aligned=binary)[:, 0]
    return (share >= 0.5).float() if binary else share
