"""``scpf simulate --labels``: pictures of random places with labels that the trainer reads, the same every time."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from scpf.ingest.labelled_folders import labelled_images
from scpf.models.labelled_images import Picture
from scpf.replay.cli import run
from scpf.sample_logs.drawn_camera import drawn_camera
from scpf.sample_logs.pole_looks import RING_ROAD_LOOK, drawn_look
from scpf.sample_logs.simulation import frames_folder
from scpf.sample_logs.training_places import PICTURES_AT_A_PLACE, SetSettings
from scpf.sample_logs.training_set import simulate_set

SETTINGS = SetSettings(PICTURES_AT_A_PLACE + 2, seed=5, width_px=160)


class Teller:
    """Takes reports, and interrupts the run where so many frames are done."""

    def __init__(self, stop_after: int = -1) -> None:
        self.stop_after = stop_after

    def say(self, line: str) -> None:
        assert "compiling" in line or "there already" in line

    def frame(self, done: int, resumed: int, count: int) -> None:
        if done == self.stop_after:
            raise KeyboardInterrupt


@pytest.fixture(scope="module")
def coco(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The set as one COCO file, from the command."""
    folder = tmp_path_factory.mktemp("sets") / "coco"
    options = ["--count", str(SETTINGS.count), "--seed", "5", "--width", "160", "--workers", "1", "-q"]
    assert run(["simulate", "--labels", "coco", "-o", str(folder), *options]) == 0
    return folder


@pytest.fixture(scope="module")
def pictures(coco: Path) -> list[Picture]:
    return [image.read() for image in labelled_images(coco)]


def test_two_places_differ_in_camera_and_a_pole_is_judged_where_it_is_thick_enough(
    coco: Path, pictures: list[Picture]
) -> None:
    images = json.loads((coco / "instances.json").read_text())["images"]
    assert len(images) == len(pictures) == SETTINGS.count
    assert [image["place"] for image in images] == [0] * PICTURES_AT_A_PLACE + [1, 1]
    assert len({(image["focal_px"], image["camera_height_m"]) for image in images}) == 2
    objects = [labelled for picture in pictures for labelled in picture.objects]
    judged = [labelled for labelled in objects if not labelled.ignored]
    assert len(objects) > 2 * SETTINGS.count and len(judged) > 5 and len(judged) < len(objects)
    for labelled in judged:
        assert labelled.instance.mask.sum() >= 1.5 * labelled.instance.height_px
        assert labelled.visible_fraction is not None and labelled.visible_fraction >= 0.25
    nearest_m = min(labelled.distance_m or 0.0 for labelled in judged)
    assert 3.0 < nearest_m < 60.0


def test_the_picture_shows_a_pole_where_the_label_says(pictures: list[Picture]) -> None:
    apart = []
    for picture in pictures:
        for labelled in picture.objects:
            (x, y), mask = labelled.instance.offset_px, labelled.instance.mask
            if labelled.ignored or labelled.instance.height_px < 30:
                continue
            whole = np.zeros(picture.image.shape[:2], bool)
            whole[y : y + mask.shape[0], x : x + mask.shape[1]] = mask
            around = cv2.dilate(whole.astype(np.uint8), np.ones((1, 9), np.uint8)).astype(bool) & ~whole
            image = picture.image.astype(float).mean(axis=2)
            apart.append(abs(image[whole].mean() - image[around].mean()))
    assert len(apart) >= 5 and np.median(apart) > 10.0


def test_workers_interruptions_and_the_form_of_labels_change_no_picture(
    coco: Path, pictures: list[Picture], tmp_path: Path
) -> None:
    folder = tmp_path / "ids"
    with pytest.raises(KeyboardInterrupt):
        simulate_set(folder, SETTINGS, "ids", Teller(3))
    assert not folder.exists() and len(list(frames_folder(folder).glob("*.jpg"))) == 3
    report = simulate_set(folder, SETTINGS, "ids", Teller(), workers=2)
    assert (report.pictures, report.rendered) == (SETTINGS.count, SETTINGS.count - 3)
    assert sum(report.weathers.values()) == SETTINGS.count and not frames_folder(folder).exists()
    for number, (image, known) in enumerate(zip(labelled_images(folder), pictures, strict=True)):
        name = f"{number:06d}.jpg"
        assert (folder / name).read_bytes() == (coco / "images" / name).read_bytes()
        np.testing.assert_array_equal(image.read().ids() > 0, known.ids() > 0)
        np.testing.assert_array_equal(image.read().ids() == 255, known.ids() == 255)


@pytest.mark.parametrize(
    ("options", "code", "said"),
    [
        (["--labels", "coco"], 2, "--count"),
        (["--count", "3"], 2, "--labels"),
        (["--labels", "coco", "--count", "0"], 2, "0 pictures"),
        (["--labels", "coco", "--count", "3", "--duration", "5"], 2, "--duration"),
        (["--labels", "coco", "--count", "3", "--width", "1001"], 2, "1001"),
        (["--labels", "coco", "--count", "3", "--seed", "-1"], 2, "seed"),
        (["--labels", "coco", "--count", "3", "-o", "none/set"], 1, "no folder"),
    ],
)
def test_what_makes_no_set_is_refused_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], code: int, said: str
) -> None:
    where = [] if "-o" in options else ["-o", str(tmp_path / "set")]
    assert run(["simulate", *options, *where]) == code
    captured = capsys.readouterr()
    assert captured.out == "" and said in captured.err and captured.err.startswith("scpf: ")
    assert not any(tmp_path.iterdir())


def test_only_a_training_set_is_ever_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "thesis.txt").write_text("years of work")
    command = ["simulate", "--labels", "coco", "--count", "1", "-o", str(tmp_path)]
    assert run(command) == 1
    assert "--overwrite" in capsys.readouterr().err
    assert run([*command, "--overwrite"]) == 1
    assert "no simulated training set" in capsys.readouterr().err
    assert (tmp_path / "thesis.txt").exists()


def test_cameras_and_looks_are_drawn_from_all_that_is_usual() -> None:
    cameras = [drawn_camera(1024, np.random.default_rng(seed)) for seed in range(200)]
    zoom = [camera.matrix[0, 0] / camera.width_px / (1465 / 2048) for camera in cameras]
    assert 0.7 <= min(zoom) < 0.75 and 1.5 < max(zoom) <= 1.6
    assert {camera.width_px for camera in cameras} == {1024, 820, 640}
    assert {round(camera.height_px / camera.width_px, 2) for camera in cameras} == {0.75, 0.62, 0.56}
    looks = [drawn_look(np.random.default_rng(seed)) for seed in range(200)]
    assert 0.2 < np.mean([look == RING_ROAD_LOOK for look in looks]) < 0.5
    heights = [look.lamp_height_m for look in looks]
    assert min(heights) < 6.5 and max(heights) > 10.0
