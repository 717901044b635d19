"""Labelled pictures of any format: which one a folder or file holds, seen from its contents.

labelme    a folder of JSON files, one a picture
COCO       a JSON file of many pictures, or the folder that holds it
ids        a folder of pictures, each beside an image of instance ids
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

from scpf.ingest import coco, labelme
from scpf.ingest.label_json import read_json
from scpf.models.errors import InputError, MissingError
from scpf.models.labelled_images import LabelledImage, ids_images

DEFAULT_CLASSES = ("light_pole",)


def labelled_images(path: Path, classes: Collection[str] = DEFAULT_CLASSES) -> list[LabelledImage]:
    """All labelled pictures of a folder or a COCO file, with their instances of ``classes``, checked.

    A picture on which none is labelled is one that shows none. Raises InputError, naming file and shape, where labels
    are broken, and where all labels are of other classes; MissingError where there are no labels.
    """
    if path.is_file():
        return _coco(path, read_json(path, coco.LARGEST_FILE_BYTES), classes)
    if not path.is_dir():
        raise MissingError(f"{path}: no such folder of labelled pictures, nor a COCO file")
    found: list[labelme.LabelmeImage] = []
    for candidate in sorted(path.glob("*.json")):
        # COCO files are few and large, a labelme folder holds one small file a picture.
        document = read_json(candidate, coco.LARGEST_FILE_BYTES)
        if "annotations" in document and "images" in document:
            return _coco(candidate, document, classes)
        if "shapes" in document:
            found.append(labelme.read_labelme(candidate, document, classes))
    labels = [label for image in found for label in image.labels]
    if labels and not any(label in classes for label in labels):
        raise _unlabelled(path, classes, labels)
    return [*found] if found else [*ids_images(path)]


def _coco(path: Path, document: dict[str, Any], classes: Collection[str]) -> list[LabelledImage]:
    names = coco.category_names(path, document)
    if not any(name in classes for name in names):
        raise _unlabelled(path, classes, names)
    return [*coco.read_coco(path, document, classes)]


def _unlabelled(path: Path, classes: Collection[str], there: Sequence[str]) -> InputError:
    common = ", ".join(name for name, _ in Counter(there).most_common(8))
    return InputError(
        f"{path}: nothing is labelled {', '.join(classes)}", f"its labels are: {common}; choose with --class"
    )
