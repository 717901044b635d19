"""What lies between the scene and the picture: lens, sensor noise, automatic exposure, and drawn weather."""

from __future__ import annotations

import numpy as np
import pytest

from scpf.models.camera import Camera
from scpf.models.errors import InputError
from scpf.sample_logs.basler import basler_camera
from scpf.sample_logs.exposure import automatic_gain, develop, noise_field, tone_curve
from scpf.sample_logs.lens import lens_of
from scpf.sample_logs.weather import WEATHERS, drawn_weather


def test_noise_grows_with_the_gain() -> None:
    grey, even = np.full((200, 200, 3), 0.2, np.float32), np.ones((200, 200), np.float32)
    noise, curve = noise_field(1), tone_curve()
    spread = [
        develop(grey, even, noise, curve, 1.0, gain, np.random.default_rng(0)).std(axis=(0, 1)).mean()
        for gain in (0.0, 1.0, 3.0)
    ]
    assert spread[0] == 0.0
    assert spread[2] == pytest.approx(3 * spread[1], rel=0.1)
    assert np.all(np.diff(curve) >= 0) and curve[0] == 0.0


def test_automatic_exposure_evens_out_but_dusk_stays_darker() -> None:
    bright = np.full((64, 64, 3), 0.8, np.float32)
    dim = bright * np.float32(0.25)
    shown = automatic_gain(bright, 1.0) * 0.8, automatic_gain(dim, 1.0) * 0.2
    assert 1.2 < shown[0] / shown[1] < 2.0


@pytest.mark.parametrize("width_px", [2048, 1024, 320])
def test_the_default_camera_has_one_lens_at_every_size(width_px: int) -> None:
    camera, full = basler_camera(width_px), basler_camera()
    assert (camera.width_px, camera.height_px) == (width_px, width_px * 3 // 4)
    corner = np.array([[-0.5, -0.5]])  # of the sensor, not of a pixel
    np.testing.assert_allclose(camera.rays(corner), full.rays(corner), atol=1e-9)
    assert camera.T_body_camera[2, 3] == 2.3
    ahead = camera.T_body_camera[:3, 2]
    assert np.degrees(np.arcsin(ahead[2])) == pytest.approx(-2.6)


def test_lens_rays_project_back_to_their_pixels() -> None:
    camera = basler_camera(320)
    lens = lens_of(camera)
    rays = np.stack([lens.x, lens.y, np.ones_like(lens.x)], axis=-1).reshape(-1, 3).astype(np.float64)
    column, row = np.meshgrid(np.arange(320), np.arange(240))
    np.testing.assert_allclose(
        camera.project(rays), np.column_stack([column.ravel(), row.ravel()]), atol=0.01
    )
    assert lens.pixels.x.min() > 1.0 and lens.pixels.x.max() < lens.columns - 1.0


def test_cameras_that_cannot_be_drawn_are_refused() -> None:
    matrix = np.array([[100.0, 0, 160], [0, 100.0, 120], [0, 0, 1]])
    with pytest.raises(InputError, match="inverted"):
        lens_of(Camera(320, 240, matrix, np.array([-0.9, 0.0, 0.0, 0.0, 0.0])))
    with pytest.raises(InputError, match="width"):
        basler_camera(1001)
    wide = np.array([[110.0, 0, 160], [0, 110.0, 120], [0, 0, 1]])
    with pytest.raises(InputError, match="wide"):
        lens_of(Camera(320, 240, wide, np.zeros(4), "equidistant"))


def test_drawn_weathers_differ_and_repeat() -> None:
    draws = [drawn_weather(np.random.default_rng(seed)) for seed in range(40)]
    assert draws[3] == drawn_weather(np.random.default_rng(3))
    assert {weather.name for weather in draws} == set(WEATHERS)
