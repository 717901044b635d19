"""The network, its weights file and its training, all on tiny pictures."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from painted_scenes import write_painted_scenes
from safetensors.torch import save_file

from scpf.models import polenet, polenet_inference
from scpf.models.errors import InputError, MissingError
from scpf.models.grouping import OFFSET_CELL_PX, OFFSET_SCALE_PX, Candidate, ScoreCalibration, logit
from scpf.models.labelled_images import ids_images
from scpf.models.polenet_samples import Sample, make_sample, targets
from scpf.models.polenet_training import begin, training_step
from scpf.models.polenet_validation import JudgedImage, Judgement, Verdict, is_detection, judge, match
from scpf.models.training_settings import TrainingSettings

Prepare = Callable[[polenet.PoleNet], polenet.PoleNet]
CALIBRATION = ScoreCalibration(1.5, 0.5, 0.25, -1.0)

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_painted_scenes(tmp_path_factory.mktemp("scenes"), (320, 256))


@pytest.fixture
def net() -> polenet.PoleNet:
    torch.manual_seed(0)
    net = polenet.PoleNet()
    for name, value in net.state_dict().items():  # batch norms as after a training
        if name.endswith("running_mean"):
            value.normal_(0, 0.1)
        elif name.endswith("running_var"):
            value.uniform_(0.5, 2.0)
    return net.eval()


def test_outputs_have_the_promised_sizes(net: polenet.PoleNet) -> None:
    mask, centre, offsets = net(torch.zeros(2, 3, 64, 96))
    assert mask.shape == (2, 1, 64, 96)
    assert centre.shape == (2, 1, 8, 12)
    assert offsets.shape == (2, 2, 16, 24)


@pytest.mark.parametrize("prepare", [polenet_inference.fold_batch_norm, polenet_inference.for_inference])
def test_making_the_network_fast_changes_nothing(net: polenet.PoleNet, prepare: Prepare) -> None:
    folded = prepare(net)
    assert not any(isinstance(module, torch.nn.BatchNorm2d) for module in folded.modules())
    x = torch.randn(1, 3, 64, 96)
    with torch.inference_mode():
        for plain, fold in zip(net(x), folded(x), strict=True):
            torch.testing.assert_close(fold, plain, atol=1e-4, rtol=1e-4)


def test_weights_come_back(net: polenet.PoleNet, tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    written = polenet.WeightsInfo("nothing", CALIBRATION, figures={"recall": 0.5})
    polenet.save(path, net, written)
    again, info = polenet.load(path)
    assert info == written
    (tmp_path / "any").touch()
    assert path.stat().st_mode == (tmp_path / "any").stat().st_mode
    assert path.stat().st_size < 3_000_000
    for name, value in again.state_dict().items():
        if not name.endswith("num_batches_tracked"):
            assert torch.equal(value, net.state_dict()[name].half().float()), name


def test_weights_with_a_gate_and_those_from_before_there_was_one(
    net: polenet.PoleNet, tmp_path: Path
) -> None:
    path = tmp_path / "w.safetensors"
    gate = tuple(i / 8 for i in range(33))
    polenet.save(path, net, polenet.WeightsInfo("nothing", CALIBRATION, tile_gate=gate))
    assert polenet.load(path)[1].tile_gate == gate
    for damaged in (gate[:-1], (*gate[:-1], float("nan"))):
        polenet.save(path, net, polenet.WeightsInfo("nothing", CALIBRATION, tile_gate=damaged))
        with pytest.raises(InputError, match=r"damaged.*gate"):
            polenet.load(path)
    polenet.save(path, net, polenet.WeightsInfo("nothing", CALIBRATION))
    path.write_bytes(path.read_bytes().replace(b'"format_version":"3"', b'"format_version":"2"'))
    assert polenet.load(path)[1].tile_gate is None


def test_weights_that_are_not_there_are_missing(tmp_path: Path) -> None:
    with pytest.raises(MissingError, match="no such"):
        polenet.load(tmp_path / "w.safetensors")


def test_damaged_foreign_and_newer_weights_are_refused(net: polenet.PoleNet, tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    polenet.save(path, net, polenet.WeightsInfo("nothing", CALIBRATION))
    whole = path.read_bytes()

    def refused(content: bytes) -> str:
        path.write_bytes(content)
        with pytest.raises(InputError) as caught:
            polenet.load(path)
        assert str(path) in caught.value.message
        return caught.value.message

    assert "safetensors" in refused(whole[:1000])
    assert "safetensors" in refused(whole[: len(whole) // 2])
    assert "safetensors" in refused(b"")
    assert "weights format" in refused(whole.replace(b'"format_version":"3"', b'"format_version":"4"'))
    assert "not PoleNet" in refused(whole.replace(b"scpf-polenet", b"xxxx-xxxxxxx"))
    assert "description" in refused(whole.replace(b"mask_logit", b"mask_login"))
    assert "finite" in refused(whole[:-2] + b"\x00\x7e")
    save_file({"a": torch.zeros(2)}, path)
    assert "not PoleNet" in refused(path.read_bytes())
    description = {"format": "scpf-polenet", "format_version": "3", "info": json.dumps({"trained_on": ""})}
    save_file({"a": torch.zeros(2)}, path, description)
    assert "description" in refused(path.read_bytes())


def test_targets_of_one_pole() -> None:
    ids = np.zeros((64, 96), np.uint8)
    ids[8:56, 40:44] = 3
    sample = targets(np.zeros((64, 96, 3), np.uint8), ids, (96, 64))
    assert np.array_equal(sample.cover, ids == 3)
    assert np.argwhere(sample.centre == 1).tolist() == [[4, 5]]
    rows, columns = np.nonzero(sample.offsets_valid)
    for axis, (cells, centre_px) in enumerate(((columns, 42.0), (rows, 32.0))):
        aim = (cells + 0.5) * OFFSET_CELL_PX + sample.offsets[axis, rows, columns] * OFFSET_SCALE_PX[axis]
        assert aim == pytest.approx(centre_px, abs=0.01)


def test_small_and_ignored_poles_are_neither_taught_nor_punished() -> None:
    ids = np.zeros((64, 96), np.uint8)
    ids[20:30, 20:22], ids[8:60, 70:80] = 1, 255
    sample = targets(np.zeros((64, 96, 3), np.uint8), ids, (96, 64))
    assert not (sample.centre == 1).any()
    assert sample.centre_valid[25 // 8, 21 // 8] == 0
    assert not sample.valid[8:60, 70:80].any()
    assert sample.cover[:, 70:80].sum() == 0


def test_a_sample_is_the_same_for_its_seed(scenes: Path) -> None:
    source = ids_images(scenes)[0]
    first, again = (make_sample(source, (160, 128), np.random.default_rng(5)) for _ in range(2))
    for a, b in zip(first, again, strict=True):
        assert np.array_equal(a, b)


def test_a_few_steps_on_one_batch_lower_the_loss(scenes: Path) -> None:
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    batch: list[Sample] = [make_sample(source, (160, 128), rng) for source in ids_images(scenes)]
    state = begin(TrainingSettings())
    totals = [sum(training_step(state, batch, 5.0).values()) for _ in range(12)]
    assert totals[-1] < 0.8 * totals[0]


def test_a_folder_without_labels_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MissingError, match="no labelled images"):
        ids_images(tmp_path)


def test_calibration_recovers_the_share_of_candidates_that_are_right() -> None:
    rng = np.random.default_rng(0)
    verdicts = []
    for _ in range(1600):
        evidence, width_px = rng.uniform(0.05, 0.95), int(rng.integers(2, 12))
        odds = 2 * logit(evidence) + 3 - 1.5 * np.log(width_px)
        right = rng.random() < 1 / (1 + np.exp(-odds))
        mask = np.ones((int(rng.integers(30, 300)), width_px), bool)
        candidate = Candidate((0, 0), mask.astype(np.float32), mask, evidence, 0.8)
        verdicts.append(Verdict(candidate, right, float(right), True, 0.0))
    judged = Judgement([JudgedImage(verdicts, len(verdicts), 1, 1)])
    calibration = judged.fit_calibration()
    assert calibration.centre_logit == pytest.approx(2, abs=0.4)
    assert calibration.log_width == pytest.approx(-1.5, abs=0.4)
    assert calibration.log_height == pytest.approx(0, abs=0.3)
    assert judged.figures(calibration)["detection_precision_0.9"] > 0.93
    scores = np.array([calibration.probability(v.candidate) for v in verdicts])
    elsewhere = ScoreCalibration.of(calibration.weights * 0.5 + [0, 0, 0, 0, 0, 3])
    scaled = judged.fit_scale(elsewhere)  # the same order, other odds
    assert scaled.weights[:-1] == pytest.approx(calibration.weights[:-1], abs=0.05)
    assert scaled.constant == pytest.approx(calibration.constant, abs=0.1)
    assert scores.mean() == pytest.approx(np.mean([v.detected for v in verdicts]), abs=0.02)


def test_what_lies_in_the_padding_is_nothing(
    net: polenet.PoleNet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cv2.imwrite(str(tmp_path / "a.jpg"), np.full((100, 128, 3), 90, np.uint8))  # doubled, and 24 rows added
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((100, 128), np.uint8))
    mask, centre, offsets = np.zeros((224, 256)), np.zeros((28, 32)), np.zeros((2, 56, 64))
    mask[202:224, 40:48] = centre[26, 5] = 1.0
    monkeypatch.setattr("scpf.models.polenet_validation.maps", lambda net, framed: (mask, centre, offsets))
    (judged,) = judge(net, ids_images(tmp_path)).images
    assert judged.verdicts == []
    mask[150:200, 40:48] = centre[21, 5] = 1.0  # not all of it
    (judged,) = judge(net, ids_images(tmp_path)).images
    assert len(judged.verdicts) == 1


def test_a_mask_that_is_too_wide_is_a_detection_and_no_good_mask() -> None:
    ids = np.zeros((96, 64), np.uint8)
    ids[10:80, 30:32] = 1
    wide = np.ones((70, 6), bool)
    candidate = Candidate((28, 10), wide.astype(np.float32), wide, 0.9, 0.9)
    best, overlap, ignored = match(candidate, ids, np.bincount(ids.ravel(), minlength=256), set())
    assert (best, ignored) == (1, 0)
    assert overlap == pytest.approx(1 / 3)
    assert is_detection(candidate, ids == 1)
    assert not is_detection(candidate._replace(corner_px=(20, 10)), ids == 1)
    assert not is_detection(candidate._replace(mask=wide[:20], soft=wide[:20].astype(np.float32)), ids == 1)
