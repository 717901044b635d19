"""labelme files: read to the masks they mean, written and read back, refused with file and shape."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from label_files import HEIGHT, WIDTH, Read, box, labelme, png, shape, whole

from scpf.ingest.labelled_folders import labelled_images
from scpf.ingest.labelme_out import Labelled, labelme_json
from scpf.models.errors import InputError, MissingError
from scpf.models.instances import instance_from_mask
from scpf.models.labelled_images import IGNORED_ID, LabelledObject, Picture, objects_of_ids, split


def test_labelme_shapes_are_what_they_cover(read_labels: Read) -> None:
    mask = np.zeros((20, 3), np.uint8)
    mask[:, 1] = 255
    objects = read_labels(
        labelme(
            [
                shape("polygon", [[2, 5], [6, 5], [6, 50], [2, 50]], description="12.50 m, 80 % visible"),
                shape("rectangle", [[14, 50], [10, 5]]),
                shape("mask", [[20, 5], [22, 24]], mask=png(mask)),
                shape("polygon", [[30, 5], [33, 5], [33, 20], [30, 20]], group_id=1),
                shape("rectangle", [[30, 30], [33, 45]], group_id=1),
                shape("polygon", [[0, 0], [1, 0], [1, 1]], label="tree"),
                shape("line", [[0, 0], [9, 9]], label="kerb"),
                shape("rectangle", [[36, 0], [39, 9]], label="__ignore__"),
            ]
        )
    )
    expected = [
        box(2, 5, 6, 50),
        box(10, 5, 14, 50),
        box(21, 5, 22, 25),
        box(30, 5, 33, 20) | box(30, 30, 33, 45),
        box(36, 0, 39, 9),
    ]
    for labelled, truth in zip(objects, expected, strict=True):
        assert np.array_equal(whole(labelled), truth)
    assert (objects[0].distance_m, objects[0].visible_fraction) == (12.5, 0.8)
    assert [labelled.ignored for labelled in objects] == [False] * 4 + [True]


def test_a_labelme_file_may_hold_its_picture_and_name_it_as_windows_does(
    label_folder: Path, read_labels: Read
) -> None:
    document = labelme([shape("rectangle", [[1, 1], [4, 40]])])
    assert len(read_labels({**document, "imagePath": "..\\pictures\\a.jpg"})) == 1
    content = (label_folder / "a.jpg").read_bytes()
    (label_folder / "a.jpg").unlink()
    with pytest.raises(MissingError, match=r"a\.json: its picture 'a\.jpg'"):
        read_labels(document)
    assert len(read_labels({**document, "imageData": base64.b64encode(content).decode()})) == 1


BROKEN_SHAPES = [
    (shape("polygon", [[1, 1], [2, 2]]), "a polygon of 2 points"),
    (shape("polygon", [[1, 1], [2, 2], [3]]), "point 2 is not a pair"),
    (shape("polygon", [[1, 1], [2, 2], [3, None]]), "point 2: not a number"),
    (shape("polygon", [[1, 1], [2, 2], [3, 10**400]]), "point 2: not a finite number"),
    (shape("polygon", [[1, 1], [2, 2], [3, float("nan")]]), "point 2: not a finite number"),
    (shape("polygon", []), "no points"),
    (shape("linestrip", [[1, 1], [2, 2]]), "'linestrip' has no area"),
    (shape("rectangle", [[1, 1]]), "two corners"),
    (shape("circle", [[1, 1]]), "a centre"),
    (shape("mask", [[1, 1], [5, 5]]), "mask: nothing there"),
    (shape("mask", [[1, 1], [5, 5]], mask="!!"), "not base64"),
    (shape("mask", [[1, 1], [5, 5]], mask=base64.b64encode(b"GIF89a").decode()), "not a PNG"),
    (shape("mask", [[1, 1], [5, 5]], mask=png(np.ones((3, 3), np.uint8))), "3×3 pixels between"),
    (shape("polygon", [[1, 1], [2, 2], [3, 1]], group_id=[]), "group_id"),
]


@pytest.mark.parametrize(("broken", "reason"), BROKEN_SHAPES, ids=[reason for _, reason in BROKEN_SHAPES])
def test_a_broken_shape_is_named(broken: dict[str, Any], reason: str, read_labels: Read) -> None:
    with pytest.raises(InputError) as caught:
        read_labels(labelme([shape("rectangle", [[1, 1], [2, 9]]), broken]))
    assert "a.json: shape 1 (light_pole)" in caught.value.message
    assert reason in caught.value.message


def test_a_mask_that_leaves_the_picture_is_named(read_labels: Read) -> None:
    mask = png(np.ones((3, 3), np.uint8))
    with pytest.raises(InputError, match=r"shape 0 \(light_pole\): the mask leaves"):
        read_labels(labelme([shape("mask", [[38, 1], [40, 3]], mask=mask)]))


@pytest.mark.parametrize(
    "content", ["", "[1]", "[" * 100_000, "{", '{"shapes": 3}', '{"shapes": [3]}', "\xff"]
)
def test_files_that_are_no_labels_are_refused(content: str, label_folder: Path) -> None:
    (label_folder / "a.json").write_text(content, encoding="latin-1")
    with pytest.raises(InputError, match=r"a\.json"):
        labelled_images(label_folder)


def test_another_class_is_asked_for_by_name(label_folder: Path, read_labels: Read) -> None:
    with pytest.raises(InputError, match="nothing is labelled light_pole") as caught:
        read_labels(labelme([shape("rectangle", [[1, 1], [4, 40]], label="lamp")]))
    assert "lamp" in caught.value.hint
    assert labelled_images(label_folder, ("lamp",))[0].read().objects[0].instance.landmark_class == "lamp"
    assert read_labels(labelme([])) == []  # a street without lamps teaches, too


def test_the_real_labelme_files_load(shared_data: Path) -> None:
    images = labelled_images(shared_data / "labelme" / "data_annotated", ("person", "bus", "car", "sofa"))
    assert [image.path.name for image in images] == [f"2011_00000{n}.jpg" for n in (3, 6)] + [
        "2011_000025.jpg"
    ]
    pictures = [image.read() for image in images]
    # A person of the first picture is in two pieces, the sofa of the second in four.
    assert [
        [o.instance.landmark_class for o in picture.objects if not o.ignored] for picture in pictures
    ] == [
        ["person"] * 2,
        ["person"] * 4 + ["sofa"],
        ["bus", "bus", "car"],
    ]
    assert sum(o.ignored for picture in pictures for o in picture.objects) == 2


@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1))
def test_masks_written_as_labelme_come_back(seed: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    rng = np.random.default_rng(seed)
    folder = tmp_path_factory.mktemp("labels")
    cv2.imwrite(str(folder / "a.png"), np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    masks = [m for _ in range(3) if (m := cv2.blur(rng.random((HEIGHT, WIDTH)), (5, 9)) > 0.55).any()]
    labelled = [Labelled(instance_from_mask(mask), "3.00 m, 50 % visible") for mask in masks]
    (folder / "a.json").write_bytes(labelme_json("a.png", (WIDTH, HEIGHT), labelled))
    back = labelled_images(folder)[0].read().objects
    for once, mask in zip(back, masks, strict=True):
        assert np.array_equal(whole(once), mask)
    # And once more: the polygons of what was read are the polygons that were read.
    again = labelme_json(
        "a.png", (WIDTH, HEIGHT), [Labelled(o.instance, "3.00 m, 50 % visible") for o in back]
    )
    assert again == (folder / "a.json").read_bytes()


def test_ids_of_objects_come_back_and_overlaps_show_the_smaller() -> None:
    ids = np.zeros((HEIGHT, WIDTH), np.uint8)
    ids[5:50, 4:8], ids[10:40, 20:22], ids[50:, 30:] = 1, 2, IGNORED_ID
    image = np.zeros((*ids.shape, 3), np.uint8)
    assert np.array_equal(Picture(image, objects_of_ids(ids)).ids(), ids)
    large, small = (
        LabelledObject(instance_from_mask(box(*edges))) for edges in ((0, 0, 30, 30), (9, 9, 11, 40))
    )
    drawn = Picture(image, [small, large]).ids()
    assert set(np.unique(drawn[9:40, 9:11])) == {2} and drawn[0, 0] == 1


def test_a_split_is_drawn_by_its_seed(label_folder: Path) -> None:
    cv2.imwrite(str(label_folder / "a.png"), np.zeros((HEIGHT, WIDTH), np.uint8))
    images = labelled_images(label_folder) * 250
    parts = [split(images, 0.2, seed) for seed in (3, 3, 4)]
    assert [len(part) for part in parts[0]] == [200, 50]
    numbered = list(range(250))
    drawn = [split(numbered, 0.2, seed)[1] for seed in (3, 3, 4)]  # type: ignore[arg-type]
    assert drawn[0] == drawn[1] != drawn[2]
    with pytest.raises(InputError, match="cannot be divided"):
        split(images[:2], 0.2, 0)
