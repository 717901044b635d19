"""labelme's JSON of instances, to be read back to the same masks, or corrected by a person in labelme itself."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np

from scpf.models.instances import Instance
from scpf.models.polygons import Points, outlines

VERSION = "5.5.0"  # of labelme, whose layout this is


class Labelled(NamedTuple):
    """An instance to be written, and what its shapes say in ``description``."""

    instance: Instance
    note: str = ""


def labelme_json(
    image_name: str, size_px: tuple[int, int], labelled: Sequence[Labelled], tolerance_px: float = 0.0
) -> bytes:
    """The labelme file of a picture ``image_name`` of ``size_px`` (width, height).

    One polygon for each part of an instance, along the edges of its pixels; the parts of one share a ``group_id``.
    ``tolerance_px``: the outline may leave them by so much, so that it has few points to move.
    """
    shapes: list[dict[str, Any]] = []
    for number, (instance, note) in enumerate(labelled, 1):
        parts = outlines(instance.mask, instance.offset_px)
        for points in parts:
            shape = {
                "label": instance.landmark_class,
                "points": _simpler(points, tolerance_px).tolist(),
                "group_id": number if len(parts) > 1 else None,
                "description": note,
                "shape_type": "polygon",
                "flags": {},
            }
            shapes.append(shape)
    document: dict[str, Any] = {
        "version": VERSION,
        "flags": {},
        "shapes": shapes,
        "imagePath": image_name,
        "imageData": None,
        "imageHeight": size_px[1],
        "imageWidth": size_px[0],
    }
    return (json.dumps(document, indent=1) + "\n").encode()


def _simpler(points: Points, tolerance_px: float) -> Points:
    """Douglas and Peucker's thinning, unless it leaves no polygon."""
    if tolerance_px <= 0:
        return points
    thinned = cv2.approxPolyDP(points.astype(np.float32)[:, None], tolerance_px, closed=True)[:, 0]
    return thinned.astype(np.float64) if len(thinned) >= 3 else points
