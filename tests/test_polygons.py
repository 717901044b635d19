"""Polygons filled by their pixels' centres, and outlines that fill to the mask they came from."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import ndimage

from scpf.models.instances import BoolMask
from scpf.models.polygons import fill, outlines


def full(points: list[list[float]], width: int, height: int) -> BoolMask:
    mask, (x, y) = fill(np.array(points), width, height)
    whole = np.zeros((height, width), dtype=bool)
    whole[y : y + mask.shape[0], x : x + mask.shape[1]] = mask
    return whole


@pytest.mark.parametrize(("width_px", "pixels"), [(1.0, 1), (2.0, 2), (3.0, 3), (4.0, 4), (5.6, 6), (8.0, 8)])
def test_a_pole_keeps_its_width(width_px: float, pixels: int) -> None:
    left = 10.2
    pole = full([[left, 5], [left + width_px, 5], [left + width_px, 90], [left, 90]], 40, 100)
    assert set(pole.sum(1).tolist()) == {0, pixels}
    assert np.flatnonzero(pole.any(1)).tolist() == list(range(5, 90))


def test_a_leaning_pole_has_its_true_area() -> None:
    pole = full([[10, 0], [14, 0], [34, 100], [30, 100]], 64, 100)
    assert pole.sum() == pytest.approx(400, abs=4)


def test_polygons_may_cross_themselves_and_leave_the_picture() -> None:
    bow_tie = full([[0, 0], [20, 20], [20, 0], [0, 20]], 20, 20)
    assert bow_tie[10, 2] and bow_tie[10, 17] and not bow_tie[3, 10]
    assert full([[-1e9, -1e9], [1e9, -1e9], [1e9, 1e9], [-1e9, 1e9]], 7, 5).all()
    assert fill(np.array([[30.0, 1], [40, 1], [40, 4]]), 20, 20)[0].size == 0
    assert fill(np.array([[3.0, 3], [3, 9], [3, 6]]), 20, 20)[0].size == 0


@pytest.mark.parametrize("points", [[[0, 0], [1, 1]], [[0, 0], [1, float("nan")], [1, 0]], [0, 1, 2]])
def test_what_is_no_polygon_is_refused(points: list[list[float]]) -> None:
    with pytest.raises(ValueError, match=r"three points|finite"):
        fill(np.array(points, dtype=float), 20, 20)


@given(
    arrays(np.float64, st.tuples(st.integers(3, 9), st.just(2)), elements=st.floats(-20, 60)),
)
def test_a_pixel_is_set_where_its_centre_lies_inside(points: np.ndarray) -> None:
    """Against the parity of the edges to the left of each centre, edge by edge."""
    whole = full(points.tolist(), 30, 20)
    y, x = np.mgrid[0:20, 0:30] + 0.5
    parity = np.zeros((20, 30), dtype=int)
    for (x1, y1), (x2, y2) in zip(points, np.roll(points, -1, axis=0), strict=True):
        crossed = (y1 <= y) != (y2 <= y)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            parity += crossed & (x1 + (y - y1) / (y2 - y1) * (x2 - x1) <= x)
    assert np.array_equal(whole, parity % 2 == 1)


@given(arrays(np.bool_, st.tuples(st.integers(1, 9), st.integers(1, 9))))
def test_outlines_fill_to_the_mask(mask: BoolMask) -> None:
    found = np.zeros((20, 20), dtype=bool)
    parts = outlines(mask, (3, 5))
    assert len(parts) == ndimage.label(mask)[1]
    for points in parts:
        part = full(points.tolist(), 20, 20)
        assert not (found & part).any()
        found |= part
    assert np.array_equal(found[5 : 5 + mask.shape[0], 3 : 3 + mask.shape[1]], mask)
    assert found.sum() == mask.sum()


def test_a_box_has_four_corners() -> None:
    assert sorted(outlines(np.ones((5, 2), dtype=bool))[0].tolist()) == [[0, 0], [0, 5], [2, 0], [2, 5]]
