"""Training on tiny pictures: the run folder, going on after an interruption, stopping early, and the command."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch
from painted_scenes import write_painted_scenes

from scpf.ingest.labelme_out import Labelled, labelme_json
from scpf.models import polenet, polenet_training
from scpf.models.errors import DamagedError, InputError, MissingError
from scpf.models.instances import instance_from_mask
from scpf.models.labelled_images import LabelledImage, ids_images
from scpf.models.polenet_training import BEST, LAST, STATE, TrainingSettings, train
from scpf.models.polenet_validation import average_precision
from scpf.models.training_state import TrainingState
from scpf.replay.cli import run
from scpf.replay.segmenter_data import gather
from scpf.replay.training_run import TrainingRun
from scpf.sample_logs.street_scenes import scene, write_scenes

ABOUT = polenet.WeightsInfo("four scenes")
TINY = TrainingSettings(steps=4, batch=2, sizes_px=((96, 64),), validate_every=2, report_every=1)


@pytest.fixture(autouse=True)
def one_thread() -> None:
    """Threads that wait for each other take seconds for such small pictures where the machine is busy."""
    torch.set_num_threads(1)


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_painted_scenes(tmp_path_factory.mktemp("scenes"), (160, 128))


@pytest.fixture(scope="module")
def images(scenes: Path) -> list[LabelledImage]:
    return [*ids_images(scenes)]


def weights(folder: Path) -> dict[str, torch.Tensor]:
    return polenet.load(folder / BEST)[0].state_dict()


def test_training_leaves_the_best_weights_and_says_what_they_are(
    images: list[LabelledImage], tmp_path: Path
) -> None:
    lines: list[str] = []
    told: list[tuple[str, int, Mapping[str, float]]] = []
    info = train(
        [images], images, tmp_path, TINY, 0, ABOUT, report=lines.append, curves=lambda *row: told.append(row)
    )
    assert polenet.load(tmp_path / BEST)[1] == info
    assert info.trained_on == "four scenes" and "mask_ap50" in info.figures
    assert [step for kind, step, _ in told if kind == "validation"] == [2, 4]
    assert [step for kind, step, _ in told if kind == "loss"] == [1, 2, 3, 4]
    assert all(np.isfinite(value) for _, _, values in told for value in values.values())
    assert "is the best" in lines[-1]


def test_an_interrupted_training_goes_on_to_the_same_weights(
    images: list[LabelledImage], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("whole", "parts"):
        (tmp_path / name).mkdir()
    train([images], images, tmp_path / "whole", TINY, 0, ABOUT)

    plain, taken = polenet_training.training_step, []

    def interrupted(*arguments: Any) -> dict[str, float]:
        taken.append(None)
        if len(taken) == 4:
            raise KeyboardInterrupt
        return plain(*arguments)

    monkeypatch.setattr(polenet_training, "training_step", interrupted)
    with pytest.raises(KeyboardInterrupt):
        train([images], images, tmp_path / "parts", TINY, 0, ABOUT)
    lines: list[str] = []
    train([images], images, tmp_path / "parts", TINY, 0, ABOUT, resume=True, report=lines.append)
    assert lines[0] == "going on from step 3"
    for name, value in weights(tmp_path / "whole").items():
        assert torch.equal(value, weights(tmp_path / "parts")[name]), name


def test_what_is_kept_is_the_running_mean_of_the_weights(
    images: list[LabelledImage], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[torch.Tensor] = []
    plain = polenet_training.training_step

    def watched(state: TrainingState, *arguments: Any) -> dict[str, float]:
        if not seen:
            seen.append(state.net.mask.weight.detach().clone())
        losses = plain(state, *arguments)
        seen.append(state.net.mask.weight.detach().clone())
        return losses

    monkeypatch.setattr(polenet_training, "training_step", watched)
    fast = replace(TINY, validate_every=4, learning_rate=0.03, warm_up_steps=1)
    train([images], images, tmp_path, fast, 0, ABOUT)
    mean = seen[0]
    for step, each in enumerate(seen[1:], start=1):
        mean = mean + (each - mean) * 9 / (10 + step)
    kept = weights(tmp_path)["mask.weight"]
    assert torch.allclose(kept, mean, atol=1e-3)  # half floats
    assert not torch.allclose(kept, seen[-1], atol=2e-3)


def test_a_damaged_state_is_refused_and_code_in_it_not_run(
    images: list[LabelledImage], tmp_path: Path
) -> None:
    with pytest.raises(MissingError, match="no state"):
        train([images], images, tmp_path, TINY, 0, ABOUT, resume=True)
    torch.save({"net": Path("x")}, tmp_path / STATE)
    with pytest.raises(DamagedError, match="not the state"):
        train([images], images, tmp_path, TINY, 0, ABOUT, resume=True)
    (tmp_path / STATE).write_bytes(b"PK\x03\x04")
    with pytest.raises(DamagedError, match="not the state"):
        train([images], images, tmp_path, TINY, 0, ABOUT, resume=True)


def test_training_stops_where_nothing_gets_better(
    images: list[LabelledImage], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = iter([0.5, 0.6, 0.55, 0.6, 0.9])
    monkeypatch.setattr(
        polenet_training, "_judged",
        lambda net, held_out, about, part: polenet.WeightsInfo("", figures={"mask_ap50": next(seen)}),
    )  # fmt: skip
    lines: list[str] = []
    settings = TrainingSettings(steps=50, batch=1, sizes_px=((64, 64),), validate_every=1, patience=2)
    train([images], images, tmp_path, settings, 0, ABOUT, report=lines.append)
    assert any("no better mask_ap50 since step 2" in line for line in lines)
    assert "step 2 is the best" in lines[-1]
    best, last = (polenet.load(tmp_path / name)[0].state_dict() for name in (BEST, LAST))
    assert any(not torch.equal(best[name], last[name]) for name in best)
    state = torch.load(tmp_path / STATE, weights_only=True)
    assert all(
        torch.equal(last[k], v.half().float()) for k, v in state["mean"].items() if v.is_floating_point()
    )


@pytest.mark.parametrize(
    ("scores", "right", "wanted", "expected"),
    [
        ([0.9, 0.8], [True, True], 2, 1.0),
        ([0.9, 0.8], [True, True], 4, 51 / 101),
        ([0.9, 0.8, 0.7], [True, False, True], 2, (51 + 50 * 2 / 3) / 101),
        ([0.5], [False], 1, 0.0),
        ([], [], 1, 0.0),
    ],
)
def test_average_precision_is_cocos(
    scores: list[float], right: list[bool], wanted: int, expected: float
) -> None:
    found = average_precision(np.array(scores), np.array(right, dtype=bool), wanted)
    assert found == pytest.approx(expected)


def test_a_run_folder_keeps_its_curves_and_goes_on_as_it_began(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    begun = {"seed": 1, "device": "cuda", "classes": ("lamp",)}
    first = TrainingRun(folder, begun, resume=False, overwrite=False, files=(BEST,))
    for step in (10, 20, 30):
        first.curves("loss", step, {"dice": 0.5})
    first.close()
    (folder / BEST).write_text("weights")
    with pytest.raises(InputError, match="holds a training"):
        TrainingRun(folder, begun, resume=False, overwrite=False, files=(BEST,))
    with pytest.raises(InputError, match="begun with seed 1"):
        TrainingRun(folder, {**begun, "seed": 2}, resume=True, overwrite=False, files=(BEST,))
    again = TrainingRun(folder, {**begun, "device": "cpu"}, resume=True, overwrite=False, files=(BEST,))
    again.curves("loss", 20, {"dice": 0.25, "focal": 1.0})
    again.close()
    with (folder / "loss.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert rows == [
        {"step": "10", "dice": "0.5", "focal": ""},
        {"step": "20", "dice": "0.25", "focal": "1"},
    ]
    TrainingRun(folder, begun, resume=False, overwrite=True, files=(BEST,)).close()
    assert not (folder / "loss.csv").exists() and not (folder / BEST).exists()
    with pytest.raises(MissingError, match="no training to go on"):
        TrainingRun(tmp_path / "none", begun, resume=True, overwrite=False, files=())


def test_the_curves_reach_tensorboard(tmp_path: Path) -> None:
    pytest.importorskip("tensorboardX", reason="needs scpf[train]")
    opened = TrainingRun(tmp_path, {}, resume=False, overwrite=False, files=())
    opened.curves("validation", 300, {"mask_ap50": 0.5})
    opened.close()
    (events,) = tmp_path.glob("events.out.tfevents.*")
    assert b"validation/mask_ap50" in events.read_bytes()


def test_the_command_trains_on_all_formats_mixed(
    scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
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
        str(scenes),
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
    scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = ["-o", str(tmp_path / "w.safetensors")]
    assert run(["train", "segmenter", *output]) == 2
    assert run(["train", "segmenter", str(scenes)]) == 2
    assert run(["train", "segmenter", str(scenes), *output, "--learning-rate", "0"]) == 2
    assert run(["train", "segmenter", str(scenes), *output, "--held-out", "1.5"]) == 2
    assert run(["train", "segmenter", str(scenes), *output, "--pasted", "1.5"]) == 2
    assert run(["train", "segmenter", str(scenes), *output, "--validate", str(scenes)]) == 2
    assert "to judge by" in capsys.readouterr().err
    assert run(["train", "segmenter", str(tmp_path / "none"), *output]) == 1
    assert "no such folder" in capsys.readouterr().err


def test_pictures_to_judge_by_take_the_place_of_held_out_scenes(scenes: Path, tmp_path: Path) -> None:
    painted = (1, tmp_path / "painted")
    alone = gather([], [], ["light_pole"], 0.2, 0, painted, lambda line: None)
    assert [len(images) for images in alone.training] == [1] and len(alone.held_out) == 8
    judged = gather([], [scenes], ["light_pole"], 0.2, 0, (1, tmp_path / "more"), lambda line: None)
    assert [len(images) for images in judged.training] == [1]
    assert {image.path.parent for image in judged.held_out} == {scenes}
    assert not (tmp_path / "more" / "held_out").exists()


def test_validate_takes_several_folders(
    scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The second was once taken for one more to train on, and the score calibrated on what the network had learnt."""
    judges = [tmp_path / "one", tmp_path / "another"]
    for k, folder in enumerate(judges):
        write_scenes(folder, range(20 + 3 * k, 23 + 3 * k))
    command = ["train", "segmenter", str(scenes), "--validate", *map(str, judges), "--steps", "1"]
    assert run([*command, "--device", "cpu", "-o", str(tmp_path / "w.safetensors")]) == 0
    assert "; 6 held out" in capsys.readouterr().err
