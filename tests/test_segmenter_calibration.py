"""`scpf train segmenter --calibrate`: another score, the same network."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from scpf.models import polenet
from scpf.models.grouping import ScoreCalibration
from scpf.models.labelled_images import ids_images
from scpf.models.polenet_inference import for_inference
from scpf.models.polenet_validation import judge
from scpf.models.segmentation import load
from scpf.replay.cli import run
from scpf.sample_logs.scene_files import write_scenes
from scpf.sample_logs.street_scenes import scene

WEIGHTS = polenet.weights_path("polenet")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four labelled pictures."""
    folder = tmp_path_factory.mktemp("site")
    write_scenes(folder, range(900_010, 900_014))
    return folder


def test_the_score_is_fitted_anew_and_the_network_stays(
    site: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "site.safetensors"
    command = ["train", "segmenter", "--calibrate", "polenet", str(site), "-o", str(output)]
    assert run([*command, "--format", "json"]) == 0
    told = capsys.readouterr()
    assert "4 of 4 pictures" in told.err
    (before, was), (after, now) = polenet.load(WEIGHTS), polenet.load(output)
    assert json.loads(told.out) == {"output": str(output), "figures": now.figures}
    assert all(torch.equal(value, after.state_dict()[name]) for name, value in before.state_dict().items())
    assert now.calibration != was.calibration and now.figures != was.figures
    candidates = len(judge(for_inference(before), ids_images(site)).verdicts(np.s_[0::2]))
    fitted_to = (
        f"score fitted to 2 pictures of {site.name}, {candidates} candidates: slope and constant alone"
    )
    assert now.trained_on == f"{was.trained_on}; {fitted_to}" and fitted_to in told.err
    kept = now.calibration.weights[:-1] / was.calibration.weights[:-1]
    assert np.allclose(kept, kept[0])
    image = scene(900_010)[0][..., ::-1]
    old, new = load("polenet", threshold=0.02)(image), load(output, threshold=0.02)(image)
    assert new and {found.box_px for found in new} & {found.box_px for found in old}
    assert run(command) == 1  # it is there already
    assert run([*command, "--overwrite", "-q"]) == 0


def test_many_candidates_weigh_the_evidence(
    site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("scpf.replay.segmenter_calibration.FEWEST_TO_WEIGH", 3)
    output = tmp_path / "site.safetensors"
    assert run(["train", "segmenter", "--calibrate", "polenet", str(site), "-o", str(output), "-q"]) == 0
    judged = judge(for_inference(polenet.load(WEIGHTS)[0]), ids_images(site))
    fitted = judged.fit_calibration(np.s_[0::2])
    assert polenet.load(output)[1].calibration.weights == pytest.approx(fitted.weights)


def test_pictures_without_a_found_pole_fit_no_score(
    site: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    blank = tmp_path / "blank"
    blank.mkdir()
    for picture in sorted(site.glob("*.jpg")):
        shutil.copyfile(picture, blank / picture.name)
        labels = cv2.imread(str(picture.with_suffix(".png")), cv2.IMREAD_GRAYSCALE)
        cv2.imwrite(str(blank / picture.with_suffix(".png").name), np.zeros_like(labels))
    output = tmp_path / "blank.safetensors"
    assert run(["train", "segmenter", "--calibrate", "polenet", str(blank), "-o", str(output), "-q"]) == 1
    told = capsys.readouterr().err
    assert "blank: none of the" in told and "label more pictures" in told
    assert not output.exists()


def test_painted_scenes_weigh_the_evidence_and_the_site_sets_the_odds(site: Path, tmp_path: Path) -> None:
    output, painted = tmp_path / "site.safetensors", tmp_path / "painted"
    command = ["train", "segmenter", "--calibrate", str(WEIGHTS), str(site), "-o", str(output), "-q"]
    assert run([*command, "--weigh-scenes", "3", "--scenes-folder", str(painted)]) == 0
    info = polenet.load(output)[1]
    assert info.trained_on.endswith(f"2 pictures of {site.name}, its evidence weighed on 3 painted scenes")
    net = for_inference(polenet.load(WEIGHTS)[0])
    weighed = judge(net, ids_images(painted / "weighed")).fit_calibration().weights
    fitted = judge(net, ids_images(site)).fit_scale(ScoreCalibration.of(weighed), np.s_[0::2])
    assert info.calibration.weights == pytest.approx(fitted.weights)
    assert np.allclose(np.diff(fitted.weights[:-1] / weighed[:-1]), 0, atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["-o", "a.safetensors"], "fewer than two pictures"),
        (["SITE"], "no --output"),
        (["SITE", "-o", "a.safetensors", "--weigh-scenes", "-1"], "not negative"),
        (["SITE", "-o", "a.safetensors", "--scenes", "3"], "trains on no scenes"),
        (["SITE", "-o", "a.safetensors", "--evaluate", "polenet"], "both --evaluate and --calibrate"),
    ],
)
def test_what_is_missing_is_said(
    site: Path, arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [str(site) if each == "SITE" else each for each in arguments]
    assert run(["train", "segmenter", "--calibrate", str(WEIGHTS), *given]) == 2
    assert told in capsys.readouterr().err
