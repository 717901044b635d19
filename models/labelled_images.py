"""Labelled pictures, whatever format they came from: the one contract that training and evaluation read.

Formats are read by `scpf.ingest.labelled_folders`; this module holds what they become, and the simplest of them, a
picture beside an image of instance ids.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from scpf.models.errors import DamagedError, InputError, MissingError
from scpf.models.instances import Image, Instance

IGNORED_ID = 255  # lamps that are neither wanted nor to be called background
MOST_IDS = 254

Ids = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class LabelledObject:
    """One labelled instance of a picture.

    ``ignored``: it may be found or not, and is not background either. ``distance_m`` (horizontal, from the body) and
    ``visible_fraction`` (0 to 1) are None where the labels do not say.
    """

    instance: Instance
    ignored: bool = False
    distance_m: float | None = None
    visible_fraction: float | None = None


class Picture(NamedTuple):
    """``image`` (H, W, 3) uint8 RGB, and what is labelled in it."""

    image: Image
    objects: list[LabelledObject]

    def ids(self) -> Ids:
        """Ids (H, W): 0 background, 1 to 254 one instance each, 255 ignored; an instance more is ignored, too.

        Of two that overlap, the smaller one is in front.
        """
        ids = np.zeros(self.image.shape[:2], np.uint8)
        by_size = sorted(self.objects, key=lambda labelled: -int(labelled.instance.mask.sum()))
        by_size.sort(key=lambda labelled: not labelled.ignored)
        number = 0
        for labelled in by_size:
            number += not labelled.ignored
            (x, y), mask = labelled.instance.offset_px, labelled.instance.mask
            ignored = labelled.ignored or number > MOST_IDS
            ids[y : y + mask.shape[0], x : x + mask.shape[1]][mask] = IGNORED_ID if ignored else number
        return ids


class LabelledImage(Protocol):
    """A picture on disk with its labels; ``path`` names it in messages and reports."""

    @property
    def path(self) -> Path: ...

    def read(self) -> Picture:
        """The picture; raises InputError where image or labels turn out damaged."""
        ...


def read_image(path: Path, content: bytes | None = None, *, upright: bool = False) -> Image:
    """The image (H, W, 3) uint8 RGB of a file, or of its ``content``.

    ``upright``: turned as its EXIF tag says; else as it is stored. Raises DamagedError and MissingError.
    """
    if content is None and not path.is_file():
        raise MissingError(f"{path}: no such picture")
    flags = cv2.IMREAD_COLOR | (0 if upright else cv2.IMREAD_IGNORE_ORIENTATION)
    try:
        data = np.frombuffer(path.read_bytes() if content is None else content, np.uint8)
        bgr = cv2.imdecode(data, flags) if len(data) else None
    except cv2.error as error:
        raise DamagedError(f"{path}: the picture cannot be decoded ({error.err})") from error
    if bgr is None:
        raise DamagedError(f"{path}: not a picture that can be decoded")
    return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)


@dataclass(frozen=True)
class IdsImage:
    """A picture beside an 8-bit image of its size: 0 background, 255 ignored, else one number an instance."""

    path: Path
    ids: Path
    landmark_class: str = "light_pole"

    def read(self) -> Picture:
        """See `LabelledImage.read`."""
        image = read_image(self.path)
        ids = cv2.imread(str(self.ids), cv2.IMREAD_UNCHANGED)
        if ids is None or ids.ndim != 2 or ids.dtype != np.uint8:
            raise DamagedError(f"{self.ids}: not an image of one channel of 8 bits")
        if ids.shape != image.shape[:2]:
            raise DamagedError(f"{self.ids}: of another size than {self.path.name}")
        return Picture(image, objects_of_ids(np.asarray(ids, np.uint8), self.landmark_class))


def objects_of_ids(ids: Ids, landmark_class: str = "light_pole") -> list[LabelledObject]:
    """The objects of an id image (H, W) as `Picture.ids` makes it."""
    found = []
    for number, box in enumerate(ndimage.find_objects(ids), start=1):
        if box is None:
            continue
        y, x = box
        mask = np.asarray(ids[box] == number, dtype=np.bool_)
        edges = (float(x.start), float(y.start), float(x.stop), float(y.stop))
        instance = Instance(edges, mask, (x.start, y.start), 1.0, landmark_class)
        found.append(LabelledObject(instance, ignored=number == IGNORED_ID))
    return found


def ids_images(folder: Path) -> list[IdsImage]:
    """All NAME.jpg or NAME.png of a folder that have a NAME.ids.png or (beside a .jpg) a NAME.png."""
    found = []
    for path in sorted(folder.iterdir()) if folder.is_dir() else []:
        if path.suffix not in (".jpg", ".png") or path.name.endswith(".ids.png"):
            continue
        candidates = [path.with_suffix(".ids.png")]
        if path.suffix == ".jpg":
            candidates.append(path.with_suffix(".png"))
        found += [IdsImage(path, ids) for ids in candidates if ids.is_file()][:1]
    if not found:
        raise MissingError(
            f"{folder}: no labelled images", "NAME.jpg beside NAME.ids.png (uint8 instance ids)"
        )
    return found


def split(
    images: Sequence[LabelledImage], held_out: float, seed: int
) -> tuple[list[LabelledImage], list[LabelledImage]]:
    """Pictures to train on and pictures to judge by, the share ``held_out`` of them, drawn by ``seed``.

    The draw depends on seed and number of the pictures alone, both keep their order. Raises InputError where either
    part would be empty.
    """
    count = round(held_out * len(images))
    if not 0 < count < len(images):
        raise InputError(
            f"{len(images)} labelled pictures cannot be divided, {held_out:g} of them held out",
            "label more, or name held-out pictures with --validate",
        )
    chosen = set(np.random.default_rng(seed).permutation(len(images))[:count].tolist())
    rest = [image for k, image in enumerate(images) if k not in chosen]
    return rest, [image for k, image in enumerate(images) if k in chosen]
