"""Plates of the road signs along the simulated road, as reflectance images."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

SPEED_LIMIT, STOP, NO_PARKING, CROSSING, ENTRANCE, RING_ROAD, PARKING = range(7)
SIGN_SIZE = 128
_BLACK, _WHITE, _RED = (10, 10, 10), (247, 247, 247), (200, 20, 20)
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_BRIGHTEST = 0.8
"""Reflectance of a white plate."""

Image = NDArray[Any]


def sign_plates() -> NDArray[np.float32]:
    """The seven plates (7, 128, 128, 4): red, green, blue and an unused channel; rows from the top."""
    drawings: list[tuple[tuple[int, int, int], Callable[[Image], None]]] = [
        ((240, 240, 240), _speed_limit),
        ((190, 15, 20), _stop),
        ((240, 240, 240), _no_parking),
        ((250, 190, 10), _crossing),
        ((20, 60, 140), _entrance),
        ((250, 200, 20), _ring_road),
        ((20, 110, 60), _parking),
    ]
    plates = np.zeros((len(drawings), SIGN_SIZE, SIGN_SIZE, 4), np.float32)
    for plate, (background, draw) in zip(plates, drawings, strict=True):
        image = np.full((256, 256, 3), background, np.uint8)
        draw(image)
        small = cv2.resize(image, (SIGN_SIZE, SIGN_SIZE), interpolation=cv2.INTER_AREA) / 255.0
        plate[..., :3] = small**2.2 * _BRIGHTEST
    return plates


def _text(image: Image, words: str, place: tuple[int, int], size: float, colour: Any, width: int) -> None:
    cv2.putText(image, words, place, _FONT, size, colour, width)


def _speed_limit(image: Image) -> None:
    cv2.rectangle(image, (8, 8), (247, 247), _BLACK, 6)
    _text(image, "MAXIMUM", (38, 70), 1.1, _BLACK, 4)
    _text(image, "40", (48, 200), 4, _BLACK, 16)


def _stop(image: Image) -> None:
    _text(image, "STOP", (22, 155), 2.6, _WHITE, 14)


def _no_parking(image: Image) -> None:
    cv2.circle(image, (128, 110), 80, _RED, 16)
    _text(image, "P", (88, 160), 4, _BLACK, 14)
    cv2.line(image, (75, 52), (182, 168), _RED, 16)


def _crossing(image: Image) -> None:
    cv2.circle(image, (128, 70), 18, _BLACK, -1)
    cv2.line(image, (128, 90), (128, 150), _BLACK, 18)
    for foot in ((100, 205), (160, 205)):
        cv2.line(image, (128, 150), foot, _BLACK, 14)


def _entrance(image: Image) -> None:
    _text(image, "E5", (60, 120), 3, _WHITE, 10)
    _text(image, "ENTRANCE", (30, 190), 1.2, _WHITE, 4)


def _ring_road(image: Image) -> None:
    cv2.rectangle(image, (0, 150), (255, 255), (20, 20, 20), -1)
    _text(image, "RING", (40, 110), 2.4, (20, 20, 20), 9)


def _parking(image: Image) -> None:
    _text(image, "P", (70, 190), 6, _WHITE, 22)
