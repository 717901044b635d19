"""Winograd's residual blocks are the convolutions': at every size, at every edge, for several pictures."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

from scpf.models import polenet
from scpf.models.polenet_inference import fold_batch_norm, for_inference
from scpf.models.winograd import WinogradResidual

pytestmark = pytest.mark.usefixtures("one_thread")


def convolution(channels: int) -> nn.Conv2d:
    """Random weights of a size that keeps that of what goes through."""
    layer = nn.Conv2d(channels, channels, 3, 1, 1)
    nn.init.normal_(layer.weight, 0.0, 1.0 / (3.0 * channels**0.5))
    return layer


def direct(x: torch.Tensor, first: nn.Conv2d, second: nn.Conv2d) -> torch.Tensor:
    """The block in double precision."""
    x, first, second = (part.double() for part in (x, first, second))
    return (second(first(x).relu()) + x).relu()


@settings(max_examples=60)
@given(
    st.integers(1, 2), st.integers(1, 19), st.integers(1, 19), st.sampled_from([1, 3, 48]), st.integers(0, 99)
)
def test_it_is_the_convolutions(pictures: int, height: int, width: int, channels: int, seed: int) -> None:
    torch.manual_seed(seed)
    layers = convolution(channels), convolution(channels)
    x = torch.randn(pictures, channels, height, width).to(memory_format=torch.channels_last)
    before = x.clone()
    with torch.inference_mode():
        found = WinogradResidual(*layers)(x)
        wanted = direct(before, *layers)
    assert torch.equal(x, before)
    assert found.shape == x.shape and found.is_contiguous(memory_format=torch.channels_last)
    torch.testing.assert_close(found.double(), wanted, atol=3e-5, rtol=1e-5)


def test_any_layout_and_picture_by_picture() -> None:
    torch.manual_seed(0)
    block = WinogradResidual(convolution(96), convolution(96))
    x = torch.randn(3, 96, 10, 13)
    together = block(x)
    assert torch.equal(together, block(x.to(memory_format=torch.channels_last)))
    assert torch.equal(together, torch.cat([block(each[None]) for each in x]))


def test_it_is_what_a_cpu_computes_in_single_precision() -> None:
    torch.manual_seed(0)
    net = polenet.PoleNet().eval()
    for layer in net.modules():  # what a training leaves is not 0 and 1
        if isinstance(layer, nn.BatchNorm2d):
            nn.init.normal_(layer.bias, 0.3, 0.3)

    def blocks(of: nn.Module) -> int:
        return sum(isinstance(module, WinogradResidual) for module in of.modules())

    ready = for_inference(net)
    assert blocks(ready) == sum(polenet.BLOCKS) == 6
    assert blocks(net) == blocks(fold_batch_norm(net)) == blocks(for_inference(net, bfloat16=True)) == 0
    x = torch.randn(2, 3, 64, 96).to(memory_format=torch.channels_last)
    with torch.inference_mode():
        found, wanted = ready.levels(x), fold_batch_norm(net).levels(x)
    for one, other in zip(found, wanted, strict=True):
        assert other.std() > 0.05
        torch.testing.assert_close(one, other, atol=1e-4, rtol=1e-4)
