"""Calibration: a known camera comes back from its views, within what the report says of its certainty."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from chessboard_scenes import BOARD, CAMERA, FISHEYE, RATIONAL, Renderer, corners_of, poses, views

from scpf.ingest.camera_calibration import calibrate, coverage
from scpf.ingest.chessboards import Board, View, find_corners, parse_board
from scpf.models.camera import Camera
from scpf.models.errors import InputError, UsageError

SIZE = (480, 360)


def truth_of(camera: Camera) -> list[float]:
    return [*camera.matrix[[0, 1, 0, 1], [0, 1, 2, 2]], *camera.distortion]


@pytest.mark.parametrize(
    ("camera", "model"), [(CAMERA, "plumb_bob"), (FISHEYE, "equidistant"), (RATIONAL, "rational_polynomial")]
)
def test_perfect_corners_give_the_very_camera(camera: Camera, model: str) -> None:
    result = calibrate(views(camera, 15, 0.0), SIZE, BOARD, model)
    assert result.rms_px < 2e-3
    assert not result.outliers
    np.testing.assert_allclose(result.camera.matrix, camera.matrix, atol=0.1)
    # The lens as a whole: single coefficients of a rational polynomial stand in for each other.
    pixels = np.array([[x, y] for x in (40.0, 240.0, 440.0) for y in (40.0, 180.0, 320.0)])
    angles = np.arccos(np.clip(np.sum(camera.rays(pixels) * result.camera.rays(pixels), axis=1), -1, 1))
    assert np.degrees(angles).max() < 0.02


@pytest.mark.parametrize(("camera", "model"), [(CAMERA, "plumb_bob"), (FISHEYE, "equidistant")])
def test_errors_are_as_large_as_the_report_says(camera: Camera, model: str) -> None:
    sigma_px, misses = 0.15, []
    for seed in range(6):
        result = calibrate(views(camera, 14, sigma_px, seed), SIZE, BOARD, model)
        assert result.rms_px == pytest.approx(sigma_px * np.sqrt(2), rel=0.15)
        sigmas = np.array(list(result.sigmas.values()))
        misses.append((np.array(list(result.parameters.values())) - truth_of(camera)) / sigmas)
    spread = np.sqrt(np.mean(np.square(misses)))
    assert 0.6 < spread < 1.5, f"misses are {spread:.2f} of the stated standard deviations"


def test_standard_deviations_agree_with_opencv() -> None:
    shown = views(CAMERA, 12, 0.2)
    result = calibrate(shown, SIZE, BOARD)
    points = [BOARD.points_m().astype(np.float32)] * 12
    pixels = [view.corners_px.astype(np.float32) for view in shown]
    rms, matrix, _, _, _, sigmas, _, errors = cv2.calibrateCameraExtended(points, pixels, SIZE, None, None)
    np.testing.assert_allclose(result.camera.matrix, matrix, rtol=1e-4)
    assert result.rms_px == pytest.approx(rms, rel=1e-4)
    np.testing.assert_allclose(list(result.view_rms_px.values()), np.ravel(errors), rtol=1e-3)
    np.testing.assert_allclose(list(result.sigmas.values()), np.ravel(sigmas)[:9], rtol=0.05)


def test_a_view_that_does_not_fit_is_named_and_left_out() -> None:
    shown = views(CAMERA, 15, 0.1)
    bent = shown[4].corners_px.copy()
    bent[:20] += [4.0, -3.0]
    shown[4] = View("bent.png", bent)
    result = calibrate(shown, SIZE, BOARD)
    assert list(result.outliers) == ["bent.png"]
    assert result.outliers["bent.png"] > 0.5
    assert "bent.png" not in result.view_rms_px and len(result.view_rms_px) == 14
    assert result.camera.matrix[0, 0] == pytest.approx(420, rel=0.005)


def test_few_views_and_a_corner_of_the_picture_are_said() -> None:
    with pytest.raises(InputError, match="needs 3 views with a board, and has 2"):
        calibrate(views(CAMERA, 2, 0.1), SIZE, BOARD)
    result = calibrate(views(CAMERA, 3, 0.1), SIZE, BOARD)
    assert any("3 views are few" in note for note in result.notes)
    assert any("corners cover" in note for note in result.notes) == (result.coverage < 0.6)
    with pytest.raises(UsageError, match="omni"):
        calibrate(views(CAMERA, 3, 0.1), SIZE, BOARD, "omni")


def test_coverage_counts_cells() -> None:
    grid = np.array([[x, y] for x in range(24, 480, 48) for y in range(22, 180, 45)], dtype=float)
    assert coverage([View("a", grid)], SIZE) == 0.5
    assert coverage([View("a", np.array([[-0.4, -0.4], [479.4, 359.4]]))], SIZE) == 2 / 80


def test_equal_views_are_no_calibration() -> None:
    one = views(CAMERA, 1, 0.1)[0]
    try:
        result = calibrate([one, one, one], SIZE, BOARD)
    except InputError:
        return
    assert result.notes


@pytest.mark.parametrize("camera", [CAMERA, FISHEYE])
def test_corners_are_found_to_a_fraction_of_a_pixel(camera: Camera) -> None:
    renderer, rng, errors = Renderer(camera), np.random.default_rng(0), []
    for pose in poses(camera, 5, seed=5):
        corners = find_corners(renderer.picture(pose, rng), BOARD)
        if corners is None:
            continue
        expected = corners_of(camera, pose)
        if np.linalg.norm(corners[0] - expected[0]) > 5:
            expected = expected[::-1]  # the board looks the same when turned by half
        errors.append(float(np.sqrt(np.mean(np.sum((corners - expected) ** 2, axis=1)))))
    assert len(errors) >= 3, "a fisheye's boards near its rim are small"
    assert np.median(errors) < 0.1 and max(errors) < 0.15


def test_pictures_without_the_board() -> None:
    rng = np.random.default_rng(0)
    assert find_corners(rng.integers(0, 255, (120, 160)).astype(np.uint8), BOARD) is None
    assert find_corners(np.zeros((1, 1), np.uint8), BOARD) is None


def test_boards() -> None:
    assert parse_board("9x6", 0.03) == Board(9, 6, 0.03)
    points = BOARD.points_m()
    np.testing.assert_allclose([points[1], points[9]], [[0.03, 0, 0], [0, 0.03, 0]])
    for text, side in (
        ("9", 0.03),
        ("2x6", 0.03),
        ("9x6", 0.0),
        ("9x6", float("nan")),
        ("900x6", 0.03),
        ("9x-6", 1),
    ):
        with pytest.raises(UsageError):
            parse_board(text, side)
