"""Boxes: overlap and suppression against plain loops, offsets there and back."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from scpf.models import box_ops


def random_boxes(rng: np.random.Generator, count: int, side_px: float = 100.0) -> torch.Tensor:
    corners = rng.uniform(0, side_px, (count, 2))
    return torch.from_numpy(np.hstack([corners, corners + rng.uniform(1, 40, (count, 2))])).float()


def greedy(boxes: torch.Tensor, scores: torch.Tensor, threshold: float) -> list[int]:
    """Non-maximum suppression as it is usually written."""
    kept: list[int] = []
    for i in sorted(range(len(boxes)), key=lambda i: -float(scores[i])):
        if all(float(box_ops.overlaps(boxes[k : k + 1], boxes[i : i + 1])) <= threshold for k in kept):
            kept.append(i)
    return kept


def test_overlaps_of_known_boxes() -> None:
    boxes = torch.tensor([[0.0, 0, 10, 10], [5, 0, 15, 10], [20, 20, 21, 21]])
    expected = torch.tensor([[1, 1 / 3, 0], [1 / 3, 1, 0], [0, 0, 1]])
    torch.testing.assert_close(box_ops.overlaps(boxes, boxes), expected)


@given(st.integers(0, 2**32 - 1), st.integers(0, 60), st.sampled_from([0.1, 0.3, 0.5, 0.7]))
def test_suppression_is_the_greedy_one(seed: int, count: int, threshold: float) -> None:
    rng = np.random.default_rng(seed)
    boxes, scores = random_boxes(rng, count), torch.from_numpy(rng.permutation(count)).float()
    assert box_ops.suppress(boxes, scores, threshold).tolist() == greedy(boxes, scores, threshold)


def test_groups_do_not_suppress_each_other() -> None:
    boxes = torch.tensor([[0.0, 0, 10, 10]]).repeat(4, 1)
    scores, groups = torch.tensor([0.1, 0.9, 0.5, 0.3]), torch.tensor([0, 1, 0, 1])
    assert box_ops.suppress_by_group(boxes, scores, groups, 0.5).tolist() == [1, 2]
    empty = box_ops.suppress_by_group(boxes[:0], scores[:0], groups[:0], 0.5)
    assert empty.shape == (0,)


@given(st.integers(0, 2**32 - 1))
def test_offsets_move_boxes_onto_their_targets(seed: int) -> None:
    rng = np.random.default_rng(seed)
    boxes, targets = random_boxes(rng, 20), random_boxes(rng, 20)
    weights = (10.0, 10.0, 5.0, 5.0)
    there = box_ops.moved(boxes, box_ops.offsets(boxes, targets, weights), weights)[:, 0]
    torch.testing.assert_close(there, targets, rtol=0, atol=1e-3)


def test_no_head_enlarges_a_box_without_limit() -> None:
    box = torch.tensor([[0.0, 0, 16, 16]])
    moved = box_ops.moved(box, torch.tensor([[0.0, 0, 50, 50]]), (1.0, 1.0, 1.0, 1.0))[0, 0]
    assert (moved[2:] - moved[:2]).tolist() == pytest.approx([1000, 1000], rel=1e-5)


def test_boxes_are_cut_at_the_image() -> None:
    boxes = torch.tensor([[[-5.0, -5, 300, 10]], [[1, 2, 3, 4]]])
    assert box_ops.clip(boxes, (50, 100)).tolist() == [[[0, 0, 100, 10]], [[1, 2, 3, 4]]]
