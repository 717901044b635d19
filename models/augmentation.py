"""What cameras and light do to a picture, to train a network on more of it than was labelled.

OpenCV does it, which is a dependency anyway. Of the libraries made for it, albumentations is no longer maintained and
its successor is under the AGPL, torchvision does not load beside every torch, and kornia took 0.9 core-seconds for
eight crops of 640×480 where this takes 0.05.
"""

from __future__ import annotations

import cv2
import numpy as np

from scpf.models.instances import Image


def degrade(image: Image, rng: np.random.Generator) -> Image:
    """An image (H, W, 3) uint8 as another camera in another light would have taken it; the outlines stay.

    Grey, swapped or tinted channels, shade on one side, exposure, haze, blur of lens and motion, noise, JPEG.
    """
    if rng.random() < 0.4:
        weights = rng.dirichlet((2.0, 4.0, 2.0)).astype(
            np.float32
        )  # grey cameras differ in spectral response
        image = np.repeat(cv2.transform(image, weights[None])[..., None], 3, axis=2)
    elif rng.random() < 0.4:
        image = image[:, :, rng.permutation(3)]
    if rng.random() < 0.25:
        image = shaded(image, rng)
    levels = np.arange(256, dtype=np.float32) / 255
    contrast = rng.uniform(0.25, 0.6) if rng.random() < 0.2 else rng.uniform(0.7, 1.4)
    tone = (levels ** rng.uniform(0.6, 1.7) - 0.5) * contrast + 0.5 + rng.uniform(-0.18, 0.18)
    tint = rng.uniform(0.92, 1.08, 3) if rng.random() < 0.5 else np.ones(3)
    table = np.clip(255 * tone[:, None] * tint, 0, 255).astype(np.uint8)[None]
    image = np.asarray(cv2.LUT(np.ascontiguousarray(image), table), np.uint8)
    if rng.random() < 0.3:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), rng.uniform(0.3, 1.3)), np.uint8)
    if rng.random() < 0.1:
        image = _smear(image, rng)
    if rng.random() < 0.5:
        channels = 1 if rng.random() < 0.5 else 3
        noise = rng.standard_normal((*image.shape[:2], channels), dtype=np.float32) * rng.uniform(0, 9)
        image = np.clip(image + noise, 0, 255).astype(np.uint8)
    if rng.random() < 0.25:
        written = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(35, 95))])[1]
        image = np.asarray(cv2.imdecode(written, cv2.IMREAD_COLOR), np.uint8)
    return image


def shaded(image: Image, rng: np.random.Generator) -> Image:
    """Darker towards one side of an image (H, W, 3) uint8, as where houses shade it; no pixel below a fifth."""
    height, width = image.shape[:2]
    angle = rng.uniform(0, 2 * np.pi)
    along = np.cos(angle) * np.linspace(-1, 1, width) + np.sin(angle) * np.linspace(-1, 1, height)[:, None]
    begins, darkest = rng.uniform(-1.0, 0.6), rng.uniform(0.2, 0.8)
    share = np.clip((along - begins) / rng.uniform(0.3, 1.2), 0, 1)
    gain = (1 - (1 - darkest) * share**2 * (3 - 2 * share)).astype(np.float32)
    return np.asarray(image * gain[..., None], np.uint8)


def _smear(image: Image, rng: np.random.Generator) -> Image:
    """Motion along a line of two to six pixels, mostly level, as a turning vehicle gives it."""
    length, angle = rng.uniform(2, 6), rng.normal(0, 0.3)
    kernel = np.zeros((7, 7), np.float32)
    for share in np.linspace(-0.5, 0.5, 25):
        x, y = 3 + share * length * np.cos(angle), 3 + share * length * np.sin(angle)
        kernel[round(y), round(x)] += 1
    return np.asarray(cv2.filter2D(image, -1, kernel / kernel.sum()), np.uint8)
