"""labelme files for the tests, and what they shall be read to."""

from __future__ import annotations

import base64
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from scpf.models.instances import BoolMask
from scpf.models.labelled_images import LabelledObject

Read = Callable[[dict[str, Any]], list[LabelledObject]]

WIDTH, HEIGHT = 40, 60


def whole(labelled: LabelledObject, width: int = WIDTH, height: int = HEIGHT) -> BoolMask:
    (x, y), mask = labelled.instance.offset_px, labelled.instance.mask
    full = np.zeros((height, width), dtype=bool)
    full[y : y + mask.shape[0], x : x + mask.shape[1]] = mask
    assert labelled.instance.box_px == (x, y, x + mask.shape[1], y + mask.shape[0])
    return full


def png(mask: np.ndarray) -> str:
    return base64.b64encode(cv2.imencode(".png", mask)[1].tobytes()).decode()


def shape(kind: str, points: list[list[float]], **more: Any) -> dict[str, Any]:
    return {
        "label": "light_pole",
        "shape_type": kind,
        "points": points,
        "group_id": None,
        "flags": {},
        **more,
    }


def labelme(shapes: list[dict[str, Any]]) -> dict[str, Any]:
    return {"version": "5.5.0", "flags": {}, "shapes": shapes, "imagePath": "a.jpg", "imageData": None,
            "imageHeight": HEIGHT, "imageWidth": WIDTH}  # fmt: skip


def box(x1: int, y1: int, x2: int, y2: int) -> BoolMask:
    full = np.zeros((HEIGHT, WIDTH), dtype=bool)
    full[y1:y2, x1:x2] = True
    return full
