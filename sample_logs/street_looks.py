"""Random colours and textures of the street scenes."""

from __future__ import annotations

import cv2
import numpy as np

from scpf.sample_logs.street_canvas import Colour, Floats


def grey(rng: np.random.Generator, low: float, high: float, tint: float = 12.0) -> Colour:
    """A nearly grey colour between the two levels."""
    b, g, r = np.clip(rng.uniform(low, high) + rng.uniform(-tint, tint, 3), 0, 255)
    return float(b), float(g), float(r)


def any_colour(rng: np.random.Generator, low: float, high: float) -> Colour:
    """A colour between the two levels, often a dull one."""
    channels = rng.uniform(low, high, 3)
    dull = rng.uniform(0.1, 0.9)
    b, g, r = channels * (1 - dull) + channels.mean() * dull
    return float(b), float(g), float(r)


def smooth_noise(rng: np.random.Generator, shape: tuple[int, int], cell_px: float) -> Floats:
    """Noise (h, w) of unit deviation at its knots, ``cell_px`` apart."""
    knots = (max(2, int(shape[0] / cell_px)), max(2, int(shape[1] / cell_px)))
    coarse = rng.standard_normal(knots, dtype=np.float32)
    return np.asarray(cv2.resize(coarse, (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC))


def foliage(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Opacity and brightness (256, 256) of a leafy crown with gaps, for `Canvas.stamp`."""
    size = 256
    y, x = np.mgrid[-1 : 1 : size * 1j, -1 : 1 : size * 1j].astype(np.float32)
    clumps = smooth_noise(rng, (size, size), 45) * 0.22
    leaves = smooth_noise(rng, (size, size), rng.uniform(4, 12))
    inside = 0.8 - np.hypot(x, y) + clumps + leaves * rng.uniform(0.08, 0.22)
    lit = 0.85 + 0.35 * leaves + 0.3 * smooth_noise(rng, (size, size), 40) - 0.25 * y
    return np.clip(inside * 12, 0, 1), np.clip(lit, 0.15, 2.2)
