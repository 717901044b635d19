"""The sensor: automatic exposure, shot and read noise, white balance, and the tone curve to 8 bits."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.sample_logs.kernels import kernel

WHITE_BALANCE: Final = (1.02, 1.0, 0.97)
AIM: Final = 0.45
"""Brightness that the automatic exposure brings the picture's middle to."""
DARKEST: Final = 0.06
ADAPTATION: Final = 0.72
"""1 would make every scene equally bright; less keeps dusk dark."""
SHOT_NOISE, READ_NOISE = 0.013, 0.0035
"""Standard deviations: of a pixel at full brightness, and of a black one."""
NOISE_ROWS, NOISE_COLUMNS = 733, 1021
CURVE_STEPS, CURVE_TOP = 4096, 4.0


def noise_field(seed: int) -> NDArray[np.float32]:
    """Normal noise (rows, columns) that each frame reads from another place."""
    rng = np.random.default_rng([seed, 13])
    return rng.standard_normal((NOISE_ROWS, NOISE_COLUMNS)).astype(np.float32)


def tone_curve() -> NDArray[np.float32]:
    """Grey values (4096,) of brightness 0 to 4: a filmic shoulder (Narkowicz, "ACES filmic tone mapping curve",
    2015), then sRGB (IEC 61966-2-1)."""
    x = np.linspace(0, CURVE_TOP, CURVE_STEPS) * 0.92
    y = np.clip((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14), 0, 1)
    srgb = np.where(y <= 0.0031308, 12.92 * y, 1.055 * y ** (1 / 2.4) - 0.055)
    return (srgb * 255).astype(np.float32)


def automatic_gain(image: NDArray[np.float32], aim: float) -> float:
    """The factor that brings radiance (H, W, 3) to the middle of the tone curve, times ``aim``."""
    brightness = image[::8, ::8].mean(axis=-1)
    geometric = float(np.exp(np.log(np.maximum(brightness, 1e-3)).mean()))
    middle = 0.25 * geometric + 0.75 * float(np.median(brightness))
    return float(aim * AIM / max(middle, DARKEST) ** ADAPTATION)


def develop(
    image: NDArray[np.float32],
    vignetting: NDArray[np.float32],
    noise: NDArray[np.float32],
    curve: NDArray[np.float32],
    gain: float,
    noise_gain: float,
    rng: np.random.Generator,
) -> NDArray[np.uint8]:
    """The picture (H, W, 3) as 8-bit RGB from linear radiance; ``noise_gain`` multiplies the noise."""
    picture = np.empty(image.shape, np.uint8)
    start = int(rng.integers(NOISE_ROWS)), int(rng.integers(NOISE_COLUMNS))
    sensor = (gain, SHOT_NOISE * noise_gain, READ_NOISE * noise_gain)
    _develop(image, vignetting, noise, curve, start, sensor, WHITE_BALANCE, picture)
    return picture


@kernel
def _develop(
    image: Any, vignetting: Any, noise: Any, curve: Any, start: Any, sensor: Any, balance: Any, picture: Any
) -> None:
    rows, columns = vignetting.shape
    noise_rows, noise_columns = noise.shape
    gain, shot, read = sensor
    steps = curve.size
    for row in range(rows):
        noise_row = (row + start[0]) % noise_rows
        for column in range(columns):
            factor = gain * vignetting[row, column]
            for c in range(3):
                value = image[row, column, c] * factor * balance[c]
                z = noise[noise_row, (column + start[1] + c * 331) % noise_columns]
                value += z * math.sqrt(read * read + shot * shot * max(value, 0.0))
                place = min(max(value * (steps - 1) / CURVE_TOP, 0.0), steps - 2.0)
                k = int(place)
                grey = curve[k] + (curve[k + 1] - curve[k]) * (place - k)
                picture[row, column, c] = np.uint8(grey + 0.5)
