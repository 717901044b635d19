"""Leaf cards: small pictures of twigs, with holes, of which the crowns of trees are made."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

CARD_SIZE, LEVELS = 128, 6
_DRAWN = 512
"""Cards are drawn at this size and averaged down."""
OPAQUE = 111.0
"""Alpha from which the rasteriser takes a texel as leaf."""
LARGE_LEAVES, SMALL_LEAVES, NEEDLES = 0, 1, 2


def leaf_cards(
    rng: np.random.Generator,
) -> tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.int64]]:
    """Alpha and luminance (total,) of all levels of the three cards, and where each level begins (3, 6).

    Smaller levels keep the share of leaf (Castaño, "Computing alpha mipmaps", 2010): far crowns do not thin.
    """
    alphas, luminances, offsets, position = [], [], np.zeros((3, LEVELS), np.int64), 0
    for card in (LARGE_LEAVES, SMALL_LEAVES, NEEDLES):
        alpha, luminance = _twig(rng) if card == NEEDLES else _leaves(rng, card)
        share = float((alpha > 127).mean())
        for level in range(LEVELS):
            size = CARD_SIZE >> level
            small = cv2.resize(alpha, (size, size), interpolation=cv2.INTER_AREA)
            threshold = max(float(np.quantile(small, 1 - share)), 1.0)
            kept = np.clip(small.astype(float) * (OPAQUE / threshold), 0, 255).astype(np.uint8)
            alphas.append(kept.ravel())
            luminances.append(cv2.resize(luminance, (size, size), interpolation=cv2.INTER_AREA).ravel())
            offsets[card, level] = position
            position += size * size
    return np.concatenate(alphas), np.concatenate(luminances), offsets


def _leaves(rng: np.random.Generator, card: int) -> tuple[NDArray[Any], NDArray[Any]]:
    alpha, luminance = np.zeros((_DRAWN, _DRAWN), np.uint8), np.zeros((_DRAWN, _DRAWN), np.uint8)
    count, scale = (150, 1.0) if card == LARGE_LEAVES else (260, 0.64)
    outline = rng.uniform(0.75, 1.0, 9)  # a lobed outline: round or square cards show their shape in a crown
    for _ in range(count):
        angle = rng.uniform(0, 2 * np.pi)
        lobe = np.interp(angle, np.linspace(0, 2 * np.pi, 10), np.append(outline, outline[0]))
        reach = np.sqrt(rng.uniform()) * _DRAWN * 0.45 * lobe
        centre = (int(_DRAWN / 2 + reach * np.cos(angle)), int(_DRAWN / 2 + reach * np.sin(angle)))
        axes = (int(rng.uniform(20, 36) * scale), int(rng.uniform(10, 18) * scale))
        turn, shade = rng.uniform(0, 360), int(np.clip(rng.normal(150, 48), 30, 255))
        cv2.ellipse(alpha, centre, axes, turn, 0, 360, 255, -1)
        cv2.ellipse(luminance, centre, axes, turn, 0, 360, shade, -1)
        along = np.array([np.cos(np.radians(turn)), np.sin(np.radians(turn))]) * axes[0]
        tip = (int(centre[0] + along[0]), int(centre[1] + along[1]))
        cv2.line(luminance, centre, tip, min(255, shade + 35), 2)
    return alpha, luminance


def _twig(rng: np.random.Generator) -> tuple[NDArray[Any], NDArray[Any]]:
    alpha, luminance = np.zeros((_DRAWN, _DRAWN), np.uint8), np.zeros((_DRAWN, _DRAWN), np.uint8)
    stem = ((_DRAWN // 2, 0), (_DRAWN // 2, _DRAWN - 10))
    cv2.line(alpha, *stem, 255, 10)
    cv2.line(luminance, *stem, 70, 10)
    for _ in range(420):
        y = rng.uniform(0, _DRAWN)
        half_width = _DRAWN * 0.46 * np.clip((1 - abs(y / _DRAWN - 0.62) / 0.62), 0.1, 1)
        x = _DRAWN / 2 + rng.uniform(-0.6, 0.6) * half_width
        side, length = (1 if x > _DRAWN / 2 else -1), rng.uniform(30, 80)
        root, tip = (int(x), int(y)), (int(x + side * length * 0.8), int(y + length * 0.6))
        shade = int(np.clip(rng.normal(135, 50), 20, 255))
        cv2.line(alpha, root, tip, 255, 6)
        cv2.line(luminance, root, tip, shade, 6)
    return alpha, luminance
