"""What is drawn over the camera picture: colours of the landmarks, masks, outlines, labels."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.instances import BoolMask, Instance
from scpf.models.road_map import RoadMap
from scpf.replay.step import Step

Colour = tuple[int, int, int]
Points = NDArray[np.float32]

LANDMARK_COLOURS: Final[tuple[Colour, ...]] = (
    (255, 214, 51),
    (92, 220, 110),
    (255, 122, 200),
    (84, 160, 255),
    (240, 128, 48),
    (200, 165, 255),
    (56, 205, 178),
    (200, 230, 70),
)
"""Taken in the order of the map, so that neighbours differ; class 1 is the first."""

UNMATCHED_CLASS: Final = len(LANDMARK_COLOURS) + 1
UNMATCHED_COLOUR: Final[Colour] = (205, 205, 205)

_PALETTE: Final = bytes(v for colour in ((0, 0, 0), *LANDMARK_COLOURS, UNMATCHED_COLOUR) for v in colour)
_ALPHA: Final = bytes([0] + [255] * UNMATCHED_CLASS)


class LandmarkClasses:
    """The class, and so the colour, of each landmark: one for picture, map and plots."""

    def __init__(self, road_map: RoadMap | None = None) -> None:
        marks = road_map.landmarks if road_map else ()
        self._order = {mark.id: k for k, mark in enumerate(marks)}

    def class_of(self, landmark_id: str) -> int:
        """Class 1 … 8 of a landmark, ``UNMATCHED_CLASS`` of ""; ids not on the map follow in turn."""
        if not landmark_id:
            return UNMATCHED_CLASS
        return self._order.setdefault(landmark_id, len(self._order)) % len(LANDMARK_COLOURS) + 1

    def colour_of(self, landmark_id: str) -> Colour:
        """RGB of a landmark."""
        return (*LANDMARK_COLOURS, UNMATCHED_COLOUR)[self.class_of(landmark_id) - 1]


def labels(step: Step) -> list[str]:
    """A label each observation, then each unmeasured instance.

    ``P17 12.3 ± 0.4 m`` (one standard deviation); the reason instead of the name where it was left out; and the
    true landmark behind it where the match is wrong.
    """
    truths = step.true_landmark_ids or ("",) * len(step.observations)
    texts = []
    for observation, match, truth in zip(step.observations, step.matches, truths, strict=True):
        distance = observation.distance
        value = f"{distance.mean_m:.1f} ± {np.sqrt(distance.variance_m2):.1f} m"
        wrong = f" (truly {truth})" if truth and match.landmark_id and truth != match.landmark_id else ""
        texts.append(f"{match.landmark_id or match.reason or 'no match'} {value}{wrong}")
    return texts + ["no distance"] * len(step.unmeasured)


def worth_reading(step: Step) -> list[bool]:
    """Whether each label, in the order of ``labels``, is shown at once.

    Poles too far off to be measured crowd about the vanishing point, and all of them say so: their labels would
    cover the others.
    """
    pairs = zip(step.observations, step.matches, strict=True)
    shown = [bool(match.landmark_id) or observation.distance.in_range for observation, match in pairs]
    return shown + [False] * len(step.unmeasured)


def mask_picture(
    instances: Sequence[Instance], classes: Sequence[int]
) -> tuple[bytes, tuple[int, int]] | None:
    """A palette PNG of all masks and the pixel (x, y) of its upper left corner; None without a mask.

    The picture spans the masks alone: most of a camera image is empty, and would cost as much as the rest.
    Where masks overlap, the better score lies on top. Class 0 is transparent.
    """
    from PIL import Image as Pictures

    shown = [k for k, instance in enumerate(instances) if instance.mask.size]
    if not shown:
        return None
    corners = np.array([(*instances[k].offset_px, *_end(instances[k])) for k in shown])
    (left, top), (right, bottom) = corners[:, :2].min(axis=0), corners[:, 2:].max(axis=0)
    canvas = np.zeros((bottom - top, right - left), dtype=np.uint8)
    for k in sorted(shown, key=lambda k: instances[k].score):
        (x, y), mask = instances[k].offset_px, instances[k].mask
        h, w = mask.shape
        canvas[y - top : y - top + h, x - left : x - left + w][mask] = classes[k]
    picture = Pictures.fromarray(canvas)
    picture.putpalette(_PALETTE)
    file = io.BytesIO()
    picture.save(file, "PNG", transparency=_ALPHA, compress_level=1)
    return file.getvalue(), (int(left), int(top))


def outlines(mask: BoolMask, offset_px: tuple[int, int]) -> list[Points]:
    """Closed outlines (K, 2) of a mask in pixels of the full image, simplified to one pixel."""
    import cv2

    found, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    strips = []
    for contour in found:
        points = cv2.approxPolyDP(contour, 1.0, True)[:, 0]
        if len(points) > 1:
            # The viewer's pixel (0, 0) spans 0 to 1: a pixel's centre lies half a pixel on.
            strips.append(np.vstack([points, points[:1]]).astype(np.float32) + np.float32(0.5) + offset_px)
    return [strip.astype(np.float32) for strip in strips]


def media_type(image_format: str, encoded: bytes) -> str:
    """The media type of an encoded image: from its first bytes, else from the log's ``image_format``."""
    signatures = {
        b"\xff\xd8\xff": "image/jpeg",
        b"\x89PNG": "image/png",
        b"RIFF": "image/webp",
        b"BM": "image/bmp",
    }
    for signature, kind in signatures.items():
        if encoded.startswith(signature):
            return kind
    named = image_format.lower().replace("jpg", "jpeg")
    return next((f"image/{kind}" for kind in ("png", "webp", "bmp") if kind in named), "image/jpeg")


def _end(instance: Instance) -> tuple[int, int]:
    (x, y), (h, w) = instance.offset_px, instance.mask.shape
    return x + w, y + h
