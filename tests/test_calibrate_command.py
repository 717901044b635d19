"""``scpf calibrate``: pictures in, a calibration out that ``scpf ingest`` reads, and a report of what was left out."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from chessboard_scenes import CAMERA, Renderer, poses

from scpf.ingest.calibration import read_camera
from scpf.models.camera import looking_ahead
from scpf.replay.cli import run


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve pictures of a board, and one without."""
    folder = tmp_path_factory.mktemp("boards")
    renderer, rng = Renderer(CAMERA), np.random.default_rng(0)
    for k, pose in enumerate(poses(CAMERA, 12, seed=3)):
        cv2.imwrite(str(folder / f"view_{k}.png"), renderer.picture(pose, rng))
    return folder


def test_a_known_camera_comes_back_from_its_pictures(
    tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "calibration.yaml"
    tokens = ["calibrate", str(folder), "--board", "9x6", "--square-m", "0.03", "-o", str(output)]
    assert run([*tokens, "--format", "json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["rms_px"] < 0.15
    assert len(report["view_rms_px"]) == 12 and report["left_out"] == {}
    camera = read_camera(output, image_size_px=(480, 360))
    np.testing.assert_allclose(camera.matrix[[0, 1], [0, 1]], [420, 424], rtol=0.003)
    np.testing.assert_allclose(camera.matrix[:2, 2], [235, 184], atol=1.0)
    np.testing.assert_array_equal(camera.T_body_camera, looking_ahead())
    assert "T_body_camera" not in output.read_text(), "a calibration does not know where the camera sits"
    assert run(tokens) == 1
    assert "exists" in capsys.readouterr().err
    assert run([*tokens, "--overwrite"]) == 0
    text = capsys.readouterr().out
    assert "RMS over 12 views" in text and "view_11.png" in text and "fx" in text


def test_pictures_that_are_left_out_are_named(
    tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cv2.imwrite(str(tmp_path / "empty.png"), np.full((360, 480), 128, np.uint8))
    (tmp_path / "broken.jpg").write_bytes(b"\xff\xd8 no picture")
    tokens = ["calibrate", str(folder), str(tmp_path / "empty.png"), str(tmp_path / "broken.jpg")]
    tokens += ["--board", "9x6", "--square-m", "0.03", "-o", str(tmp_path / "calibration.yaml")]
    assert run(tokens) == 3
    text = capsys.readouterr().out
    assert "left out: no board of 9×6 inner corners found" in text
    assert "broken.jpg" in text
    assert "2 left out" in (tmp_path / "calibration.yaml").read_text()


def test_calls_that_cannot_work(tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    common = ["--square-m", "0.03", "-o", str(tmp_path / "a.yaml")]
    assert run(["calibrate", str(folder), "--board", "9 by 6", *common]) == 2
    assert run(["calibrate", str(tmp_path / "none"), "--board", "9x6", *common]) == 1
    assert run(["calibrate", str(folder / "view_0.png"), "--board", "9x6", *common]) == 1
    assert "needs 3 views" in capsys.readouterr().err
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((10, 10), np.uint8))
    assert run(["calibrate", str(folder), str(tmp_path / "small.png"), "--board", "9x6", *common]) == 1
    assert "10×10" in capsys.readouterr().err
    assert not (tmp_path / "a.yaml").exists()
