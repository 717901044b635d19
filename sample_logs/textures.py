"""Images that the shading looks up: noise, grass, leaf cards and sign plates, all drawn from one seed.

Tiles wrap around and carry their mip maps (Williams, "Pyramidal parametrics", 1983) one after the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from scpf.sample_logs.textures_cards import CARD_SIZE, leaf_cards
from scpf.sample_logs.textures_signs import sign_plates

NOISE_SIZE, GRASS_SIZE = 512, 1024
GRASS_COLOUR = (0.050, 0.066, 0.026)
BLADE_COLOUR = np.array([0.072, 0.100, 0.036])
WITHERED = np.array([0.9, 0.25, 0.3])
"""How much brighter each colour of a withered blade is."""
BLADES = 26_000


@dataclass(frozen=True)
class Textures:
    """Every image of the world, linear values; offsets are where each mip level begins."""

    noise: NDArray[np.float32]
    """(3, total), fine grain, patches and large patches, mean 0 and deviation 1 at the finest level."""
    noise_offset: NDArray[np.int64]
    grass: NDArray[np.float32]
    """(3, total), red, green and blue reflectance."""
    grass_offset: NDArray[np.int64]
    grass_size: int
    card_alpha: NDArray[np.uint8]
    """All levels of all leaf cards; a leaf is where the value is above 110."""
    card_luminance: NDArray[np.uint8]
    card_offset: NDArray[np.int64]
    """(cards, 6)."""
    card_size: int
    signs: NDArray[np.float32]
    """(7, 128, 128, 4), reflectance of the plates; see textures_signs."""


def make_textures(seed: int) -> Textures:
    """Draw all images; the same seed gives the same bits."""
    rng = np.random.default_rng([seed, 1])
    grain = tile_noise(rng, NOISE_SIZE, 0.45, lowest=20)
    patches = tile_noise(rng, NOISE_SIZE, 1.15, lowest=3)
    large = tile_noise(rng, NOISE_SIZE, 1.7, lowest=2, highest=60)
    noise, noise_offset = _mip_maps(np.stack([grain, patches, large]))
    grass, grass_offset = _mip_maps(_grass(rng).transpose(2, 0, 1))
    alpha, luminance, card_offset = leaf_cards(rng)
    return Textures(
        noise=noise,
        noise_offset=noise_offset,
        grass=grass,
        grass_offset=grass_offset,
        grass_size=GRASS_SIZE,
        card_alpha=alpha,
        card_luminance=luminance,
        card_offset=card_offset,
        card_size=CARD_SIZE,
        signs=sign_plates(),
    )


def tile_noise(
    rng: np.random.Generator, size: int, exponent: float, lowest: float = 1, highest: float = 1e9
) -> NDArray[np.float64]:
    """Noise (size, size) that wraps around: amplitude 1 / frequency ** exponent between the two frequencies
    (cycles a tile); mean 0, deviation 1."""
    cycles = np.fft.fftfreq(size) * size
    frequency = np.hypot(*np.meshgrid(cycles, cycles))
    wanted = (frequency >= lowest) & (frequency <= highest)
    amplitude = np.where(wanted, np.maximum(frequency, 1) ** -exponent, 0)
    field = np.fft.ifft2(np.fft.fft2(rng.standard_normal((size, size))) * amplitude).real
    return np.asarray((field - field.mean()) / field.std())


def _grass(rng: np.random.Generator) -> NDArray[np.float32]:
    ground = 1 + 0.15 * tile_noise(rng, GRASS_SIZE, 1.2, lowest=3)[..., None]
    image = (ground * np.array(GRASS_COLOUR)).astype(np.float32)
    roots = rng.integers(0, GRASS_SIZE, (BLADES, 2))
    angles, lengths = rng.uniform(0, 2 * np.pi, BLADES), rng.uniform(22, 62, BLADES)
    brightness, withered = rng.uniform(0.45, 1.9, BLADES), rng.uniform(0, 1, BLADES) ** 4
    tips = roots + (lengths * np.array([np.cos(angles), np.sin(angles)])).T
    colours = BLADE_COLOUR * brightness[:, None] * (1 + withered[:, None] * WITHERED)
    for root, tip, colour in zip(roots.tolist(), tips.astype(int).tolist(), colours.tolist(), strict=True):
        cv2.line(image, root, tip, colour, 2, cv2.LINE_8)
    return np.asarray(image, np.float32)


def _mip_maps(image: NDArray[Any]) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """All levels (channels, total) of a square image (channels, size, size), and where each begins."""
    levels = [np.asarray(image, np.float64)]
    while levels[-1].shape[-1] > 1:
        fine = levels[-1]
        rows = fine[..., ::2, :] + fine[..., 1::2, :]
        levels.append((rows[..., ::2] + rows[..., 1::2]) / 4)
    sizes = np.array([level.shape[-1] ** 2 for level in levels])
    flat = np.concatenate([level.reshape(len(level), -1) for level in levels], axis=-1)
    return np.ascontiguousarray(flat, np.float32), (np.cumsum(sizes) - sizes).astype(np.int64)
