"""labelme's JSON, one file a picture: polygons, rectangles, circles and masks (https://github.com/wkentaro/labelme).

Points are x, y with (0, 0) at the corner of the first pixel. Shapes of one label and one ``group_id`` are one instance.
"""

from __future__ import annotations

import base64
import binascii
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from scpf.ingest.label_json import entries, number, read_json, text
from scpf.models.errors import InputError, MissingError
from scpf.models.instances import BoolMask, Instance, instance_from_mask
from scpf.models.labelled_images import LabelledObject, Picture, read_image
from scpf.models.polygons import MOST_POINTS, fill

IGNORED_LABELS = ("__ignore__", "ignore", "ignored")
"""What may be found or not; the first is labelme's own word."""

LARGEST_FILE_BYTES = 256 * 2**20  # with its picture inside
_CIRCLE_POINTS = 64
_NOTE = re.compile(r"(?P<distance>\d{1,6}(?:\.\d{1,6})?) m, (?P<visible>\d{1,3}) % visible")


class _Part(NamedTuple):
    """A shape: a polygon's points (N, 2), or a mask with its upper left pixel (x, y); ``where`` names it."""

    where: str
    label: str
    group: object
    note: str
    points: NDArray[np.float64] | None
    mask: BoolMask | None
    offset_px: tuple[int, int]


@dataclass(frozen=True)
class LabelmeImage:
    """A labelme file whose shapes are known to be sound; the picture itself is read later."""

    path: Path
    json: Path
    parts: tuple[_Part, ...]
    size_px: tuple[int, int] | None
    embedded: bool
    labels: frozenset[str]
    """All labels of the file, wanted or not."""

    def read(self) -> Picture:
        """See `LabelledImage.read`."""
        content = None
        if self.embedded:
            content = _decoded(
                read_json(self.json, LARGEST_FILE_BYTES).get("imageData"), f"{self.json}: imageData"
            )
        image = read_image(self.path, content, upright=True)  # labelme turns a picture before it is labelled
        height, width = image.shape[:2]
        if self.size_px not in (None, (width, height)):
            raise InputError(f"{self.json}: is of {self.size_px}, its picture of ({width}, {height}) pixels")
        groups: dict[object, list[_Part]] = {}
        for part in self.parts:
            key = (part.label, part.where if part.group is None else (part.group,))
            groups.setdefault(key, []).append(part)
        found = [_object(parts, width, height) for parts in groups.values()]
        return Picture(image, [each for each in found if each is not None])


def read_labelme(path: Path, document: Mapping[str, Any], classes: Collection[str]) -> LabelmeImage:
    """The shapes of ``classes`` (and ignored ones) in a labelme ``document``, the content of ``path``.

    Other labels are background.

    Raises InputError that names file and shape where a wanted shape is broken or of a kind that has no area, and
    MissingError where the file has no picture.
    """
    parts, labels = [], set()
    for index, shape in enumerate(entries(document, "shapes", str(path))):
        where = f"{path}: shape {index}"
        label = text(shape, "label", where)
        labels.add(label)
        if label in classes or label in IGNORED_LABELS:
            parts.append(_part(shape, label, f"{where} ({label})"))
    height, width = document.get("imageHeight"), document.get("imageWidth")
    size = None
    if height is not None and width is not None:
        size = (int(number(width, f"{path}: imageWidth")), int(number(height, f"{path}: imageHeight")))
    picture = _picture(path, document)
    embedded = picture is None
    if picture is None:
        if not isinstance(document.get("imageData"), str):
            name = str(document.get("imagePath"))
            raise MissingError(
                f"{path}: its picture {name!r} is not there, nor inside it", "copy it beside the file"
            )
        picture = path
    return LabelmeImage(picture, path, tuple(parts), size, embedded, frozenset(labels))


def _picture(path: Path, document: Mapping[str, Any]) -> Path | None:
    """The picture beside the file, or where the file says; never outside of the folder above its own."""
    name = document.get("imagePath")
    if not isinstance(name, str) or not name or "\0" in name:
        return None
    told = path.parent / name.replace("\\", "/")
    root = path.parent.resolve().parent
    for candidate in (told, path.parent / told.name):
        if candidate.is_file() and candidate.resolve().is_relative_to(root):
            return candidate
    return None


