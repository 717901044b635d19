"""Offsets are computed only where somebody asks for them, and are the same there."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from scpf.models import polenet, polenet_inference
from scpf.models.segmentation import MASK_THRESHOLD

pytestmark = pytest.mark.usefixtures("one_thread")

CELLS = [(0, 0, 0), (0, 0, 11), (0, 7, 0), (1, 7, 11), (1, 3, 5), (0, 3, 6)]


@pytest.mark.parametrize("kind", [torch.float32, torch.bfloat16])
def test_a_convolution_at_some_cells(kind: torch.dtype) -> None:
    torch.manual_seed(0)
    head = torch.nn.Conv2d(5, 2, 3, 1, 1).to(kind)
    features = torch.randn(2, 5, 8, 12).to(kind).to(memory_format=torch.channels_last)
    cells = torch.zeros(2, 8, 12, dtype=torch.bool)
    for cell in CELLS:
        cells[cell] = True
    with torch.inference_mode():
        found, whole = polenet_inference.at_cells(head, features, cells), head(features).float()
    tolerance = 1e-5 if kind == torch.float32 else 0.05
    for batch, row, column in CELLS:
        torch.testing.assert_close(
            found[batch, :, row, column], whole[batch, :, row, column], atol=tolerance, rtol=tolerance
        )
    assert not found.permute(0, 2, 3, 1)[~cells].any()


def test_a_convolution_at_no_and_at_most_cells() -> None:
    torch.manual_seed(0)
    head, features = torch.nn.Conv2d(5, 2, 3, 1, 1), torch.randn(1, 5, 8, 12)
    none = torch.zeros(1, 8, 12, dtype=torch.bool)
    with torch.inference_mode():
        assert not polenet_inference.at_cells(head, features, none).any()
        assert torch.equal(polenet_inference.at_cells(head, features, ~none), head(features))


@pytest.mark.parametrize("bias", [-9.0, 0.0, 9.0])  # of the mask: no pole, some of all pixels, poles only
def test_maps_have_offsets_wherever_there_is_a_mask(bias: float) -> None:
    torch.manual_seed(0)
    net = polenet.PoleNet().eval()
    torch.nn.init.constant_(net.mask.bias, bias)  # type: ignore[arg-type]
    framed = np.random.default_rng(0).integers(0, 256, (64, 96, 3)).astype(np.uint8)
    mask, centre, offsets = polenet_inference.maps(net, framed)
    assert mask.shape == (64, 96) and centre.shape == (8, 12) and offsets.shape == (2, 16, 24)
    with torch.inference_mode():
        whole = net(polenet_inference.to_input(framed[None]))[2][0].numpy()
    asked = (mask.reshape(16, 4, 24, 4) >= MASK_THRESHOLD).any(axis=(1, 3))
    assert offsets[:, asked] == pytest.approx(whole[:, asked], abs=1e-4)
    assert asked.any() == (bias >= 0)
