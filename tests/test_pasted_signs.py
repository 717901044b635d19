"""Signs drawn into training pictures: as high as signs are, no poles, and before the poles behind them."""

from __future__ import annotations

import numpy as np
import pytest

from scpf.models import pasted_signs
from scpf.models.pasted_signs import CAMERA_M, HEIGHT_M, PLATE_RADIUS_M, draw_sign

GREY = 120
FOOT, HORIZON = 250.0, 130.0


def drawn(seed: int, x_px: float = 200.0) -> tuple[np.ndarray, np.ndarray]:
    image, ids = np.full((300, 400, 3), GREY, np.uint8), np.full((300, 400), 7, np.uint8)
    draw_sign(image, ids, x_px, FOOT, HORIZON, np.random.default_rng(seed))
    return image, ids


def test_a_sign_takes_the_label_of_what_it_hides_and_nothing_else() -> None:
    for seed in range(20):
        image, ids = drawn(seed)
        assert set(np.unique(ids).tolist()) == {0, 7}
        changed = (image != GREY).any(axis=2)
        assert not (changed & (ids == 7)).sum() > 0.6 * changed.sum()  # the rest are rims half covered
        assert ((ids == 0) & ~changed).sum() <= 0.05 * (ids == 0).sum()  # what is as grey as the ground


def test_a_sign_is_as_high_as_signs_are_on_a_level_road() -> None:
    heights_m = []
    for seed in range(40):
        rows = np.flatnonzero((drawn(seed)[1] == 0).any(axis=1))
        assert abs(rows[-1] - FOOT) <= 3
        heights_m.append((rows[-1] - rows[0]) / (FOOT - HORIZON))  # in camera heights
    assert min(heights_m) > 0.9 * HEIGHT_M[0] / CAMERA_M[1]
    assert max(heights_m) < (HEIGHT_M[1] + 2 * PLATE_RADIUS_M[1]) / CAMERA_M[0]


def test_the_post_stands_before_its_plates_where_a_sign_is_seen_from_behind(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    broken = {}
    for share in (0.0, 1.0):
        monkeypatch.setattr(pasted_signs, "FROM_BEHIND", share)
        broken[share] = 0
        for seed in range(20):
            image, ids = drawn(seed)
            post = image[ids[:, 200] == 0, 200].astype(int)[3:-3]
            broken[share] += int(np.ptp(post, axis=0).max() > 30)
    assert broken[0.0] > 10
    assert broken[1.0] <= 2  # it leans a little


@pytest.mark.parametrize("size", [(1, 1), (3, 200), (200, 2)])
def test_a_picture_however_small_takes_a_sign(size: tuple[int, int]) -> None:
    for seed in range(12):
        image, ids = np.full((*size, 3), GREY, np.uint8), np.ones(size, np.uint8)
        for x in (-50.0, 0.0, size[1] - 1.0, size[1] + 50.0):
            draw_sign(image, ids, x, size[0] * 0.8, size[0] / 2, np.random.default_rng(seed))
