"""What PoleNet's training minimises.

Class-weighted cross-entropy and Dice (Milletari et al. 2016) for the mask, the penalty-reduced focal loss of CenterNet
(Zhou et al. 2019, eq. 1) for the centres, L1 for the offsets.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch.nn.functional as F
from torch import Tensor


def loss(outputs: tuple[Tensor, Tensor, Tensor], truth: Sequence[Tensor]) -> tuple[Tensor, dict[str, Tensor]]:
    """The sum to be minimised and its parts; ``truth``: the maps of `Sample` after the image, batched."""
    cover, valid, centre, centre_valid, offsets, offsets_valid = truth
    mask_logit, centre_logit, aim = outputs[0][:, 0].float(), outputs[1][:, 0].float(), outputs[2].float()
    weight = (1 + 4 * cover) * valid  # poles cover a hundredth of a picture
    cross_entropy = F.binary_cross_entropy_with_logits(mask_logit, cover, weight)
    p = mask_logit.sigmoid() * valid
    overlap = (2 * (p * cover).sum((1, 2)) + 1) / ((p * p).sum((1, 2)) + (cover * cover).sum((1, 2)) + 1)
    dice = (1 - overlap).mean()
    q = centre_logit.sigmoid().clamp(1e-4, 1 - 1e-4)
    peak = centre.eq(1).float()
    hit = peak * (1 - q) ** 2 * q.log()
    miss = (1 - peak) * centre_valid * (1 - centre) ** 4 * q**2 * (1 - q).log()
    focal = -(hit + miss).sum() / peak.sum().clamp(min=1)
    shift = ((aim - offsets).abs().sum(1) * offsets_valid).sum() / offsets_valid.sum().clamp(min=1)
    total = 2 * cross_entropy + dice + focal + 0.5 * shift
    parts = {"cross_entropy": cross_entropy, "dice": dice, "centre": focal, "offsets": shift}
    return total, {name: part.detach() for name, part in parts.items()}
