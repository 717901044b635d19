"""labelme and COCO files: read to the masks they mean, written and read back, refused with file and shape."""

from __future__ import annotations

import base64
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scpf.ingest.coco_masks import unpack_runs
from scpf.ingest.labelled_folders import labelled_images
from scpf.ingest.labelme_out import Labelled, labelme_json
from scpf.models.errors import InputError, MissingError, ScpfError
from scpf.models.instances import BoolMask, encode_runs, instance_from_mask
from scpf.models.labelled_images import IGNORED_ID, LabelledObject, Picture, objects_of_ids, split

WIDTH, HEIGHT = 40, 60


def whole(labelled: LabelledObject, width: int = WIDTH, height: int = HEIGHT) -> BoolMask:
    (x, y), mask = labelled.instance.offset_px, labelled.instance.mask
    full = np.zeros((height, width), dtype=bool)
    full[y : y + mask.shape[0], x : x + mask.shape[1]] = mask
    assert labelled.instance.box_px == (x, y, x + mask.shape[1], y + mask.shape[0])
    return full


def png(mask: np.ndarray) -> str:
    return base64.b64encode(cv2.imencode(".png", mask)[1].tobytes()).decode()


def shape(kind: str, points: list[list[float]], **more: Any) -> dict[str, Any]:
    return {
        "label": "light_pole",
        "shape_type": kind,
        "points": points,
        "group_id": None,
        "flags": {},
        **more,
    }


def labelme(shapes: list[dict[str, Any]]) -> dict[str, Any]:
    return {"version": "5.5.0", "flags": {}, "shapes": shapes, "imagePath": "a.jpg", "imageData": None,
            "imageHeight": HEIGHT, "imageWidth": WIDTH}  # fmt: skip


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


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    image = np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "a.jpg"), image)
    return tmp_path


Read = Callable[[dict[str, Any]], list[LabelledObject]]


@pytest.fixture
def read(folder: Path) -> Read:
    def of(document: dict[str, Any]) -> list[LabelledObject]:
        (folder / "a.json").write_text(json.dumps(document))
        return labelled_images(folder)[0].read().objects

    return of


def box(x1: int, y1: int, x2: int, y2: int) -> BoolMask:
    full = np.zeros((HEIGHT, WIDTH), dtype=bool)
    full[y1:y2, x1:x2] = True
    return full


def test_labelme_shapes_are_what_they_cover(read: Read) -> None:
    mask = np.zeros((20, 3), np.uint8)
    mask[:, 1] = 255
    objects = read(
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


def test_a_labelme_file_may_hold_its_picture_and_name_it_as_windows_does(folder: Path, read: Read) -> None:
    document = labelme([shape("rectangle", [[1, 1], [4, 40]])])
    assert len(read({**document, "imagePath": "..\\pictures\\a.jpg"})) == 1
    content = (folder / "a.jpg").read_bytes()
    (folder / "a.jpg").unlink()
    with pytest.raises(MissingError, match=r"a\.json: its picture 'a\.jpg'"):
        read(document)
    assert len(read({**document, "imageData": base64.b64encode(content).decode()})) == 1


def test_coco_masks_are_the_same_in_all_forms(read: Read) -> None:
    truth = box(8, 10, 12, 50) | box(10, 5, 20, 12)
    runs = encode_runs(truth)
    polygons = [[8, 10, 12, 10, 12, 50, 8, 50], [10.0, 5, 20, 5, 20, 12, 10, 12]]
    size = [HEIGHT, WIDTH]
    document = coco([polygons, {"size": size, "counts": runs.tolist()}, {"size": size, "counts": pack(runs)}])
    document["annotations"][1].update(iscrowd=1, distance_m=17, visible_fraction=0.4)
    objects = read(document)
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
def test_a_broken_shape_is_named(broken: dict[str, Any], reason: str, read: Read) -> None:
    with pytest.raises(InputError) as caught:
        read(labelme([shape("rectangle", [[1, 1], [2, 9]]), broken]))
    assert "a.json: shape 1 (light_pole)" in caught.value.message
    assert reason in caught.value.message


def test_a_mask_that_leaves_the_picture_is_named(read: Read) -> None:
    mask = png(np.ones((3, 3), np.uint8))
    with pytest.raises(InputError, match=r"shape 0 \(light_pole\): the mask leaves"):
        read(labelme([shape("mask", [[38, 1], [40, 3]], mask=mask)]))


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
def test_a_broken_annotation_is_named(broken: Any, reason: str, read: Read) -> None:
    with pytest.raises(InputError) as caught:
        read(coco([[[1, 1, 2, 1, 2, 9]], broken]))
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
def test_a_broken_entry_is_named(part: str, key: str, value: Any, reason: str, read: Read) -> None:
    document = coco([[[1, 1, 2, 1, 2, 9]]])
    document[part][0][key] = value
    with pytest.raises(ScpfError, match=reason):
        read(document)


@pytest.mark.parametrize(
    "content", ["", "[1]", "[" * 100_000, "{", '{"shapes": 3}', '{"shapes": [3]}', "\xff"]
)
def test_files_that_are_no_labels_are_refused(content: str, folder: Path) -> None:
    (folder / "a.json").write_text(content, encoding="latin-1")
    with pytest.raises(InputError, match=r"a\.json"):
        labelled_images(folder)


def test_another_class_is_asked_for_by_name(folder: Path, read: Read) -> None:
    with pytest.raises(InputError, match="nothing is labelled light_pole") as caught:
        read(labelme([shape("rectangle", [[1, 1], [4, 40]], label="lamp")]))
    assert "lamp" in caught.value.hint
    assert labelled_images(folder, ("lamp",))[0].read().objects[0].instance.landmark_class == "lamp"
    assert read(labelme([])) == []  # a street without lamps teaches, too


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


def test_a_split_is_drawn_by_its_seed(folder: Path) -> None:
    cv2.imwrite(str(folder / "a.png"), np.zeros((HEIGHT, WIDTH), np.uint8))
    images = labelled_images(folder) * 250
    parts = [split(images, 0.2, seed) for seed in (3, 3, 4)]
    assert [len(part) for part in parts[0]] == [200, 50]
    numbered = list(range(250))
    drawn = [split(numbered, 0.2, seed)[1] for seed in (3, 3, 4)]  # type: ignore[arg-type]
    assert drawn[0] == drawn[1] != drawn[2]
    with pytest.raises(InputError, match="cannot be divided"):
        split(images[:2], 0.2, 0)
