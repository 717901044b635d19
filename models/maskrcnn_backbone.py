"""ResNet with a feature pyramid (He et al. 2016; Lin et al. 2017), the backbone of Mask R-CNN.

Modules are named as Detectron2 names them, so that the tensors of its files fit by name.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from scpf.models.maskrcnn_conventions import Stride

PYRAMID_CHANNELS = 256
STAGES = (2, 3, 4, 5)  # at 1/4, 1/8, 1/16 and 1/32 of the input; the pyramid adds a level 6 at 1/64
RESNET_50 = (3, 4, 6, 3)  # bottlenecks a stage


class FrozenBatchNorm(nn.Module):
    """A batch norm whose statistics and scales are constants."""

    weight: Tensor
    bias: Tensor
    running_mean: Tensor
    running_var: Tensor

    def __init__(self, channels: int, epsilon: float) -> None:
        super().__init__()
        self.epsilon = epsilon
        for name, value in (("weight", 1.0), ("bias", 0.0), ("running_mean", 0.0), ("running_var", 1.0)):
            self.register_buffer(name, torch.full((channels,), value))

    def scale_and_shift(self) -> tuple[Tensor, Tensor]:
        """What the norm multiplies by, and adds, for each channel."""
        scale = self.weight * (self.running_var + self.epsilon).rsqrt()
        return scale, self.bias - self.running_mean * scale

    def forward(self, x: Tensor) -> Tensor:
        scale, shift = self.scale_and_shift()
        return x * scale[:, None, None] + shift[:, None, None]


class Convolution(nn.Conv2d):
    """A convolution that keeps the size at stride 1, with its frozen batch norm where ``epsilon`` is given."""

    def __init__(
        self,
        inputs: int,
        outputs: int,
        kernel: int,
        stride: int = 1,
        *,
        epsilon: float | None = None,
        relu: bool = False,
    ) -> None:
        super().__init__(inputs, outputs, kernel, stride, kernel // 2, bias=epsilon is None)
        self.norm = None if epsilon is None else FrozenBatchNorm(outputs, epsilon)
        self.relu = relu

    def forward(self, x: Tensor) -> Tensor:
        x = super().forward(x)
        if self.norm is not None:
            x = self.norm(x)
        return F.relu_(x) if self.relu else x

    def fold(self) -> None:
        """Makes the batch norm part of weights and bias: the same values in one step. For inference alone."""
        if self.norm is not None:
            scale, shift = self.norm.scale_and_shift()
            self.weight = nn.Parameter(self.weight.detach() * scale[:, None, None, None], requires_grad=False)
            self.bias = nn.Parameter(shift, requires_grad=False)
            self.norm = None


class Bottleneck(nn.Module):
    """Three convolutions around which the input passes."""

    def __init__(
        self, inputs: int, width: int, outputs: int, stride: int, place: Stride, epsilon: float
    ) -> None:
        super().__init__()
        first, second = (stride, 1) if place == "1x1" else (1, stride)
        self.shortcut = (
            Convolution(inputs, outputs, 1, stride, epsilon=epsilon) if inputs != outputs else None
        )
        self.conv1 = Convolution(inputs, width, 1, first, epsilon=epsilon, relu=True)
        self.conv2 = Convolution(width, width, 3, second, epsilon=epsilon, relu=True)
        self.conv3 = Convolution(width, outputs, 1, epsilon=epsilon)

    def forward(self, x: Tensor) -> Tensor:
        kept = x if self.shortcut is None else self.shortcut(x)
        return F.relu_(self.conv3(self.conv2(self.conv1(x))) + kept)


class ResNet(nn.Module):
    """The features of stages 2 to 5 of images (N, 3, H, W)."""

    def __init__(self, blocks: Sequence[int], place: Stride, epsilon: float) -> None:
        super().__init__()
        self.stem = nn.ModuleDict({"conv1": Convolution(3, 64, 7, 2, epsilon=epsilon, relu=True)})
        inputs = 64
        for stage, count in zip(STAGES, blocks, strict=True):
            width = 64 << (stage - 2)
            bottlenecks = []
            for block in range(count):
                stride = 2 if block == 0 and stage > 2 else 1
                bottlenecks.append(Bottleneck(inputs, width, 4 * width, stride, place, epsilon))
                inputs = 4 * width
            self.add_module(f"res{stage}", nn.Sequential(*bottlenecks))

    def forward(self, x: Tensor) -> list[Tensor]:
        x = F.max_pool2d(self.stem["conv1"](x), 3, 2, 1)
        features = []
        for stage in STAGES:
            x = self.get_submodule(f"res{stage}")(x)
            features.append(x)
        return features


class FeaturePyramid(nn.Module):
    """Five levels of 256 channels, at 1/4 to 1/64 of the images (N, 3, H, W)."""

    def __init__(self, blocks: Sequence[int], place: Stride, epsilon: float) -> None:
        super().__init__()
        self.bottom_up = ResNet(blocks, place, epsilon)
        for stage in STAGES:
            self.add_module(f"fpn_lateral{stage}", Convolution(64 << stage, PYRAMID_CHANNELS, 1))
            self.add_module(f"fpn_output{stage}", Convolution(PYRAMID_CHANNELS, PYRAMID_CHANNELS, 3))

    def forward(self, x: Tensor) -> list[Tensor]:
        levels: list[Tensor] = []
        above: Tensor | None = None
        for stage, features in reversed(list(zip(STAGES, self.bottom_up(x), strict=True))):
            here = cast(Tensor, self.get_submodule(f"fpn_lateral{stage}")(features))
            above = here if above is None else here + F.interpolate(above, size=here.shape[-2:])
            levels.insert(0, self.get_submodule(f"fpn_output{stage}")(above))
        return [*levels, F.max_pool2d(levels[-1], 1, 2)]
