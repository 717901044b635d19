"""Features: what the box and the mask say, whatever hangs beside the pole."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pole_scenes import camera, pose, see

from scpf.models.errors import InputError
from scpf.models.features import FEATURES, check_names, measure, thickness_px
from scpf.models.instances import Instance, instance_from_mask


def bar(width: int, height: int, left: int = 40, top: int = 5, slope: float = 0.0) -> np.ndarray:
    """A bar of a horizontal ``width`` that leans by ``slope`` columns a row, in an image of 320×240."""
    rows, columns = np.mgrid[0:240, 0:320]
    start = left + slope * (rows - top)
    return (rows >= top) & (rows < top + height) & (columns >= start) & (columns < start + width)


@given(st.integers(1, 30), st.integers(12, 200), st.integers(0, 200), st.integers(0, 30))
def test_an_upright_bar_is_as_thick_as_it_is_wide(width: int, height: int, left: int, top: int) -> None:
    assert thickness_px(instance_from_mask(bar(width, height, left, top))) == width


@given(st.integers(4, 30), st.floats(-0.4, 0.4))
def test_a_leaning_bar_is_measured_across_its_axis(width: int, slope: float) -> None:
    instance = instance_from_mask(bar(width, 200, 100, 5, slope))
    assert thickness_px(instance) == pytest.approx(width / np.hypot(1.0, slope), rel=0.03, abs=0.1)


@given(st.integers(2, 20), st.floats(-0.3, 0.3))
def test_a_mirrored_mask_has_the_same_thickness(width: int, slope: float) -> None:
    mask = bar(width, 150, 100, 5, slope)
    there, back = (thickness_px(instance_from_mask(m)) for m in (mask, mask[:, ::-1]))
    assert there == pytest.approx(back, rel=1e-12)


def test_an_arm_and_a_lamp_beside_the_pole_add_nothing() -> None:
    mask = bar(6, 200)
    alone = thickness_px(instance_from_mask(mask))
    mask[100:105, 46:120] = True  # an arm in the central rows, joined to the pole
    mask[105:118, 110:125] = True  # a lamp below it: a run of its own
    assert thickness_px(instance_from_mask(mask)) == alone == 6.0


def test_fractions_of_a_pixel_survive() -> None:
    mask = bar(3, 100)
    mask[5:105:2, 43] = True  # every second row is four wide
    assert thickness_px(instance_from_mask(mask)) == pytest.approx(3.5, abs=0.1)


def test_the_table_names_the_columns_and_flags_are_set() -> None:
    inside, cut, low = bar(5, 100, 50, 20), bar(5, 100, 50, 0), bar(5, 8)
    instances = [instance_from_mask(mask) for mask in (inside, cut, low)]
    found = measure(instances, 320, 240)
    assert found.names == tuple(FEATURES)
    assert found.columns(("thickness", "x1", "y2"))[0].tolist() == [5.0, 50.0, 120.0]
    assert found.cut.tolist() == [False, True, False]
    assert found.too_small.tolist() == [False, False, True]
    assert len(found.rows(np.array([1]))) == 1
    assert measure([], 320, 240).values.shape == (0, len(FEATURES))


def test_a_mask_without_central_rows_is_too_small() -> None:
    hollow = Instance((10.0, 10.0, 20.0, 110.0), np.zeros((100, 10), dtype=bool), (10, 10), 1.0)
    short = Instance((10.0, 10.0, 20.0, 110.0), np.ones((5, 10), dtype=bool), (10, 10), 1.0)
    assert measure([hollow, short], 320, 240).too_small.all()


def test_a_pole_is_thinner_the_further_it_is() -> None:
    lens = camera()
    seen = [see(lens, pose(), (x, 3.0)) for x in (8, 12, 18, 27, 40)]
    thickness = [thickness_px(each) for each in seen if each is not None]
    assert len(thickness) == 5
    assert (np.diff(thickness) < 0).all()


def test_unknown_features_are_refused() -> None:
    with pytest.raises(InputError, match="colour"):
        check_names(("x1", "colour"))
