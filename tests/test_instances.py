"""Run lengths and boxes of instances."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from scpf.models.instances import decode_runs, encode_runs, instance_from_mask


@given(arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=12)))
def test_runs_come_back(mask: np.ndarray) -> None:
    runs = encode_runs(mask)
    assert runs.sum() == mask.size
    assert np.array_equal(decode_runs(runs, *mask.shape), mask)


def test_runs_go_down_the_columns_and_start_with_background() -> None:
    mask = np.array([[True, False], [True, True]])
    assert encode_runs(mask).tolist() == [0, 2, 1, 1]


@given(st.lists(st.integers(0, 50), max_size=6), st.integers(0, 9), st.integers(0, 9))
def test_runs_of_another_size_are_refused(runs: list[int], height: int, width: int) -> None:
    if sum(runs) == height * width:
        assert decode_runs(runs, height, width).shape == (height, width)
    else:
        with pytest.raises(ValueError, match="add up"):
            decode_runs(runs, height, width)


def test_instance_of_a_full_mask() -> None:
    full = np.zeros((20, 30), bool)
    full[4:16, 7:9] = True
    instance = instance_from_mask(full, 0.7, "pole-3")
    assert instance.box_px == (7, 4, 9, 16)
    assert (instance.width_px, instance.height_px) == (2, 12)
    assert instance.offset_px == (7, 4)
    assert instance.mask.all()
    assert (instance.score, instance.landmark_id) == (0.7, "pole-3")


def test_an_empty_mask_is_no_instance() -> None:
    with pytest.raises(ValueError, match="empty"):
        instance_from_mask(np.zeros((3, 3), bool))
