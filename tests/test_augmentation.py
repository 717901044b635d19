"""What augmentation does to a picture: the same for a seed, and never to the outlines."""

from __future__ import annotations

import numpy as np

from scpf.models.augmentation import degrade, shaded

WHITE = np.full((60, 80, 3), 250, np.uint8)


def test_a_degraded_picture_is_the_same_for_its_seed() -> None:
    picture = np.random.default_rng(0).integers(0, 255, (60, 80, 3), np.uint8)
    first, again, other = (degrade(picture, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert first.shape == picture.shape
    assert first.dtype == np.uint8
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_shaded_picture_darkens_gradually_towards_one_side() -> None:
    spans = []
    for seed in range(30):
        dark = shaded(WHITE, np.random.default_rng(seed)).astype(int)
        assert np.array_equal(dark[..., 0], dark[..., 2])
        assert 0.2 * 250 - 1 <= dark.min() <= dark.max() <= 250
        for axis in (0, 1):
            steps = np.diff(dark[..., 0], axis=axis)
            assert np.all(steps >= 0) or np.all(steps <= 0)
            assert np.abs(steps).max() < 40
        spans.append(np.ptp(dark))
    assert np.median(spans) > 60
