"""Frames rendered in parallel, resumed, and written as labels that give back the masks."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from scpf.ingest.labelled_folders import labelled_images
from scpf.models.errors import InputError, ScpfError
from scpf.models.instances import decode_runs
from scpf.sample_logs.finished_frames import (
    FinishedFrame,
    encode_jpeg,
    full_masks,
    load_frame,
    save_frame,
    seen_poles,
)
from scpf.sample_logs.labels_out import LabelFormat, write_labels
from scpf.sample_logs.render_jobs import Make, open_folder, render_all

SIZE_PX = (96, 64)


def ids_of(index: int) -> NDArray[np.int16]:
    """Two poles, the second divided in two by an obstacle, and something else."""
    ids = np.zeros(SIZE_PX[::-1], dtype=np.int16)
    ids[5:60, 10 + index : 14 + index] = 1
    ids[20:60, 50:52] = 2
    ids[30:40] = np.where(ids[30:40] == 2, 0, ids[30:40])
    ids[50:64, 70:90] = 1001
    return ids


@dataclass(frozen=True)
class Painter:
    """Stands for the renderer: bars of colour, and one frame that kills its process where wanted."""

    dies_at: int = -1

    def __call__(self) -> Make:
        return self.make

    def make(self, index: int) -> FinishedFrame:
        if index == self.dies_at:
            os._exit(9)
        ids = ids_of(index)
        image = np.random.default_rng(index).integers(0, 255, (*ids.shape, 3), dtype=np.uint8)
        poles = seen_poles(ids, {1: "p1", 2: "p2", 3: "p3"}, {1: 1.0, 2: 0.75}, {1: 9.0, 2: 4.0})
        return FinishedFrame(encode_jpeg(image, 85), *SIZE_PX, poles, {"weather": "rain"})


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_workers_and_interruptions_change_no_byte(tmp_path: Path) -> None:
    for name in ("one", "two"):
        open_folder(tmp_path / name, {"seed": 1}, overwrite=False)
    assert render_all(tmp_path / "one", 5, Painter(), workers=1) == 5
    assert render_all(tmp_path / "two", 5, Painter(), workers=2) == 5
    whole = contents(tmp_path / "one")
    assert len(whole) == 11 and whole == contents(tmp_path / "two")

    for name in ("000001.jpg", "000003.json"):
        (tmp_path / "two" / name).unlink()
    (tmp_path / "two" / "000004.jpg").write_bytes(b"cut short")
    open_folder(tmp_path / "two", {"seed": 1}, overwrite=False)
    seen: list[tuple[int, int, int]] = []
    again = render_all(tmp_path / "two", 5, Painter(), progress=lambda *numbers: seen.append(numbers))
    assert again == 3
    assert seen == [(2, 2, 5), (3, 2, 5), (4, 2, 5), (5, 2, 5)]
    assert contents(tmp_path / "two") == whole


def test_a_worker_that_dies_is_an_error_and_loses_no_finished_frame(tmp_path: Path) -> None:
    open_folder(tmp_path / "frames", {}, overwrite=False)
    with pytest.raises(ScpfError, match="process died"):
        render_all(tmp_path / "frames", 4, Painter(dies_at=3), workers=2)
    assert render_all(tmp_path / "frames", 4, Painter()) < 4


def test_frames_of_other_settings_are_kept_unless_told(tmp_path: Path) -> None:
    folder = tmp_path / "frames"
    open_folder(folder, {"seed": 1}, overwrite=False)
    save_frame(folder, 0, Painter().make(0))
    with pytest.raises(InputError, match="other settings"):
        open_folder(folder, {"seed": 2}, overwrite=False)
    assert load_frame(folder, 0) is not None
    open_folder(folder, {"seed": 2}, overwrite=True)
    assert load_frame(folder, 0) is None

    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work")
    with pytest.raises(InputError, match="no frames of a simulation"):
        open_folder(tmp_path / "mine", {}, overwrite=True)
    assert (tmp_path / "mine" / "thesis.txt").exists()


def test_a_stored_frame_comes_back(tmp_path: Path) -> None:
    frame = Painter().make(2)
    save_frame(tmp_path, 2, frame)
    back = load_frame(tmp_path, 2)
    assert back is not None and back.jpeg == frame.jpeg and back.facts == {"weather": "rain"}
    assert [pole.instance.landmark_id for pole in back.poles] == ["p2", "p1"]  # the nearest first
    assert [(pole.distance_m, pole.visible_fraction) for pole in back.poles] == [(4.0, 0.75), (9.0, 1.0)]
    for mask, number in zip(full_masks(back), (2, 1), strict=True):
        np.testing.assert_array_equal(mask, ids_of(2) == number)


def frames() -> list[tuple[str, FinishedFrame]]:
    return [(f"{index:06d}", Painter().make(index)) for index in range(2)]


@pytest.mark.parametrize("labels", ["labelme", "coco", "ids"])
def test_labels_are_read_back_to_the_masks(labels: LabelFormat, tmp_path: Path) -> None:
    assert write_labels(tmp_path, iter(frames()), labels, {"seed": 0}) == 4
    for index, source in enumerate(labelled_images(tmp_path)):
        picture = source.read()
        assert picture.image.shape == (*SIZE_PX[::-1], 3)
        far, near = sorted(picture.objects, key=lambda labelled: labelled.instance.box_px[0])
        for labelled, number in ((near, 2), (far, 1)):
            (x, y), mask = labelled.instance.offset_px, labelled.instance.mask
            drawn = np.zeros(SIZE_PX[::-1], dtype=bool)
            drawn[y : y + mask.shape[0], x : x + mask.shape[1]] = mask
            np.testing.assert_array_equal(drawn, ids_of(index) == number)
        if labels != "ids":
            assert (near.distance_m, near.visible_fraction) == (4.0, 0.75)


def test_coco_run_lengths_are_the_masks(tmp_path: Path) -> None:
    write_labels(tmp_path, iter(frames()), "coco", {"seed": 0})
    document = json.loads((tmp_path / "instances.json").read_text())
    assert [image["file_name"] for image in document["images"]] == ["000000.jpg", "000001.jpg"]
    assert document["categories"][0]["id"] == 1
    assert [one["id"] for one in document["annotations"]] == [1, 2, 3, 4]
    for annotation in document["annotations"]:
        index = annotation["image_id"] - 1
        picture = cv2.imread(str(tmp_path / "images" / document["images"][index]["file_name"]))
        assert picture is not None and picture.shape[:2] == tuple(annotation["segmentation"]["size"])
        mask = decode_runs(annotation["segmentation"]["counts"], *annotation["segmentation"]["size"])
        number = 2 if annotation["distance_m"] == 4.0 else 1
        np.testing.assert_array_equal(mask, ids_of(index) == number)
        x, y, width, height = (int(value) for value in annotation["bbox"])
        assert mask[y : y + height, x : x + width].sum() == mask.sum() == annotation["area"]


def test_id_images_are_what_the_trainer_reads(tmp_path: Path) -> None:
    write_labels(tmp_path, iter(frames()), "ids", {})
    ids = np.asarray(cv2.imread(str(tmp_path / "000001.png"), cv2.IMREAD_UNCHANGED))
    np.testing.assert_array_equal(ids == 1, ids_of(1) == 2)
    np.testing.assert_array_equal(ids == 2, ids_of(1) == 1)
