"""``scpf train segmenter``: all formats mixed, painted scenes, and what it refuses."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from scpf.ingest.labelme_out import Labelled, labelme_json
from scpf.models import polenet
from scpf.models.instances import instance_from_mask
from scpf.replay.cli import run
from scpf.replay.segmenter_data import PaintedScenes, gather, painted_images
from scpf.sample_logs.scene_files import write_scenes
from scpf.sample_logs.street_scenes import scene

pytestmark = pytest.mark.usefixtures("one_thread")


def test_the_command_trains_on_all_formats_mixed(
    tiny_scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    labelled = tmp_path / "lamps"
    labelled.mkdir()
    for seed in range(5):
        image, ids = scene(10 + seed, (160, 128))
        cv2.imwrite(str(labelled / f"{seed}.jpg"), image)
        poles = [Labelled(instance_from_mask(ids == i)) for i in np.unique(ids) if 0 < i < 255]
        (labelled / f"{seed}.json").write_bytes(labelme_json(f"{seed}.jpg", (160, 128), poles))
    output = tmp_path / "w.safetensors"
    command = [
        "train",
        "segmenter",
        str(labelled),
        str(tiny_scenes),
        "--steps",
        "1",
        "--learning-rate",
        "0.0005",
        "--pasted",
        "0.5",
        "--device",
        "cpu",
        "-o",
        str(output),
    ]
    assert run([*command, "--held-out", "0.4", "--licence", "CC-BY-4.0", "--format", "json"]) == 0
    out, err = capsys.readouterr()
    assert "3 pictures of lamps, 2 pictures of" in err and "4 held out" in err
    told = json.loads(out)
    _, info = polenet.load(output)
    assert told["figures"] == info.figures
    assert info.licence == "CC-BY-4.0" and "3 pictures of lamps" in info.trained_on
    configuration = json.loads((tmp_path / "w_run" / "configuration.json").read_text())
    assert configuration["steps"] == 1 and configuration["learning_rate"] == 0.0005
    assert configuration["pasted"] == 0.5
    assert len(configuration["pictures"]["held_out"]) == 4
    assert (tmp_path / "w_run" / "validation.csv").is_file()

    assert run(command) == 1  # the weights are there already
    assert run([*command, "--resume", "--seed", "3"]) == 1
    assert "begun with" in capsys.readouterr().err


def test_what_cannot_be_trained_on_is_said(
    tiny_scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = ["-o", str(tmp_path / "w.safetensors")]
    assert run(["train", "segmenter", *output]) == 2
    assert run(["train", "segmenter", str(tiny_scenes)]) == 2
    assert run(["train", "segmenter", str(tiny_scenes), *output, "--learning-rate", "0"]) == 2
    assert run(["train", "segmenter", str(tiny_scenes), *output, "--held-out", "1.5"]) == 2
    assert run(["train", "segmenter", str(tiny_scenes), *output, "--pasted", "1.5"]) == 2
    assert run(["train", "segmenter", str(tiny_scenes), *output, "--small-crops", "1"]) == 2
    assert run(["train", "segmenter", str(tiny_scenes), *output, "--keep-start", "0.5"]) == 2
    assert "without --start" in capsys.readouterr().err
    assert run(["train", "segmenter", str(tiny_scenes), *output, "--validate", str(tiny_scenes)]) == 2
    assert "to judge by" in capsys.readouterr().err
    assert run(["train", "segmenter", str(tmp_path / "none"), *output]) == 1
    assert "no such folder" in capsys.readouterr().err


def test_pictures_to_judge_by_take_the_place_of_held_out_scenes(tiny_scenes: Path, tmp_path: Path) -> None:
    painted = PaintedScenes(1, 0, tmp_path / "painted")
    alone = gather([], [], ["light_pole"], 0.2, 0, painted, lambda line: None)
    assert [len(images) for images in alone.training] == [1] and len(alone.held_out) == 8
    more = PaintedScenes(1, 0, tmp_path / "more")
    judged = gather([], [tiny_scenes], ["light_pole"], 0.2, 0, more, lambda line: None)
    assert [len(images) for images in judged.training] == [1]
    assert {image.path.parent for image in judged.held_out} == {tiny_scenes}
    assert not (tmp_path / "more" / "held_out").exists()


def test_half_of_what_is_trained_on_are_painted_scenes(tiny_scenes: Path, tmp_path: Path) -> None:
    painted = PaintedScenes(2, 1, tmp_path)
    sets = [tmp_path / "a", tmp_path / "b"]
    for each in sets:
        shutil.copytree(tiny_scenes, each)
    gathered = gather(sets, [tiny_scenes], ["light_pole"], 0.2, 0, painted, lambda line: None)
    assert [len(images) for images in gathered.training] == [4, 4, 2, 2]
    assert gathered.training[2] is gathered.training[3]
    assert len(gathered.names["trained"]) == 10
    assert [image.path.name for image in gathered.weighing] == ["toy_2000000.jpg"]
    assert [path.name for path in sorted((tmp_path / "weighed").glob("*.jpg"))] == ["toy_2000000.jpg"]


def test_scenes_of_an_earlier_training_are_not_trained_on(tmp_path: Path) -> None:
    painted = PaintedScenes(1, 1, tmp_path)
    write_scenes(tmp_path / "train", range(3))
    write_scenes(tmp_path / "weighed", range(5, 6))
    gathered = gather([], [], ["light_pole"], 0.2, 0, painted, lambda line: None)
    assert [image.path.name for image in gathered.training[0]] == ["toy_000000.jpg"]
    assert [image.path.name for image in gathered.weighing] == ["toy_2000000.jpg"]


def test_validate_takes_several_folders(
    tiny_scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The second was once taken for one more to train on, and the score calibrated on what the network had learnt."""
    judges = [tmp_path / "one", tmp_path / "another"]
    for k, folder in enumerate(judges):
        write_scenes(folder, range(20 + 3 * k, 23 + 3 * k))
    command = ["train", "segmenter", str(tiny_scenes), "--validate", *map(str, judges), "--steps", "1"]
    assert run([*command, "--device", "cpu", "-o", str(tmp_path / "w.safetensors")]) == 0
    assert "; 6 held out" in capsys.readouterr().err


def test_only_scenes_that_are_not_there_are_painted_again(tmp_path: Path) -> None:
    told: list[str] = []
    painted_images(PaintedScenes(2, 0, tmp_path), "train", range(2), told.append)
    folder = tmp_path / "train"
    (folder / "toy_000000.png").unlink()
    before = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    found = painted_images(PaintedScenes(3, 0, tmp_path, keep=True), "train", range(3), told.append)
    after = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    assert [image.path.name for image in found] == [f"toy_00000{seed}.jpg" for seed in range(3)]
    assert sorted(after) == [f"toy_00000{seed}.{kind}" for seed in range(3) for kind in ("jpg", "png")]
    assert {name for name in before if after[name] == before[name]} == {"toy_000001.jpg", "toy_000001.png"}
    assert told == [f"painting 2 scenes into {folder}", f"painting 2 scenes into {folder}, 1 are there"]
