"""Shapes painted into a picture together with the ids of the poles that they hide."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from scpf.models.instances import Image
from scpf.models.labelled_images import Ids

SUBPIXEL_BITS = 4  # OpenCV takes polygon corners as fixed-point numbers
FURTHEST_PX = 8000  # corners beyond would overflow them

FIRST_ANGLES = {3: np.pi / 2, 4: np.pi / 4, 8: np.pi / 8}


def fill_polygon(
    image: Image,
    ids: Ids,
    corners_px: NDArray[np.floating[Any]] | Sequence[NDArray[np.floating[Any]]],
    colour: Sequence[float],
) -> None:
    """Fills a polygon in ``image`` (H, W, 3) and takes the poles behind it out of ``ids`` (H, W), in place.

    ``corners_px`` (N, 2): (0, 0) is the corner of the first pixel.
    """
    corners = np.clip(np.asarray(corners_px, dtype=np.float64), -FURTHEST_PX, FURTHEST_PX)
    fixed = np.round((corners - 0.5) * (1 << SUBPIXEL_BITS)).astype(np.int32)
    cv2.fillPoly(image, [fixed], colour, cv2.LINE_AA, SUBPIXEL_BITS)
    cv2.fillPoly(ids, [fixed], 0, cv2.LINE_8, SUBPIXEL_BITS)


def plate_outline(corners: int, turn: float = 0.0) -> NDArray[np.float64]:
    """Corners (N, 2) of a sign's plate, 1 from its middle: a triangle, square or octagon with level edges, or a disc.

    ``turn``: radians, by which it is turned.
    """
    angles = FIRST_ANGLES.get(corners, 0.0) + turn + np.arange(corners) * 2 * np.pi / corners
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)
