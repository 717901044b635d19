"""Rain in the picture: streaks of falling drops, and drops on the windscreen."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
STREAKS = 330
SLANT = 0.10
DROPS = (5, 14)


def add_rain(picture: Picture, rng: np.random.Generator) -> Picture:
    """The picture (H, W, 3) with streaks and drops whose sizes go with it."""
    streaks = _streaks(picture.shape[0], picture.shape[1], rng)
    wet = cv2.add(picture, cv2.merge([streaks] * 3)).astype(np.uint8)
    for _ in range(int(rng.integers(*DROPS))):
        _add_drop(wet, rng)
    return wet


def _streaks(height: int, width: int, rng: np.random.Generator) -> Picture:
    # Drawn at half size: streaks are wider than a pixel, and soft.
    layer = np.zeros(((height + 1) // 2, (width + 1) // 2), np.uint8)
    scale = width / 2048
    for _ in range(STREAKS):
        x, y = int(rng.integers(layer.shape[1])), int(rng.integers(layer.shape[0]))
        length, brightness = rng.uniform(8, 42) * scale, int(rng.uniform(8, 38))
        tip = (int(x + length * SLANT), int(y + length))
        cv2.line(layer, (x, y), tip, brightness, 1, cv2.LINE_AA)
    return np.asarray(cv2.GaussianBlur(cv2.resize(layer, (width, height)), (0, 0), 1.1), np.uint8)


def _add_drop(picture: Picture, rng: np.random.Generator) -> None:
    """Show within a drop its surroundings, small, blurred and upside down, in place."""
    height, width = picture.shape[:2]
    radius = max(2, int(rng.uniform(10, 34) * width / 2048))
    if min(height, width) <= 2 * radius + 5:
        return
    x = int(rng.integers(radius + 2, width - radius - 2))
    y = int(rng.integers(radius + 2, height - radius - 2))
    around = picture[max(0, y - 4 * radius) : y + 4 * radius, max(0, x - 4 * radius) : x + 4 * radius]
    small = cv2.flip(cv2.resize(around, (2 * radius, 2 * radius), interpolation=cv2.INTER_AREA), -1)
    shown = cv2.GaussianBlur(small, (0, 0), radius * 0.16 + 0.5)
    down, across = np.mgrid[-1 : 1 : 2 * radius * 1j, -1 : 1 : 2 * radius * 1j]
    share = np.clip((1 - np.hypot(across, down * 0.92)) * 4, 0, 1)[..., None]
    place = picture[y - radius : y + radius, x - radius : x + radius]
    place[:] = (place * (1 - share) + shown * share * 0.97).astype(np.uint8)
