"""PoleNet made ready to compute fast: batch norm folded, weights laid out for the CPU, and images as its input."""

from __future__ import annotations

import copy

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from scpf.models.instances import Image
from scpf.models.pole_tiles import MOST_TILES, TileGate, finest_at, passing_tiles, spread
from scpf.models.polenet import PIXEL_DEVIATION, PIXEL_MEAN, PoleNet, Residual
from scpf.models.winograd import WinogradResidual

_LEVELS = (np.arange(256, dtype=np.float32) - np.float32(255 * PIXEL_MEAN)) / np.float32(
    255 * PIXEL_DEVIATION
)


def to_input(
    images: np.ndarray[tuple[int, ...], np.dtype[np.uint8]], device: torch.device | str = "cpu"
) -> Tensor:
    """Network input (B, 3, H, W) of images (B, H, W, 3), uint8 RGB, on ``device``."""
    _, height, width, channels = images.shape
    levels = cv2.LUT(images.reshape(-1, width, channels), _LEVELS).reshape(-1, height, width, channels)
    return torch.from_numpy(levels).to(device).permute(0, 3, 1, 2)  # which is channels_last


def fold_batch_norm(net: PoleNet) -> PoleNet:
    """A copy for inference in which every batch norm is part of the convolution before it."""
    folded = copy.deepcopy(net).eval()
    for block in list(folded.modules()):
        if not isinstance(block, nn.Sequential):
            continue
        for i in range(len(block) - 1):
            convolution, norm = block[i], block[i + 1]
            if isinstance(convolution, nn.Conv2d) and isinstance(norm, nn.BatchNorm2d):
                block[i] = fuse_conv_bn_eval(convolution, norm)
                block[i + 1] = nn.Identity()
    return folded


def has_fast_bfloat16() -> bool:
    """Whether the CPU computes bfloat16 itself; emulated, it would be slower than single precision."""
    supported = getattr(torch.cpu, "_is_avx512_bf16_supported", None)  # not in every torch
    return bool(supported and supported())


def channels_last(net: PoleNet) -> PoleNet:
    """The same network with its weights laid out as CPUs compute convolutions fastest."""
    net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # torch's stubs leave it out
    return net


def for_inference(net: PoleNet, *, bfloat16: bool = False) -> PoleNet:
    """A folded copy, laid out for the CPU.

    Single precision finds the same instances on every machine; bfloat16 is faster on CPUs that compute it
    themselves, and moves scores and outlines a little.
    """
    folded = channels_last(fold_batch_norm(net))
    if next(folded.parameters()).device.type == "cpu":
        _pointwise_by_onednn(folded)
        if not bfloat16:
            _residuals_by_winograd(folded)
    return folded.to(torch.bfloat16) if bfloat16 else folded


def _residuals_by_winograd(net: PoleNet) -> None:
    """Puts blocks with a quarter of the multiplications in the place of the residual ones: 24 of 99 ms."""
    for stage in net.stages.modules():
        for name, block in list(stage.named_children()):
            if isinstance(block, Residual):
                first, second = block.first[0], block.second[0]
                assert isinstance(first, nn.Conv2d) and isinstance(second, nn.Conv2d)
                setattr(stage, name, WinogradResidual(first, second))


def _pointwise_by_onednn(net: PoleNet) -> None:
    """Dilates the kernels of one pixel, which changes no sum.

    In a single thread torch computes a 1×1 convolution of one picture without oneDNN, unless it is dilated
    (`ConvParams::use_mkldnn` in ATen's Convolution.cpp): 4 of 108 ms.
    """
    for layer in net.modules():
        if isinstance(layer, nn.Conv2d) and layer.kernel_size == (1, 1):
            layer.dilation = (2, 2)


Maps = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]


def maps(net: PoleNet, framed: Image, gate: TileGate | None = None) -> Maps:
    """Probabilities of mask (h, w) and centre (h/8, w/8), offsets (2, h/4, w/4) of one framed image (h, w, 3).

    With a ``gate``, a CPU computes masks and offsets in the tiles alone that it lets pass; elsewhere they are 0.
    """
    return batch_maps(net, framed[None], gate)[0]


def batch_maps(net: PoleNet, framed: NDArray[np.uint8], gate: TileGate | None = None) -> list[Maps]:
    """`maps` of each of several framed images (B, h, w, 3)."""
    parameter = next(net.parameters())
    with torch.inference_mode():
        levels = net.levels(to_input(framed, parameter.device).to(parameter.dtype))
        centres = net.centre(levels.eighth)[:, 0].float().sigmoid().cpu().numpy()
        tiles = passing_tiles(levels, gate) if gate and parameter.device.type == "cpu" else None
        if tiles is None or tiles.mean() > MOST_TILES:
            mask, offsets = (output.float() for output in net.finest(levels))
            masks = [interleaved(each) for each in mask.sigmoid().cpu().numpy()]
            return list(zip(masks, centres, offsets.cpu().numpy(), strict=True))
        where = torch.from_numpy(np.argwhere(tiles))
        mask, offsets = (part.float() for part in finest_at(net, levels, where))
        mask = spread(F.pixel_shuffle(mask.sigmoid().contiguous(), 2), where, tiles.shape)
        offsets = spread(offsets, where, tiles.shape)
        return list(zip(mask.numpy()[:, 0], centres, offsets.numpy(), strict=True))


def interleaved(fine: NDArray[np.float32]) -> NDArray[np.float32]:
    """The map (2 h, 2 w) of four (4, h, w), the pixels of each cell row by row: torch's pixel shuffle, only faster."""
    _, height, width = fine.shape
    whole = np.empty((2 * height, 2 * width), np.float32)
    for k in range(4):
        whole[k // 2 :: 2, k % 2 :: 2] = fine[k]
    return whole
