"""Ground beside the road: kerbs and pavements of concrete, lawns, and parking lots."""

from __future__ import annotations

import math
from typing import Any

from scpf.sample_logs.kernels import band, hashed, inlined, mixed, part, remainder, smooth_step
from scpf.sample_logs.shading_surface import grey, matt, wetted
from scpf.sample_logs.shading_textures import (
    GRAIN,
    LARGE_PATCHES,
    PATCHES,
    grass_at,
    noise_at,
    plane_noise,
)

KERB_STONE_M, SLAB_M, JOINT_M = 3.0, 1.6, 0.014
STALL_M = 2.7
LOT_WHITE, DEAD_LEAF = (0.60, 0.60, 0.58), (0.30, 0.16, 0.04)


@part
def concrete(noise: Any, spot: Any, slab_m: Any, wetness: Any) -> Any:
    """Concrete laid in slabs of that length along u."""
    footprint, across = spot.footprint_m, spot.v + spot.height_m
    grain = noise_at(noise, GRAIN, spot.u * 0.8, across * 0.8, footprint * 0.8)
    patches = noise_at(noise, PATCHES, spot.u * 0.17, across * 0.17, footprint * 0.17)
    joint = band(remainder(spot.u, slab_m), 0.0, JOINT_M, footprint)
    differing = 0.24 * (hashed(math.floor(spot.u / slab_m), 31) - 0.5)
    value = 0.30 * (1 + 0.12 * grain + 0.08 * patches) * (1 - 0.55 * joint - differing)
    return wetted(grey(value, 1.03, 0.93), 0.4, 0.3, wetness)


@inlined
def lawn(images: Any, spot: Any, leaf_litter: Any, dryness: Any) -> Any:
    """Grass, greener and drier in places, under fallen leaves in autumn."""
    footprint, point = spot.footprint_m, spot.point
    red, green, blue = grass_at(images, point[0] * 0.55, point[1] * 0.55, footprint * 0.55)
    patches = plane_noise(images.noise, PATCHES, point, 0.06, footprint)
    large = plane_noise(images.noise, LARGE_PATCHES, point, 0.012, footprint)
    brightness = 1 + 0.09 * patches + 0.10 * large
    dry = smooth_step(0.2, 2.2, large + 0.45 * patches + 0.8 * dryness)
    colour = (
        red * brightness * (1 + 0.55 * dry),
        green * brightness * (1 + 0.10 * dry),
        blue * brightness * (1 + 0.18 * dry),
    )
    if leaf_litter > 0.0:
        grain = plane_noise(images.noise, GRAIN, point, 0.8, footprint)
        least = 1.5 - 0.9 * leaf_litter
        colour = mixed(colour, DEAD_LEAF, smooth_step(least, least + 0.7, grain + 0.4 * patches))
    return matt(colour)


@part
def parking_lot(noise: Any, spot: Any, wetness: Any) -> Any:
    """Asphalt with the lines of two rows of stalls; u along the row, v across, metres."""
    footprint = spot.footprint_m
    grain = plane_noise(noise, GRAIN, spot.point, 0.9, footprint)
    patches = plane_noise(noise, PATCHES, spot.point, 0.1, footprint)
    value = 0.12 * (1 + 0.35 * grain + 0.2 * patches)
    rows = band(spot.v, 0.5, 5.5, footprint) + band(spot.v, 11.5, 16.5, footprint)
    line = band(remainder(spot.u, STALL_M), 0.0, 0.11, footprint) * rows
    return wetted(mixed((value, value, value), LOT_WHITE, line), 0.5, 0.4, wetness)
