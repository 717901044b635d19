"""ROIAlign against the definition: bilinear samples, one by one."""

from __future__ import annotations

import math

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from scpf.models.roi_align import roi_align


def sample(plane: np.ndarray, y: float, x: float) -> float:
    """The bilinear value of a plane (H, W) at a place in cells; 0 beyond the border by more than one."""
    height, width = plane.shape
    if not (-1 <= y <= height and -1 <= x <= width):
        return 0.0
    y, x = min(max(y, 0), height - 1), min(max(x, 0), width - 1)
    y0, x0 = int(y), int(x)
    y1, x1 = min(y0 + 1, height - 1), min(x0 + 1, width - 1)
    fy, fx = y - y0, x - x0
    upper = (1 - fx) * plane[y0, x0] + fx * plane[y0, x1]
    lower = (1 - fx) * plane[y1, x0] + fx * plane[y1, x1]
    return float((1 - fy) * upper + fy * lower)


def by_definition(
    plane: np.ndarray, box: np.ndarray, bins: int, scale: float, samples: int, aligned: bool
) -> np.ndarray:
    x1, y1, x2, y2 = box * scale - (0.5 if aligned else 0.0)
    width, height = x2 - x1, y2 - y1
    if not aligned:
        width, height = max(width, 1.0), max(height, 1.0)
    ny = samples or max(1, math.ceil(height / bins))
    nx = samples or max(1, math.ceil(width / bins))
    out = np.zeros((bins, bins))
    for i in range(bins):
        for j in range(bins):
            ys = [y1 + (i + (k + 0.5) / ny) * height / bins for k in range(ny)]
            xs = [x1 + (j + (k + 0.5) / nx) * width / bins for k in range(nx)]
            out[i, j] = np.mean([sample(plane, y, x) for y in ys for x in xs])
    return out


@given(st.integers(0, 2**32 - 1), st.booleans(), st.sampled_from([0, 1, 2]), st.sampled_from([3, 7]))
@settings(max_examples=40)
def test_it_is_the_definition(seed: int, aligned: bool, samples: int, bins: int) -> None:
    rng = np.random.default_rng(seed)
    features = rng.normal(size=(2, 3, 13, 9)).astype(np.float32)
    corners = rng.uniform(-20, 60, (5, 2))
    boxes = np.hstack([corners, corners + rng.uniform(0.1, 70, (5, 2))]).astype(np.float32)
    images = rng.integers(0, 2, 5)
    pooled = roi_align(
        torch.from_numpy(features),
        torch.from_numpy(boxes),
        torch.from_numpy(images),
        bins,
        0.25,
        samples=samples,
        aligned=aligned,
    )
    for k in range(5):
        for channel in range(3):
            plane = features[images[k], channel].astype(float)
            expected = by_definition(plane, boxes[k].astype(float), bins, 0.25, samples, aligned)
            # A sample that lies on the limit itself may count or not, by the last bit.
            assert np.mean(np.abs(pooled[k, channel].numpy() - expected) < 1e-4) > 0.9


def test_a_whole_box_gives_the_cells_themselves() -> None:
    features = torch.arange(16.0).reshape(1, 1, 4, 4)
    pooled = roi_align(features, torch.tensor([[0.0, 0, 16, 16]]), torch.tensor([0]), 4, 0.25)
    torch.testing.assert_close(pooled, features)


def test_many_boxes_are_the_same_as_one_by_one() -> None:
    rng = np.random.default_rng(3)
    features = torch.from_numpy(rng.normal(size=(1, 2, 20, 20))).float()
    corners = rng.uniform(0, 50, (300, 2))
    boxes = torch.from_numpy(np.hstack([corners, corners + rng.uniform(1, 30, (300, 2))])).float()
    images = torch.zeros(300, dtype=torch.long)
    together = roi_align(features, boxes, images, 7, 0.25)
    for k in (0, 1, 150, 299):
        alone = roi_align(features, boxes[k : k + 1], images[:1], 7, 0.25)
        torch.testing.assert_close(together[k : k + 1], alone)


def test_gradients_reach_the_features() -> None:
    features = torch.zeros(1, 1, 8, 8, dtype=torch.float64, requires_grad=True)
    boxes = torch.tensor([[2.0, 3, 20, 29], [0, 0, 5, 31]])
    images = torch.zeros(2, dtype=torch.long)
    assert torch.autograd.gradcheck(
        lambda x: roi_align(x, boxes, images, 3, 0.25, samples=2), (features,), check_batched_grad=False
    )


def test_no_boxes_give_no_features() -> None:
    empty = roi_align(torch.zeros(1, 5, 4, 4), torch.zeros(0, 4), torch.zeros(0, dtype=torch.long), 7, 0.25)
    assert empty.shape == (0, 5, 7, 7)
