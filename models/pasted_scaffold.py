"""A house front behind scaffolding, drawn over a part of a training picture: what a pole is hardest to see before."""

from __future__ import annotations

import cv2
import numpy as np

from scpf.models.instances import Image
from scpf.models.labelled_images import Ids

Rectangle = tuple[int, int, int, int]  # x1, y1, x2, y2


def draw_scaffold(image: Image, ids: Ids, rng: np.random.Generator) -> Rectangle:
    """Draws it into ``image`` (H, W, 3) and takes the poles behind it out of ``ids``, in place; where it stands."""
    height, width = ids.shape
    wide, high = max(1, int(width * rng.uniform(0.3, 1.0))), int(height * rng.uniform(0.35, 0.85))
    x1, y1 = int(rng.integers(0, width - wide + 1)), int(rng.uniform(-0.3, 0.3) * height)
    x2, y2, y1 = x1 + wide, max(1, min(height, y1 + high)), max(0, y1)
    unit = max(2.0, height * rng.uniform(0.03, 0.14))  # the height of half a floor
    front = _wall((y2 - y1, wide), unit, rng)
    _tubes(front, unit, rng)
    image[y1:y2, x1:x2] = front
    ids[y1:y2, x1:x2] = 0
    return x1, y1, x2, y2


def _wall(shape: tuple[int, int], unit: float, rng: np.random.Generator) -> Image:
    """Plaster or bricks (h, w, 3) with rows of windows."""
    base = rng.uniform(15, 110) if rng.random() < 0.6 else rng.uniform(80, 240)
    colour = base + rng.uniform(-20, 20, 3)
    coarse = rng.standard_normal((max(2, shape[0] // 24), max(2, shape[1] // 24)), dtype=np.float32)
    relief = cv2.resize(coarse, shape[::-1], interpolation=cv2.INTER_CUBIC) * np.float32(rng.uniform(2, 18))
    relief += rng.standard_normal(shape, dtype=np.float32) * np.float32(rng.uniform(0, 10))
    wall = np.clip(colour + relief[..., None], 0, 255).astype(np.uint8)
    bay, floor = unit * rng.uniform(1.2, 3.0), unit * rng.uniform(1.6, 2.4)
    glass = np.clip(base * rng.uniform(0.1, 0.7) + rng.uniform(-8, 8, 3), 0, 255).tolist()
    for y in np.arange(rng.uniform(-1, 1) * floor, shape[0], floor):
        for x in np.arange(rng.uniform(-1, 1) * bay, shape[1], bay):
            if rng.random() < 0.8:
                end = (int(x + bay * 0.55), int(y + floor * 0.6))
                cv2.rectangle(wall, (int(x), int(y)), end, glass, -1)
                if rng.random() < 0.3:
                    cv2.rectangle(wall, (int(x), int(y)), end, np.clip(colour * 1.5, 0, 255).tolist(), 1)
    return wall


def _tubes(front: Image, unit: float, rng: np.random.Generator) -> None:
    """Two layers of standards, ledgers, planks and braces."""
    height, width = front.shape[:2]
    slope = rng.normal(0, 0.04)  # seen at an angle, what is level runs towards a vanishing point
    for _ in range(rng.integers(1, 3)):
        level = rng.uniform(40, 235)
        colour = np.clip(level + rng.uniform(-15, 15, 3), 0, 255).tolist()
        thick = int(rng.integers(1, 3))
        lift, bay = unit * rng.uniform(1.6, 2.2), unit * rng.uniform(1.3, 3.2)
        for y in np.arange(rng.uniform(0, 1) * lift, height * 1.2, lift):
            for offset, weight in ((0.0, thick + int(rng.integers(0, 2))), (-0.5 * lift, thick)):
                left, right = (0, int(y + offset)), (width, int(y + offset + slope * width))
                cv2.line(front, left, right, colour, weight, cv2.LINE_AA)
        standards = np.arange(rng.uniform(0, 1) * bay, width, bay)
        for x in standards:
            if rng.random() < 0.95:
                cv2.line(front, (int(x), 0), (int(x + rng.normal(0, 1)), height), colour, thick, cv2.LINE_AA)
            if rng.random() < 0.25:
                y = rng.uniform(0, height)
                cv2.line(front, (int(x), int(y)), (int(x + bay), int(y - lift)), colour, thick, cv2.LINE_AA)
