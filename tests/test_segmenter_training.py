"""Training on tiny pictures: the run folder, going on after an interruption, stopping early, the score."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from scpf.models import polenet, polenet_training
from scpf.models.errors import DamagedError, InputError, MissingError
from scpf.models.labelled_images import LabelledImage, ids_images
from scpf.models.polenet_inference import for_inference
from scpf.models.polenet_samples import Sample, make_sample
from scpf.models.polenet_training import train
from scpf.models.polenet_validation import average_precision, judge
from scpf.models.training_settings import BEST, FINAL, LAST, STATE, TrainingSettings
from scpf.models.training_state import TrainingState
from scpf.replay.training_run import TrainingRun

ABOUT = polenet.WeightsInfo("four scenes")
TINY = TrainingSettings(steps=4, batch=2, sizes_px=((96, 64),), validate_every=2, report_every=1)

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture(scope="module")
def images(tiny_scenes: Path) -> list[LabelledImage]:
    return [*ids_images(tiny_scenes)]


def weights(folder: Path) -> dict[str, torch.Tensor]:
    return polenet.load(folder / LAST)[0].state_dict()


def test_training_leaves_the_best_weights_and_says_what_they_are(
    images: list[LabelledImage], tmp_path: Path
) -> None:
    lines: list[str] = []
    told: list[tuple[str, int, Mapping[str, float]]] = []
    info = train(
        [images], images, tmp_path, TINY, 0, ABOUT, report=lines.append, curves=lambda *row: told.append(row)
    )
    assert polenet.load(tmp_path / FINAL)[1] == info
    assert info.trained_on == "four scenes" and "mask_ap50" in info.figures
    assert [step for kind, step, _ in told if kind == "validation"] == [2, 4]
    assert [step for kind, step, _ in told if kind == "loss"] == [1, 2, 3, 4]
    assert all(np.isfinite(value) for _, _, values in told for value in values.values())
    assert "mask_ap50" in lines[-1]


def test_the_first_steps_see_small_crops(
    images: list[LabelledImage], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[tuple[int, int]] = []

    def noted(source: LabelledImage, size_px: tuple[int, int], *given: Any) -> Sample:
        seen.append(size_px)
        return make_sample(source, size_px, *given)

    monkeypatch.setattr(polenet_training, "make_sample", noted)
    settings = replace(TINY, batch=1, sizes_px=((160, 96),), small_crops=0.5)
    train([images], images, tmp_path, settings, 0, ABOUT)
    assert seen[:4] == [(96, 64), (96, 64), (160, 96), (160, 96)]
    assert set(TrainingSettings(steps=10, small_crops=0.3).crop_sizes_px(2)) == {
        (384, 288),
        (448, 224),
        (288, 448),
    }


def test_without_early_stopping_the_last_weights_are_kept(tmp_path: Path) -> None:
    assert TINY.kept == LAST
    assert replace(TINY, patience=3).kept == BEST


def test_the_start_keeps_its_share_of_the_weights(images: list[LabelledImage], tmp_path: Path) -> None:
    torch.manual_seed(5)
    start = tmp_path / "start.safetensors"
    (tmp_path / "run").mkdir()
    polenet.save(start, polenet.PoleNet(), ABOUT)
    settings = replace(TINY, start=start, keep_start=0.25, learning_rate=0.03, warm_up_steps=1)
    info = train([images], images, tmp_path / "run", settings, 0, ABOUT)
    kept, last, final = (
        polenet.load(path)[0].state_dict() for path in (start, *(tmp_path / "run" / n for n in (LAST, FINAL)))
    )
    assert not torch.allclose(kept["mask.weight"], last["mask.weight"], atol=1e-3)
    for name, value in final.items():
        if value.is_floating_point():
            assert torch.allclose(
                value, 0.25 * kept[name] + 0.75 * last[name], atol=2e-3, rtol=2e-3
            )  # half floats
    net = for_inference(polenet.load(tmp_path / "run" / FINAL)[0])
    fitted = judge(net, images).fit_calibration(np.s_[0::2])
    assert info.calibration.weights == pytest.approx(fitted.weights, abs=0.05)
    # Going on where nothing is left to do mixes no second time.
    train([images], images, tmp_path / "run", settings, 0, ABOUT, resume=True)
    again = polenet.load(tmp_path / "run" / FINAL)[0].state_dict()
    assert all(torch.equal(again[name], value) for name, value in final.items())


def test_the_evidence_is_weighed_on_other_pictures(images: list[LabelledImage], tmp_path: Path) -> None:
    lines: list[str] = []
    info = train([images], images, tmp_path, TINY, 0, ABOUT, report=lines.append, weighing=images[:2])
    assert f"judging by {len(images)} pictures and 2 to weigh on" in lines
    net = for_inference(polenet.load(tmp_path / LAST)[0])
    weighed = judge(net, images[:2]).fit_calibration()
    expected = judge(net, images).fit_scale(weighed, np.s_[0::2])
    assert info.calibration.weights == pytest.approx(expected.weights)


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
        polenet_training, "judged_weights",
        lambda net, held_out, about, part, weighing=(): polenet.WeightsInfo("", figures={"mask_ap50": next(seen)}),
    )  # fmt: skip
    lines: list[str] = []
    settings = TrainingSettings(steps=50, batch=1, sizes_px=((64, 64),), validate_every=1, patience=2)
    train([images], images, tmp_path, settings, 0, ABOUT, report=lines.append)
    assert any("no better mask_ap50 since step 2" in line for line in lines)
    assert "step 2 is the best" in lines
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
