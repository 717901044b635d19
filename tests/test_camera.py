"""Pixels to rays and back, through each lens model; bearings in the body frame."""

from __future__ import annotations

import numpy as np
import pytest

from scpf.models.camera import R_BODY_OPTICAL, Camera, looking_ahead
from scpf.models.errors import InputError

MATRIX = np.array([[730.0, 0.0, 517.0], [0.0, 731.0, 379.0], [0.0, 0.0, 1.0]])
LENSES = {
    "plumb_bob": np.array([-0.19, 0.055, 6e-4, -4e-4, 0.0]),
    "rational_polynomial": np.array([0.2, 0.1, 1e-4, -1e-4, 0.02, 0.5, 0.1, 0.02]),
    "equidistant": np.array([-0.01, 0.004, -0.002, 0.0005]),
}


@pytest.mark.parametrize("model", LENSES)
def test_rays_and_projection_are_inverse(model: str) -> None:
    camera = Camera(1024, 768, MATRIX, LENSES[model], model)
    pixels = np.random.default_rng(0).uniform([0, 0], [1023, 767], (300, 2))
    rays = camera.rays(pixels)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0)
    np.testing.assert_allclose(camera.project(rays * 17.0), pixels, atol=1e-3)


def test_the_principal_point_looks_ahead_and_left_is_positive() -> None:
    camera = Camera(1024, 768, MATRIX, T_body_camera=looking_ahead())
    pixels = np.array([[517.0, 379.0], [317.0, 379.0], [717.0, 500.0]])
    bearings = camera.bearings(pixels)
    np.testing.assert_allclose(bearings[:2], [0.0, np.arctan2(200.0, 730.0)], atol=1e-9)
    assert bearings[2] < 0


def test_bearings_turn_with_the_mounting() -> None:
    turn = np.radians(10.0)
    mounted = np.eye(4)
    yaw = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    mounted[:3, :3] = yaw @ R_BODY_OPTICAL
    camera = Camera(1024, 768, MATRIX, T_body_camera=mounted)
    np.testing.assert_allclose(camera.bearings(np.array([[517.0, 379.0]])), [turn], atol=1e-9)


def test_points_behind_have_no_pixel() -> None:
    pixels = Camera(1024, 768, MATRIX).project(np.array([[0.0, 0.0, -5.0], [0.0, 0.0, 5.0]]))
    assert np.isnan(pixels[0]).all()
    np.testing.assert_allclose(pixels[1], [517.0, 379.0])


@pytest.mark.parametrize("model", LENSES)
def test_no_pixels_have_no_rays(model: str) -> None:
    camera = Camera(1024, 768, MATRIX, LENSES[model], model)
    assert camera.rays(np.empty((0, 2))).shape == (0, 3)
    assert camera.bearings(np.empty((0, 2))).shape == (0,)


@pytest.mark.parametrize(
    "change",
    [
        {"distortion_model": "fisheye624"},
        {"distortion": np.zeros(3)},
        {"matrix": np.zeros((3, 3))},
        {"width_px": 0},
    ],
)
def test_impossible_cameras_are_refused(change: dict[str, object]) -> None:
    with pytest.raises(InputError):
        Camera(**{"width_px": 10, "height_px": 10, "matrix": MATRIX, **change})  # type: ignore[arg-type]
