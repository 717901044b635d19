"""Which labelled pole a detection shows: found where the mask lies on it, outlined where the two overlap by half.

Both are told apart because a mask one pixel too wide on either side of a pole of two pixels finds it and outlines it
badly. COCO's rule alone (intersection over union of a half) would call it a pole missed and a false one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from scpf.models.instances import BoolMask, Instance
from scpf.models.labelled_images import LabelledObject

LEAST_OVERLAP = 0.5  # intersection over union of the masks: outlined
LEAST_ON_POLE = 0.6  # share of the detection's pixels on the pole, when that is widened a little: found,
LEAST_HEIGHT_OVERLAP = 0.5  # where their heights overlap so much, too (intersection over union)
LEAST_ON_IGNORED = 0.5  # share of the pixels on what is not judged: neither right nor wrong
WIDENING_SHARE = 1 / 512  # of the picture's long side: 2 px of 1024, 4 px of 2048


class Match(NamedTuple):
    """A detection, the index of the object that it shows (None: none), the masks' overlap, and whether it counts.

    ``counts``: False where it shows what need not be found, so that it is neither right nor wrong.
    """

    detection: Instance
    shows: int | None
    overlap: float
    counts: bool

    @property
    def outlined(self) -> bool:
        """Whether it finds the object with a mask that overlaps by half."""
        return self.shows is not None and self.overlap >= LEAST_OVERLAP


def match(
    detections: Sequence[Instance],
    objects: Sequence[LabelledObject],
    judged: Sequence[bool],
    widening_px: int,
) -> list[Match]:
    """The detections, best score first, each with the free object that it shows.

    ``judged`` (of each object): whether it has to be found.
    """
    wide = [_widened(labelled.instance, widening_px) for labelled in objects]
    free = set(range(len(objects)))
    found = []
    for detection in sorted(detections, key=lambda each: -each.score):
        size = max(1, int(detection.mask.sum()))
        overlaps = [_overlap(detection, labelled.instance) for labelled in objects]
        on_wide = [shared_px(detection, each) / size for each in wide]
        fitting = [
            k
            for k in free
            if overlaps[k] >= LEAST_OVERLAP
            or (on_wide[k] >= LEAST_ON_POLE and _same_height(detection, objects[k].instance))
        ]
        if fitting:
            best = max(fitting, key=lambda k: (overlaps[k], on_wide[k]))
            free.remove(best)
            found.append(Match(detection, best, overlaps[best], judged[best]))
            continue
        beside = any(on_wide[k] >= LEAST_ON_IGNORED for k in range(len(objects)) if not judged[k])
        found.append(Match(detection, None, max(overlaps, default=0.0), not beside))
    return found


def shared_px(a: Instance, b: Instance) -> int:
    """The number of pixels that two instances share."""
    left, top = max(a.offset_px[0], b.offset_px[0]), max(a.offset_px[1], b.offset_px[1])
    right = min(a.offset_px[0] + a.mask.shape[1], b.offset_px[0] + b.mask.shape[1])
    bottom = min(a.offset_px[1] + a.mask.shape[0], b.offset_px[1] + b.mask.shape[0])
    if right <= left or bottom <= top:
        return 0
    return int((_part(a, left, top, right, bottom) & _part(b, left, top, right, bottom)).sum())


def _part(instance: Instance, left: int, top: int, right: int, bottom: int) -> BoolMask:
    x, y = instance.offset_px
    return instance.mask[top - y : bottom - y, left - x : right - x]


def _overlap(a: Instance, b: Instance) -> float:
    shared = shared_px(a, b)
    return shared / max(1, int(a.mask.sum()) + int(b.mask.sum()) - shared)


def _widened(instance: Instance, by_px: int) -> Instance:
    """The instance, wider on either side; it may leave the picture."""
    padded = np.pad(instance.mask.astype(np.uint8), ((0, 0), (by_px, by_px)))
    mask = cv2.dilate(padded, np.ones((1, 2 * by_px + 1), np.uint8)) > 0
    x1, y1, x2, y2 = instance.box_px
    box = (x1 - by_px, y1, x2 + by_px, y2)
    return Instance(box, mask, (instance.offset_px[0] - by_px, instance.offset_px[1]), instance.score)


def _same_height(a: Instance, b: Instance) -> bool:
    shared = min(a.box_px[3], b.box_px[3]) - max(a.box_px[1], b.box_px[1])
    either = max(a.box_px[3], b.box_px[3]) - min(a.box_px[1], b.box_px[1])
    return shared >= LEAST_HEIGHT_OVERLAP * either