def _part(shape: Mapping[str, Any], label: str, where: str) -> _Part:
    kind = shape.get("shape_type", "polygon") or "polygon"
    points = _points(shape.get("points"), where)
    mask, corner = None, (0, 0)
    if kind == "rectangle":
        if len(points) not in (2, 4):
            raise InputError(f"{where}: a rectangle has two corners, not {len(points)}")
        (x1, y1), (x2, y2) = points.min(0), points.max(0)
        points = np.array([[x1, y1], [x2, y1], [x2, y2], [x1, y2]])
    elif kind == "circle":
        if len(points) != 2:
            raise InputError(f"{where}: a circle has a centre and a point on it, not {len(points)} points")
        angle = np.linspace(0, 2 * np.pi, _CIRCLE_POINTS, endpoint=False)
        radius = float(np.hypot(*(points[1] - points[0])))
        points = points[0] + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    elif kind == "mask":
        mask, corner = _mask(shape, points, where)
    elif kind != "polygon":
        raise InputError(f"{where}: shape_type {kind!r} has no area", "outline it as a polygon")
    elif len(points) < 3:
        raise InputError(f"{where}: a polygon of {len(points)} points")
    group = shape.get("group_id")
    if group is not None and not isinstance(group, int | str):
        raise InputError(f"{where}: group_id {group!r} is neither a number nor a text")
    note = shape.get("description")
    return _Part(where, label, group, note if isinstance(note, str) else "", None if kind == "mask" else points,
                 mask, corner)  # fmt: skip


def _points(values: object, where: str) -> NDArray[np.float64]:
    if not isinstance(values, list) or not values:
        raise InputError(f"{where}: no points")
    if len(values) > MOST_POINTS:
        raise InputError(f"{where}: {len(values)} points, {MOST_POINTS} are the most")
    found = []
    for k, pair in enumerate(values):
        if not isinstance(pair, list) or len(pair) != 2:
            raise InputError(f"{where}: point {k} is not a pair of numbers")
        found.append([number(value, f"{where}: point {k}") for value in pair])
    return np.array(found, dtype=np.float64)


def _mask(
    shape: Mapping[str, Any], points: NDArray[np.float64], where: str
) -> tuple[BoolMask, tuple[int, int]]:
    """A mask shape is a PNG of the box between two corner pixels, both within it."""
    if len(points) != 2:
        raise InputError(f"{where}: a mask has two corners, not {len(points)}")
    content = np.frombuffer(_decoded(shape.get("mask"), f"{where}: mask"), np.uint8)
    try:
        pixels = cv2.imdecode(content, cv2.IMREAD_UNCHANGED) if len(content) else None
    except cv2.error as error:
        raise InputError(f"{where}: the mask cannot be decoded ({error.err})") from error
    if pixels is None or pixels.ndim != 2:
        raise InputError(f"{where}: the mask is not a PNG of one channel")
    (x1, y1), (x2, y2) = np.round(points).astype(np.int64).tolist()
    if pixels.shape != (y2 - y1 + 1, x2 - x1 + 1) or x1 < 0 or y1 < 0:
        high, wide = pixels.shape
        raise InputError(
            f"{where}: a mask of {wide}×{high} pixels between the corners ({x1}, {y1}) and ({x2}, {y2})"
        )
    return np.asarray(pixels > 0, dtype=np.bool_), (x1, y1)


def _decoded(value: object, where: str) -> bytes:
    if not isinstance(value, str):
        raise InputError(f"{where}: nothing there")
    try:
        return base64.b64decode(value, validate=True)
    except (binascii.Error, ValueError) as error:
        raise InputError(f"{where}: not base64 ({error})") from error


def _object(parts: list[_Part], width_px: int, height_px: int) -> LabelledObject | None:
    """The instance of its parts; None where nothing of it lies within the picture."""
    pieces = []
    for part in parts:
        if part.mask is not None:
            (x, y), mask = part.offset_px, part.mask
            if x + mask.shape[1] > width_px or y + mask.shape[0] > height_px:
                raise InputError(
                    f"{part.where}: the mask leaves the picture of {width_px}×{height_px} pixels"
                )
        else:
            assert part.points is not None
            mask, (x, y) = fill(part.points, width_px, height_px)
        if mask.any():
            pieces.append((mask, x, y))
    if not pieces:
        return None
    left, top = min(x for _, x, _ in pieces), min(y for _, _, y in pieces)
    right, bottom = max(x + m.shape[1] for m, x, _ in pieces), max(y + m.shape[0] for m, _, y in pieces)
    whole = np.zeros((bottom - top, right - left), dtype=np.bool_)
    for mask, x, y in pieces:
        whole[y - top : y - top + mask.shape[0], x - left : x - left + mask.shape[1]] |= mask
    instance = instance_from_mask(whole)
    x, y = instance.offset_px[0] + left, instance.offset_px[1] + top
    high, wide = instance.mask.shape
    edges = (float(x), float(y), float(x + wide), float(y + high))
    label = parts[0].label
    note = _NOTE.search(parts[0].note)
    return LabelledObject(
        Instance(edges, instance.mask, (x, y), 1.0, label),
        ignored=label in IGNORED_LABELS,
        distance_m=float(note["distance"]) if note else None,
        visible_fraction=min(1.0, float(note["visible"]) / 100) if note else None,
    )
