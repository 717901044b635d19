"""Mask R-CNN (He et al. 2017) on a ResNet with feature pyramid, in plain torch.

The paper's segmenter. One network for the weights of torchvision and of Detectron2, which differ in conventions alone
(`maskrcnn_conventions`). Modules are named as in Detectron2, classes count from 0, and the background comes last.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from scpf.models import maskrcnn_rpn
from scpf.models.maskrcnn_backbone import RESNET_50, Convolution, FeaturePyramid
from scpf.models.maskrcnn_conventions import Convention
from scpf.models.maskrcnn_heads import Detections, RegionHeads

PADDING_PX = 32  # the sides of the network's input are multiples of it


class MaskRCNN(nn.Module):
    """The network for a number of classes (without the background); ``blocks``: bottlenecks of stages 2 to 5."""

    def __init__(self, classes: int, convention: Convention, blocks: Sequence[int] = RESNET_50) -> None:
        super().__init__()
        self.convention = convention
        self.backbone = FeaturePyramid(blocks, convention.stride, convention.batch_norm_epsilon)
        self.proposal_generator = nn.ModuleDict({"rpn_head": maskrcnn_rpn.ProposalHead()})
        self.roi_heads = RegionHeads(classes, convention)

    def normalise(self, images: Tensor) -> Tensor:
        """Images (N, 3, H, W), RGB 0 to 255, as the network takes them, not yet padded."""
        convention = self.convention
        x = images.float()
        if convention.colour == "bgr":
            x = x.flip(1)
        mean, deviation = x.new_tensor(convention.pixel_mean), x.new_tensor(convention.pixel_deviation)
        return (x * convention.pixel_scale - mean[:, None, None]) / deviation[:, None, None]

    def features(self, normalised: Tensor) -> tuple[list[Tensor], tuple[int, int]]:
        """The pyramid's levels of normalised images, and the (height, width) that they were padded to."""
        height, width = normalised.shape[-2:]
        x = F.pad(normalised, (0, -width % PADDING_PX, 0, -height % PADDING_PX))
        x = x.to(self.dtype).contiguous(memory_format=torch.channels_last)
        return self.backbone(x), (x.shape[-2], x.shape[-1])

    @torch.inference_mode()
    def detect(self, normalised: Tensor, threshold: float = 0.05) -> list[Detections]:
        """What scores at least ``threshold`` in each of the normalised images (N, 3, H, W)."""
        size_px = normalised.shape[-2:]
        levels, padded_px = self.features(normalised)
        logits, offsets = self.proposal_generator["rpn_head"](levels)
        anchors = maskrcnn_rpn.anchors(levels, padded_px, self.convention)
        proposals = maskrcnn_rpn.proposals(anchors, logits, offsets, size_px, self.convention)
        return self.roi_heads.detect(levels, proposals, size_px, threshold)

    @property
    def dtype(self) -> torch.dtype:
        """The type that the network computes in; boxes and scores are single precision in any case."""
        return self.roi_heads.box_head.fc1.weight.dtype

    @property
    def device(self) -> torch.device:
        """Where the network lies."""
        return self.roi_heads.box_head.fc1.weight.device


def for_inference(net: MaskRCNN, device: torch.device, dtype: torch.dtype = torch.float32) -> MaskRCNN:
    """The network itself, changed for good: batch norms folded, laid out as convolutions are fastest."""
    for module in net.modules():
        if isinstance(module, Convolution):
            module.fold()
    net.requires_grad_(False)
    net.eval().to(device, dtype)
    net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # torch's stubs leave it out
    return net
