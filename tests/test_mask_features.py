"""Mask features: what the pole is, whatever hangs beside it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pole_scenes import camera, pose, see

from scpf.models.features import measure
from scpf.models.instances import Instance, instance_from_mask
from scpf.models.mask_features import MASK_FEATURES, Masks, thickness_px


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


def test_a_pole_is_thinner_the_further_it_is() -> None:
    lens = camera()
    seen = [see(lens, pose(), (x, 3.0)) for x in (8, 12, 18, 27, 40)]
    thickness = [thickness_px(each) for each in seen if each is not None]
    assert len(thickness) == 5
    assert (np.diff(thickness) < 0).all()


def found(mask: np.ndarray) -> dict[str, float]:
    """Every mask feature of one mask."""
    masks = Masks([instance_from_mask(mask)])
    return {name: float(feature(masks)[0]) for name, feature in MASK_FEATURES.items()}


@given(st.integers(3, 20), st.integers(60, 200), st.integers(0, 30), st.floats(-0.3, 0.3))
def test_the_axis_of_a_bar(width: int, height: int, top: int, slope: float) -> None:
    values = found(bar(width, height, 100, top, slope))
    assert values["base_row"] == top + height
    assert values["axis_length"] == pytest.approx(height * np.hypot(1.0, slope), rel=0.02)
    # A line through columns that are each rounded by up to half a pixel leans by up to 1.5 px over its height more.
    assert values["tilt"] == pytest.approx(np.arctan(slope), abs=1.6 / height)
    assert values["lamp"] == 0.0
    for name in ("mean_width", "width_15", "width_35", "width_65", "width_85"):
        assert values[name] == pytest.approx(width / np.hypot(1.0, slope), abs=0.5)


def test_widths_follow_a_taper() -> None:
    rows, columns = np.mgrid[0:240, 0:320]
    half = 4.0 + 6.0 * rows / 240  # 8 px wide above, 20 below
    values = found(np.abs(columns - 159.5) < half)
    for percent in (15, 35, 65, 85):
        expected = 20.0 - 0.12 * percent
        assert values[f"width_{percent}"] == pytest.approx(expected, abs=0.7)
    assert values["mean_width"] == pytest.approx(14.0, abs=0.7)


def test_an_arm_is_a_lamp_and_no_part_of_the_axis() -> None:
    mask = bar(6, 160, 40, 20)
    alone = found(mask)
    mask[20:26, 40:90] = True
    lamp = found(mask)
    assert (alone["lamp"], lamp["lamp"]) == (0.0, 1.0)
    assert found(mask[:, ::-1])["lamp"] == 1.0
    assert lamp["axis_length"] == alone["axis_length"] - 6
    for name in ("base_row", "tilt", "mean_width", "width_85"):
        assert lamp[name] == alone[name]


def test_a_base_plate_belongs_to_the_axis_but_not_to_the_widths() -> None:
    mask = bar(6, 160, 40, 20)
    mask[172:180, 32:54] = True
    values = found(mask)
    assert values["base_row"] == 180
    assert values["mean_width"] == values["width_15"] == 6.0


def test_an_arm_in_the_middle_is_no_lamp() -> None:
    mask = bar(6, 160, 40, 20)
    mask[100:104, 40:90] = True
    assert found(mask)["lamp"] == 0.0


@given(st.integers(0, 2**32 - 1), st.integers(12, 40), st.integers(1, 30), st.floats(0.02, 0.98))
def test_all_are_finite_where_the_thickness_is(seed: int, height: int, width: int, share: float) -> None:
    mask = np.random.default_rng(seed).random((height, width)) < share
    instance = Instance((5.0, 5.0, 5.0 + width, 5.0 + height), mask, (5, 5), 1.0)
    finite = np.isfinite([feature(Masks([instance]))[0] for feature in MASK_FEATURES.values()])
    assert finite.all() or not finite.any()
    assert finite.any() == np.isfinite(thickness_px(instance))


def test_the_memory_order_of_a_mask_does_not_matter() -> None:
    instance = instance_from_mask(bar(5, 150, 100, 5, 0.2))
    turned = Instance(instance.box_px, np.asfortranarray(instance.mask), instance.offset_px, 1.0)
    np.testing.assert_array_equal(*(measure([each], 320, 240).values for each in (instance, turned)))
