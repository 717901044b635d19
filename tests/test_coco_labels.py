"""COCO files: read to the masks they mean in all forms, refused with file and annotation."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from label_files import HEIGHT, WIDTH, Read, box, whole

from scpf.ingest.coco_masks import unpack_runs
from scpf.ingest.labelled_folders import labelled_images
from scpf.models.errors import InputError, ScpfError
from scpf.models.instances import encode_runs
from scpf.models.labelled_images import Picture


def coco(segmentations: list[Any]) -> dict[str, Any]:
    annotations = [
        {"id": k, "image_id": 7, "category_id": 3, "segmentation": value, "iscrowd": 0}
        for k, value in enumerate(segmentations)
    ]
    return {
        "images": [{"id": 7, "file_name": "a.jpg", "width": WIDTH, "height": HEIGHT}],
        "annotations": annotations,
        "categories": [{"id": 3, "name": "light_pole"}, {"id": 4, "name": "tree"}],
    }


def test_coco_masks_are_the_same_in_all_forms(read_labels: Read) -> None:
    truth = box(8, 10, 12, 50) | box(10, 5, 20, 12)
    runs = encode_runs(truth)
    polygons = [[8, 10, 12, 10, 12, 50, 8, 50], [10.0, 5, 20, 5, 20, 12, 10, 12]]
    size = [HEIGHT, WIDTH]
    document = coco([polygons, {"size": size, "counts": runs.tolist()}, {"size": size, "counts": pack(runs)}])
    document["annotations"][1].update(iscrowd=1, distance_m=17, visible_fraction=0.4)
    objects = read_labels(document)
    assert len(objects) == 3
    for labelled in objects:
        assert np.array_equal(whole(labelled), truth)
    assert [labelled.ignored for labelled in objects] == [False, True, False]
    assert (objects[1].distance_m, objects[1].visible_fraction) == (17, 0.4)


def pack(runs: Any) -> str:
    """pycocotools' rleToString, number by number."""
    letters = []
    counts = [int(value) for value in runs]
    for k, count in enumerate(counts):
        value = count - counts[k - 2] if k > 2 else count
        more = True
        while more:
            group, value = value & 31, value >> 5
            more = value != (-1 if group & 16 else 0)
            letters.append(chr(48 + group + 32 * more))
    return "".join(letters)


@given(st.lists(st.integers(0, 2**28), min_size=1, max_size=40))
def test_packed_runs_come_back(runs: list[int]) -> None:
    assert unpack_runs(pack(runs), "").tolist() == runs


@given(st.text(alphabet=[chr(c) for c in range(40, 120)], max_size=20))
def test_any_text_is_unpacked_or_refused(packed: str) -> None:
    try:
        unpack_runs(packed, "here")
    except InputError as error:
        assert error.message.startswith("here")


BROKEN_ANNOTATIONS = [
    (None, "neither polygons nor run lengths"),
    ([[1, 1, 2, 2]], "polygon 0: not x, y"),
    ([[1, 1, 2, 2, 3, 3], [1, 1, 2, 2, 3, "x"]], "polygon 1: not a number"),
    ({"size": [9, 9], "counts": [81]}, "run lengths of size"),
    ({"size": [HEIGHT, WIDTH], "counts": [5, 5]}, "do not add up"),
    ({"size": [HEIGHT, WIDTH], "counts": [-1, 2401]}, "a run length"),
    ({"size": [HEIGHT, WIDTH], "counts": {}}, "no run lengths"),
    ({"size": [HEIGHT, WIDTH], "counts": "zz"}, "a letter"),
    ({"size": [HEIGHT, WIDTH], "counts": "o"}, "end within"),
    ({"size": [HEIGHT, WIDTH], "counts": "oooooooooo0"}, "too large"),
]


@pytest.mark.parametrize(("broken", "reason"), BROKEN_ANNOTATIONS, ids=[why for _, why in BROKEN_ANNOTATIONS])
def test_a_broken_annotation_is_named(broken: Any, reason: str, read_labels: Read) -> None:
    with pytest.raises(InputError) as caught:
        read_labels(coco([[[1, 1, 2, 1, 2, 9]], broken]))
    assert "a.json: annotation 1 (id 1)" in caught.value.message
    assert reason in caught.value.message


@pytest.mark.parametrize(
    ("part", "key", "value", "reason"),
    [
        ("images", "file_name", "../../etc/passwd", "no picture"),
        ("images", "width", 10**9, "a size of"),
        ("images", "width", 41, "says 41×60"),
        ("annotations", "image_id", 8, "no image has the id 8"),
        ("annotations", "category_id", 8, "no category has the id 8"),
        ("categories", "name", 8, "name is not a text"),
    ],
)
def test_a_broken_entry_is_named(part: str, key: str, value: Any, reason: str, read_labels: Read) -> None:
    document = coco([[[1, 1, 2, 1, 2, 9]]])
    document[part][0][key] = value
    with pytest.raises(ScpfError, match=reason):
        read_labels(document)


def test_the_real_coco_file_holds_the_same_masks_as_the_labelme_files(
    shared_data: Path, tmp_path: Path
) -> None:
    source = shared_data / "labelme"
    shutil.copytree(source / "data_annotated", tmp_path / "JPEGImages")
    (tmp_path / "annotations.json").write_bytes(
        (source / "data_dataset_coco" / "annotations.json").read_bytes()
    )
    classes = ("person", "bus", "car")
    ours = {image.path.name: image.read() for image in labelled_images(source / "data_annotated", classes)}
    theirs = {image.path.name: image.read() for image in labelled_images(tmp_path, classes)}
    assert theirs.keys() == ours.keys()
    for name, picture in theirs.items():
        for a, b in zip(sorted_boxes(picture), sorted_boxes(ours[name]), strict=True):
            assert a == pytest.approx(b, abs=1)


def sorted_boxes(picture: Picture) -> list[tuple[float, ...]]:
    return sorted(labelled.instance.box_px for labelled in picture.objects if not labelled.ignored)
