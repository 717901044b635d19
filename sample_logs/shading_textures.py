"""Looking up the images of the world: wrapped, mip-mapped tiles, and the panorama of the sky.

The mip level follows the footprint of a pixel (Williams, "Pyramidal parametrics", 1983), bilinear within it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scpf.sample_logs.kernels import clamp, inlined, part

GRAIN, PATCHES, LARGE_PATCHES = 0, 1, 2
"""Channels of the noise tile."""
LOWEST_SKY_RAD = -0.09
"""Elevation of the panorama's first row; the last one is the zenith, and rows lie closer at the horizon."""


class Noise(NamedTuple):
    """The noise tile: all levels of three channels (3, total), and where each level begins."""

    values: NDArray[np.float32]
    offset: NDArray[np.int64]
    size: int


class Images(NamedTuple):
    """All that faces and sky take colours from."""

    noise: Noise
    grass: NDArray[np.float32]
    grass_offset: NDArray[np.int64]
    grass_size: int
    card_luminance: NDArray[np.uint8]
    card_offset: NDArray[np.int64]
    """(cards, levels)."""
    card_size: int
    signs: NDArray[np.float32]
    sky: NDArray[np.float32]
    """(elevations, azimuths, 3), see sky.py."""


@part
def _level(footprint_texels: Any, last: Any) -> Any:
    """The mip level at which a footprint covers at most a texel and a half."""
    level = 0
    while footprint_texels > 1.5 and level < last:
        footprint_texels *= 0.5
        level += 1
    return level


@part
def _corners(u: Any, v: Any, size: Any) -> Any:
    """The four texels about a place in a wrapped tile, as indices, and the shares of the right and lower ones."""
    x, y = (u - math.floor(u)) * size, (v - math.floor(v)) * size
    i, j = int(x), int(y)
    right, down = x - i, y - j
    i, j = i & (size - 1), j & (size - 1)
    i2, j2 = (i + 1) & (size - 1), (j + 1) & (size - 1)
    return j * size + i, j * size + i2, j2 * size + i, j2 * size + i2, right, down


@part
def noise_at(noise: Any, channel: Any, u: Any, v: Any, footprint: Any) -> Any:
    """The noise at (u, v), and the footprint, in tiles."""
    level = _level(footprint * noise.size, 8)
    a, b, c, d, right, down = _corners(u, v, noise.size >> level)
    start, values = noise.offset[level], noise.values
    above = values[channel, start + a] * (1 - right) + values[channel, start + b] * right
    below = values[channel, start + c] * (1 - right) + values[channel, start + d] * right
    return above * (1 - down) + below * down


@part
def plane_noise(noise: Any, channel: Any, point: Any, per_metre: Any, footprint: Any) -> Any:
    """The noise laid flat on the ground at ``per_metre`` tiles a metre; footprint in metres."""
    return noise_at(noise, channel, point[0] * per_metre, point[1] * per_metre, footprint * per_metre)


@inlined
def grass_at(images: Any, u: Any, v: Any, footprint: Any) -> Any:
    """Colour of the grass tile at (u, v), and the footprint, in tiles."""
    level = _level(footprint * images.grass_size, 8)
    a, b, c, d, right, down = _corners(u, v, images.grass_size >> level)
    start, grass = images.grass_offset[level], images.grass
    w_a, w_b = (1 - right) * (1 - down), right * (1 - down)
    w_c, w_d = (1 - right) * down, right * down
    a, b, c, d = start + a, start + b, start + c, start + d
    return (
        grass[0, a] * w_a + grass[0, b] * w_b + grass[0, c] * w_c + grass[0, d] * w_d,
        grass[1, a] * w_a + grass[1, b] * w_b + grass[1, c] * w_c + grass[1, d] * w_d,
        grass[2, a] * w_a + grass[2, b] * w_b + grass[2, c] * w_c + grass[2, d] * w_d,
    )


@part
def sky_at(sky: Any, direction: Any) -> Any:
    """Radiance of the sky in a direction of map."""
    rows, columns = sky.shape[0], sky.shape[1]
    turn = math.atan2(direction[1], direction[0]) / (2 * math.pi)
    elevation = math.asin(clamp(direction[2], -1.0, 1.0))
    share = (elevation - LOWEST_SKY_RAD) / (math.pi / 2 - LOWEST_SKY_RAD)
    x = (turn - math.floor(turn)) * columns
    y = math.sqrt(max(share, 0.0)) * (rows - 1)
    i, j = int(x), min(int(y), rows - 2)
    right, up = x - i, y - j
    i %= columns
    i2 = (i + 1) % columns
    w_a, w_b = (1 - right) * (1 - up), right * (1 - up)
    w_c, w_d = (1 - right) * up, right * up
    return (
        sky[j, i, 0] * w_a + sky[j, i2, 0] * w_b + sky[j + 1, i, 0] * w_c + sky[j + 1, i2, 0] * w_d,
        sky[j, i, 1] * w_a + sky[j, i2, 1] * w_b + sky[j + 1, i, 1] * w_c + sky[j + 1, i2, 1] * w_d,
        sky[j, i, 2] * w_a + sky[j, i2, 2] * w_b + sky[j + 1, i, 2] * w_c + sky[j + 1, i2, 2] * w_d,
    )
