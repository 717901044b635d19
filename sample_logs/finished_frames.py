"""A finished frame, picture and truth, and the two files that hold it until its drive or training set is whole."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from scpf.models.instances import Image, Instance, decode_runs, encode_runs, instance_from_mask
from scpf.models.whole_files import write_whole

LEAST_PIXELS = 12
"""Fewer pixels than this show no pole that anyone could label."""


@dataclass(frozen=True)
class SeenPole:
    """A pole in a picture: its mask with its id, its horizontal distance from the body's origin, what shows of it.

    ``visible_fraction``: share of the pole's pixels within the picture that nothing hides, 0 to 1.
    """

    instance: Instance
    distance_m: float
    visible_fraction: float


@dataclass(frozen=True)
class FinishedFrame:
    """An encoded picture with its poles, the nearest first; ``facts`` is what a training set says of it."""

    jpeg: bytes
    width_px: int
    height_px: int
    poles: tuple[SeenPole, ...]
    facts: Mapping[str, Any] = field(default_factory=dict)


def encode_jpeg(image: Image, quality: int) -> bytes:
    """The JPEG of an image (H, W, 3), RGB."""
    done, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise RuntimeError("the picture could not be encoded")
    return data.tobytes()


def seen_poles(
    instance_ids: NDArray[np.integer[Any]],
    ids: Mapping[int, str],
    visible_fraction: Mapping[int, float],
    distance_m: Mapping[int, float],
) -> tuple[SeenPole, ...]:
    """The poles of an id image (H, W), the nearest first; numbers that ``ids`` lacks are other things."""
    found = []
    numbers, counts = np.unique(instance_ids, return_counts=True)
    for number, count in zip(numbers.tolist(), counts.tolist(), strict=True):
        if number in ids and count >= LEAST_PIXELS:
            instance = instance_from_mask(instance_ids == number, landmark_id=ids[number])
            found.append(SeenPole(instance, distance_m[number], visible_fraction[number]))
    return tuple(sorted(found, key=lambda pole: (pole.distance_m, pole.instance.landmark_id)))


def save_frame(folder: Path, index: int, frame: FinishedFrame) -> None:
    """Write ``NNNNNN.jpg``, then ``NNNNNN.json``; each appears whole or not at all, the second says "finished"."""
    poles = [
        {
            "id": pole.instance.landmark_id,
            "offset_px": list(pole.instance.offset_px),
            "size_px": list(pole.instance.mask.shape[::-1]),
            "runs": encode_runs(pole.instance.mask).tolist(),
            "distance_m": pole.distance_m,
            "visible_fraction": pole.visible_fraction,
        }
        for pole in frame.poles
    ]
    document = {
        "size_px": [frame.width_px, frame.height_px],
        "crc32": zlib.crc32(frame.jpeg),
        "poles": poles,
        "facts": dict(frame.facts),
    }
    write_whole(folder / f"{index:06d}.jpg", frame.jpeg)
    write_whole(folder / f"{index:06d}.json", json.dumps(document).encode())


def load_frame(folder: Path, index: int) -> FinishedFrame | None:
    """The frame of ``index``; None where it is not there, or its files are not what was written."""
    try:
        jpeg = (folder / f"{index:06d}.jpg").read_bytes()
        document = json.loads((folder / f"{index:06d}.json").read_bytes())
        if zlib.crc32(jpeg) != document["crc32"]:
            return None
        poles = tuple(_pole(row) for row in document["poles"])
        width, height = document["size_px"]
        return FinishedFrame(jpeg, width, height, poles, document["facts"])
    except (FileNotFoundError, ValueError, KeyError, TypeError):
        return None


def _pole(row: Mapping[str, Any]) -> SeenPole:
    (x, y), (width, height) = row["offset_px"], row["size_px"]
    mask = decode_runs(row["runs"], height, width)
    box = (float(x), float(y), float(x + width), float(y + height))
    return SeenPole(
        Instance(box, mask, (x, y), 1.0, landmark_id=row["id"]), row["distance_m"], row["visible_fraction"]
    )


def full_masks(frame: FinishedFrame) -> Sequence[NDArray[np.bool_]]:
    """The masks of a frame's poles at the picture's size, each (H, W)."""
    masks = []
    for pole in frame.poles:
        x, y = pole.instance.offset_px
        rows, columns = pole.instance.mask.shape
        mask = np.zeros((frame.height_px, frame.width_px), dtype=bool)
        mask[y : y + rows, x : x + columns] = pole.instance.mask
        masks.append(mask)
    return masks
