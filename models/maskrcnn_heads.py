"""The heads of Mask R-CNN: class and box of each proposal, and the mask of each detection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from scpf.models import box_ops
from scpf.models.maskrcnn_backbone import PYRAMID_CHANNELS, Convolution
from scpf.models.maskrcnn_conventions import Convention
from scpf.models.maskrcnn_rpn import FINEST_STRIDE_PX, level_of
from scpf.models.roi_align import roi_align

BOX_BINS, MASK_BINS = 7, 14
HIDDEN = 1024
BOX_WEIGHTS = (10.0, 10.0, 5.0, 5.0)
SUPPRESSION_OVERLAP = 0.5
MOST_DETECTIONS = 100


class BoxHead(nn.Module):
    """Two layers on the pooled features (K, 256, 7, 7)."""

    def __init__(self) -> None:
        super().__init__()
        self.fc1 = nn.Linear(PYRAMID_CHANNELS * BOX_BINS**2, HIDDEN)
        self.fc2 = nn.Linear(HIDDEN, HIDDEN)

    def forward(self, pooled: Tensor) -> Tensor:
        return F.relu_(self.fc2(F.relu_(self.fc1(pooled.flatten(1)))))


class BoxPredictor(nn.Module):
    """Logits (K, classes + 1), the background last, and offsets (K, 4 classes)."""

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.cls_score = nn.Linear(HIDDEN, classes + 1)
        self.bbox_pred = nn.Linear(HIDDEN, 4 * classes)

    def forward(self, hidden: Tensor) -> tuple[Tensor, Tensor]:
        return self.cls_score(hidden).float(), self.bbox_pred(hidden).float()


class MaskHead(nn.Module):
    """Logits (K, classes, 28, 28) of the pooled features (K, 256, 14, 14)."""

    def __init__(self, classes: int) -> None:
        super().__init__()
        for k in range(1, 5):
            self.add_module(f"mask_fcn{k}", Convolution(PYRAMID_CHANNELS, PYRAMID_CHANNELS, 3, relu=True))
        self.deconv = nn.ConvTranspose2d(PYRAMID_CHANNELS, PYRAMID_CHANNELS, 2, 2)
        self.predictor = Convolution(PYRAMID_CHANNELS, classes, 1)

    def forward(self, pooled: Tensor) -> Tensor:
        for k in range(1, 5):
            pooled = self.get_submodule(f"mask_fcn{k}")(pooled)
        return self.predictor(F.relu_(self.deconv(pooled))).float()  # type: ignore[no-any-return]


@dataclass(frozen=True)
class Detections:
    """What was found in one image: boxes (D, 4) in px of the network's image, scores (D,) best first, classes (D,)
    from 0, and masks (D, 28, 28), the probability over each box."""

    boxes: Tensor
    scores: Tensor
    classes: Tensor
    masks: Tensor


class RegionHeads(nn.Module):
    """The heads of a number of classes, the background not counted."""

    def __init__(self, classes: int, convention: Convention) -> None:
        super().__init__()
        self.classes = classes
        self.convention = convention
        self.box_head = BoxHead()
        self.box_predictor = BoxPredictor(classes)
        self.mask_head = MaskHead(classes)

    def pool(self, levels: Sequence[Tensor], boxes: Sequence[Tensor], bins: int) -> Tensor:
        """Features (K, 256, bins, bins) of all boxes, each from the level that fits its size."""
        together = torch.cat(list(boxes))
        counts = torch.tensor([len(some) for some in boxes])
        images = torch.arange(len(boxes)).repeat_interleave(counts).to(together.device)
        level = level_of(together, self.convention)
        pooled = levels[0].new_zeros(len(together), PYRAMID_CHANNELS, bins, bins)
        for k in range(4):
            here = (level == k).nonzero()[:, 0]
            if len(here):
                aligned = roi_align(
                    levels[k],
                    together[here],
                    images[here],
                    bins,
                    1 / (FINEST_STRIDE_PX << k),
                    samples=self.convention.roi_samples,
                    aligned=self.convention.roi_aligned,
                )
                pooled = pooled.index_copy(0, here, aligned)
        return pooled

    def predict_boxes(self, levels: Sequence[Tensor], boxes: Sequence[Tensor]) -> tuple[Tensor, Tensor]:
        """Class logits and offsets of proposals, as `BoxPredictor` gives them."""
        logits, offsets = self.box_predictor(self.box_head(self.pool(levels, boxes, BOX_BINS)))
        return logits, offsets

    def predict_masks(self, levels: Sequence[Tensor], boxes: Sequence[Tensor], classes: Tensor) -> Tensor:
        """Mask logits (K, 28, 28) of boxes, each for its class (K,)."""
        logits = self.mask_head(self.pool(levels, boxes, MASK_BINS))
        return logits[torch.arange(len(logits), device=logits.device), classes]  # type: ignore[no-any-return]

    def detect(
        self,
        levels: Sequence[Tensor],
        proposals: Sequence[Tensor],
        size_px: Sequence[int],
        threshold: float,
    ) -> list[Detections]:
        """What scores at least ``threshold``, for each image, after suppression within a class.

        Suppression and the limit on their number go from the best score down, so what lies below the threshold
        would not have changed what lies above.
        """
        logits, offsets = self.predict_boxes(levels, proposals)
        found: list[tuple[Tensor, Tensor, Tensor]] = []
        begin = 0
        for boxes in proposals:
            own = slice(begin, begin + len(boxes))
            begin += len(boxes)
            moved = box_ops.clip(box_ops.moved(boxes, offsets[own], BOX_WEIGHTS), size_px)
            probabilities = logits[own].softmax(1)[:, :-1]
            index, classes = (probabilities >= threshold).nonzero().unbind(1)
            box, score = moved[index, classes], probabilities[index, classes]
            whole = box_ops.larger_than(box, self.convention.least_box_px)
            box, score, classes = box[whole], score[whole], classes[whole]
            kept = box_ops.suppress_by_group(box, score, classes, SUPPRESSION_OVERLAP)[:MOST_DETECTIONS]
            found.append((box[kept], score[kept], classes[kept]))
        all_classes = torch.cat([classes for _, _, classes in found])
        masks = self.predict_masks(levels, [box for box, _, _ in found], all_classes).sigmoid()
        detections, begin = [], 0
        for box, score, classes in found:
            detections.append(Detections(box, score, classes, masks[begin : begin + len(box)]))
            begin += len(box)
        return detections
