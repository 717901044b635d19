"""Signs on posts, drawn into a training picture: upright and thin as a light pole is, and none."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scpf.models.instances import Image
from scpf.models.labelled_images import Ids
from scpf.models.painting import fill_polygon, plate_outline

CAMERA_M = (1.4, 2.4)  # above the road, as in the painted scenes
HEIGHT_M = (1.6, 3.8)
POST_RADIUS_M, PLATE_RADIUS_M = (0.025, 0.06), (0.2, 0.55)
FROM_BEHIND = 0.5  # share of the signs whose post stands before their grey backs

Corners = NDArray[np.float64]


def draw_sign(
    image: Image, ids: Ids, x_px: float, foot_px: float, horizon_px: float, rng: np.random.Generator
) -> None:
    """One post with one to four plates, in place; poles behind them lose their labels.

    ``foot_px``: the row where it stands, below the horizon's row ``horizon_px``: that gives its size on a level road.
    """
    px_per_m = (foot_px - horizon_px) / rng.uniform(*CAMERA_M)
    high, radius = rng.uniform(*HEIGHT_M) * px_per_m, max(0.5, rng.uniform(*POST_RADIUS_M) * px_per_m)
    around = float(image[:, min(max(int(x_px), 0), image.shape[1] - 1)].mean())
    metal = rng.uniform(30, 230) if rng.random() < 0.5 else around * rng.uniform(0.5, 1.6)
    behind = rng.random() < FROM_BEHIND
    if not behind:
        _post(image, ids, (x_px, foot_px), (radius, high), metal, rng)
    back, y = rng.uniform(15, 130), foot_px - high
    for _ in range(rng.integers(1, 5)):
        size = rng.uniform(*PLATE_RADIUS_M) * px_per_m
        outline, tall = _outline(size, rng)
        outline += (x_px, y + tall)
        y += 2 * tall + rng.uniform(0.0, 0.3) * px_per_m
        if y > foot_px - 0.4 * high:
            break
        fill_polygon(
            image, ids, outline, _colour(back, 8, rng) if behind else _colour(rng.uniform(15, 245), 40, rng)
        )
        if not behind:
            middle = outline.mean(axis=0)
            fill_polygon(
                image, ids, middle + 0.75 * (outline - middle), _colour(rng.uniform(80, 250), 20, rng)
            )
            glyph = np.array([(-0.12, -0.4), (0.12, -0.4), (0.12, 0.4), (-0.12, 0.4)]) * size
            fill_polygon(
                image, ids, middle + glyph[:, :: rng.choice([-1, 1])], _colour(rng.uniform(5, 120), 20, rng)
            )
    if behind:
        _post(image, ids, (x_px, foot_px), (radius, high), metal, rng)


def _outline(size_px: float, rng: np.random.Generator) -> tuple[Corners, float]:
    """A triangle, rectangle, octagon or disc, turned away a little, about its middle; half of its height."""
    corners = int(rng.choice([3, 4, 4, 8, 24]))
    wide, tall = rng.choice([1.0, rng.uniform(0.35, 1.0)]), 1.0
    if corners == 4:
        wide, tall = wide * rng.uniform(0.6, 1.3), rng.choice([0.2, rng.uniform(0.6, 1.3)])
    outline = plate_outline(corners) * (wide, tall * rng.choice([-1, 1])) * size_px
    half = float(np.ptp(outline[:, 1])) / 2
    outline[:, 1] -= outline[:, 1].min() + half
    return outline, half


def _post(
    image: Image,
    ids: Ids,
    foot_px: tuple[float, float],
    size_px: tuple[float, float],
    level: float,
    rng: np.random.Generator,
) -> None:
    """A round post of (radius, height) px, lit from one side."""
    (x, y), (radius, high) = foot_px, size_px
    lean, light = rng.normal(0.0, 0.01) * high, rng.uniform(-1, 1)
    tint = rng.uniform(-10, 10, 3)
    edges = np.linspace(-radius, radius, 6 if radius > 2 else 2)
    for left, right in pairwise(edges):
        across = (left + right) / 2 / radius
        lit = 0.55 + 0.6 * max(0.0, 0.7 * np.sqrt(1 - across**2) + 0.5 * across * light)
        stripe = np.array(
            [(x + left, y), (x + right, y), (x + right + lean, y - high), (x + left + lean, y - high)]
        )
        fill_polygon(image, ids, stripe, np.clip(level * lit + tint, 0, 255).tolist())


def _colour(level: float, tint: float, rng: np.random.Generator) -> list[float]:
    return list(np.clip(level + rng.uniform(-tint, tint, 3), 0, 255).tolist())
