"""``scpf replay --segmenter FILE.pth``: a foreign Mask R-CNN in the pipeline, and what is said about it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch
from maskrcnn_goldens import tensors_of

from scpf.replay.cli import run

SAMPLE = Path(__file__).parent.parent / "sample_logs" / "ring_road.mcap"
SMALL = """
score_threshold = 0.2
[checkpoint]
short_side_px = 48
classes = ["", "", "light_pole"]
"""


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A torchvision Mask R-CNN of three classes, with the weights of the rule."""
    path = tmp_path_factory.mktemp("weights") / "lamps.pth"
    tensors = tensors_of("torchvision")
    torch.save({key: tensors[key] for key in tensors if not key.endswith("num_batches_tracked")}, path)
    return path


def test_a_replay_with_foreign_weights(
    tmp_path: Path, weights: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "small.toml").write_text(SMALL)
    options = ["--segmenter", str(weights), "--config", str(tmp_path / "small.toml"), "--stop", "0.05"]
    assert run(["replay", str(SAMPLE), "-o", str(tmp_path), *options, "--format", "json"]) == 0
    printed = capsys.readouterr()
    summary = json.loads(printed.out)
    assert summary["frames"] == 1
    assert sum(summary["poles_per_frame"].values()) == 1
    assert set(summary["poles_per_frame"]) - {"0"}  # random weights find something in any picture
    assert (
        "torchvision's convention, 3 classes; assumed, as the file does not say: colour order RGB"
        in printed.err
    )
    assert summary["settings"]["checkpoint"]["classes"] == ["", "", "light_pole"]


def test_the_wrong_number_of_classes_ends_it_in_one_line(
    tmp_path: Path, weights: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "two.toml").write_text('[checkpoint]\nclasses = ["light_pole", "sign"]\n')
    options = ["--segmenter", str(weights), "--config", str(tmp_path / "two.toml")]
    assert run(["replay", str(SAMPLE), "-o", str(tmp_path), *options]) == 1
    assert "predicts 3 classes, 2 names were given" in capsys.readouterr().err


def test_without_a_file_it_says_where_one_comes_from(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["replay", str(SAMPLE), "-o", str(tmp_path), "--segmenter", "maskrcnn"]) == 1
    said = capsys.readouterr().err
    assert "needs a weights file" in said and "maskrcnn_resnet50_fpn" in said
