"""COCO's JSON of instances (https://cocodataset.org/#format-data, "Object Detection"): one file for many pictures."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from numpy.typing import NDArray

from scpf.ingest.coco_masks import Runs, read_segmentation, to_instance
from scpf.ingest.label_json import entries, number, text, whole
from scpf.models.errors import InputError, MissingError
from scpf.models.labelled_images import LabelledObject, Picture, read_image

LARGEST_FILE_BYTES = 2**30
_LARGEST_SIDE_PX = 2**15


class _Annotation(NamedTuple):
    segmentation: list[NDArray[Any]] | Runs
    category: str
    ignored: bool
    distance_m: float | None
    visible_fraction: float | None


@dataclass(frozen=True)
class CocoImage:
    """A picture of a COCO file with its annotations, which are known to be sound."""

    path: Path
    json: Path
    size_px: tuple[int, int]
    annotations: tuple[_Annotation, ...]

    def read(self) -> Picture:
        """See `LabelledImage.read`."""
        image = read_image(self.path)  # COCO counts the pixels as they are stored
        height, width = image.shape[:2]
        if self.size_px != (width, height):
            raise InputError(
                f"{self.json}: says {self.size_px[0]}×{self.size_px[1]} pixels of {self.path.name}, "
                f"which has {width}×{height}"
            )
        found = []
        for each in self.annotations:
            instance = to_instance(each.segmentation, self.size_px, each.category)
            if instance is not None:
                found.append(LabelledObject(instance, each.ignored, each.distance_m, each.visible_fraction))
        return Picture(image, found)


def read_coco(path: Path, document: Mapping[str, Any], classes: Collection[str]) -> list[CocoImage]:
    """Every picture of a COCO ``document`` (the content of ``path``), with its annotations of ``classes``.

    Crowds are ignored objects: they may be found or not. Raises InputError that names file and annotation where one
    is broken, and MissingError where a picture is not there.
    """
    names = _categories(path, document)
    images: dict[int, tuple[Path, tuple[int, int]]] = {}
    for index, image in enumerate(entries(document, "images", str(path))):
        where = f"{path}: image {index}"
        key = whole(image.get("id"), f"{where}: id")
        if key in images:
            raise InputError(f"{where}: its id {key} is another's, too")
        size = (whole(image.get("width"), f"{where}: width"), whole(image.get("height"), f"{where}: height"))
        if not 0 < min(size) <= max(size) <= _LARGEST_SIDE_PX:
            raise InputError(f"{where}: a size of {size[0]}×{size[1]} pixels")
        images[key] = (_picture(path, text(image, "file_name", where), where), size)
    found: dict[int, list[_Annotation]] = defaultdict(list)
    for index, annotation in enumerate(entries(document, "annotations", str(path))):
        where = f"{path}: annotation {index} (id {annotation.get('id')})"
        category = whole(annotation.get("category_id"), f"{where}: category_id")
        if category not in names:
            raise InputError(f"{where}: no category has the id {category}")
        key = whole(annotation.get("image_id"), f"{where}: image_id")
        if key not in images:
            raise InputError(f"{where}: no image has the id {key}")
        if names[category] in classes:
            found[key].append(_annotation(annotation, names[category], images[key][1], where))
    return [CocoImage(file, path, size, tuple(found[key])) for key, (file, size) in images.items()]


def _categories(path: Path, document: Mapping[str, Any]) -> dict[int, str]:
    names: dict[int, str] = {}
    for index, category in enumerate(entries(document, "categories", str(path))):
        where = f"{path}: category {index}"
        names[whole(category.get("id"), f"{where}: id")] = text(category, "name", where)
    return names


def category_names(path: Path, document: Mapping[str, Any]) -> list[str]:
    """The names of all categories, wanted or not."""
    return list(_categories(path, document).values())


def _annotation(
    annotation: Mapping[str, Any], category: str, size_px: tuple[int, int], where: str
) -> _Annotation:
    distance, visible = annotation.get("distance_m"), annotation.get("visible_fraction")
    return _Annotation(
        read_segmentation(annotation.get("segmentation"), size_px, where),
        category,
        bool(annotation.get("iscrowd", 0)) or bool(annotation.get("ignore", 0)),
        None if distance is None else number(distance, f"{where}: distance_m"),
        None if visible is None else number(visible, f"{where}: visible_fraction"),
    )


def _picture(path: Path, name: str, where: str) -> Path:
    """The picture of a ``file_name``: beside the JSON, in ``images``, or above, in COCO's own layout."""
    split = path.stem.removeprefix("instances_")
    above = path.parent.parent
    root = above.resolve()
    plain = name.replace("\\", "/")
    folders = (
        path.parent,
        path.parent / "images",
        above,
        above / "images",
        above / split,
        above / "images" / split,
    )
    for candidate in (folder / plain for folder in folders):
        if "\0" not in plain and candidate.is_file() and candidate.resolve().is_relative_to(root):
            return candidate
    raise MissingError(
        f"{where}: no picture {name!r}", f"it is looked for beside {path.name}, and in images/"
    )
