"""Features: the table, its flags, and what counts as too small."""

from __future__ import annotations

import numpy as np
import pytest

from scpf.models.errors import InputError
from scpf.models.features import FEATURES, UNSCALED, check_names, measure
from scpf.models.instances import Instance, instance_from_mask


def bar(width: int, height: int, left: int = 40, top: int = 5) -> np.ndarray:
    """An upright bar of a horizontal ``width`` in an image of 320×240."""
    rows, columns = np.mgrid[0:240, 0:320]
    return (rows >= top) & (rows < top + height) & (columns >= left) & (columns < left + width)


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


def test_only_the_named_features_count() -> None:
    hollow = Instance((10.0, 10.0, 20.0, 110.0), np.zeros((100, 10), dtype=bool), (10, 10), 1.0)
    found = measure([hollow], 320, 240, ("y2", "x1"))
    assert found.names == ("y2", "x1")
    assert found.values.tolist() == [[110.0, 10.0]]
    assert not found.too_small.any()
    with pytest.raises(InputError, match="colour"):
        measure([hollow], 320, 240, ("colour",))


def test_cut_is_an_input_by_edge() -> None:
    boxes = [bar(5, 100, 50, 20), bar(5, 100, 50, 0), bar(5, 100, 0, 20), bar(5, 140, 50, 100)]
    found = measure([instance_from_mask(mask) for mask in boxes], 320, 240, ("cut", "cut_top"))
    assert found.values.tolist() == [[0, 0], [1, 1], [1, 0], [1, 0]]


def test_a_feature_scales_with_the_image_unless_it_is_listed() -> None:
    mask = bar(6, 160, 40, 20)
    mask[20:26, 40:90] = True
    once, twice = (
        measure([instance_from_mask(np.kron(mask, np.ones((k, k), dtype=bool)))], 320 * k, 240 * k)
        for k in (1, 2)
    )
    factors = np.array([1.0 if name in UNSCALED else 2.0 for name in once.names])
    np.testing.assert_allclose(twice.values[0], once.values[0] * factors, atol=0.05)


def test_unknown_features_are_refused() -> None:
    with pytest.raises(InputError, match="colour"):
        check_names(("x1", "colour"))
