"""Things that stand in the street: bark, leaves, metal, lamps, cars, signs."""

from __future__ import annotations

from typing import Any

from scpf.sample_logs.kernels import hashed, inlined, part, scaled
from scpf.sample_logs.shading_surface import BLACK, coated, glowing, matt, surface
from scpf.sample_logs.shading_textures import GRAIN, LARGE_PATCHES, PATCHES, noise_at

LENS_LIGHT, TAIL_LIGHT, HEADLIGHT = (9.0, 7.0, 4.2), (1.6, 0.10, 0.06), (4.0, 3.8, 3.2)
"""Radiance of a street lamp, of brake lights and of headlights at full power."""
LENS, RED_PLASTIC, CLEAR_PLASTIC = (0.55, 0.55, 0.50), (0.35, 0.03, 0.02), (0.60, 0.60, 0.60)
GLASS, RUBBER, RIM = (0.020, 0.022, 0.025), (0.022, 0.022, 0.023), (0.35, 0.35, 0.36)
TRANSLUCENCY = 0.45


@part
def bark(noise: Any, spot: Any) -> Any:
    """Bark, furrowed upwards."""
    u, v, footprint = spot.u, spot.v, spot.footprint_m * 0.5
    furrows = noise_at(noise, GRAIN, u * 0.6, v * 0.12, footprint)
    patches = noise_at(noise, PATCHES, u * 0.5, v * 0.3, footprint)
    return matt(scaled(spot.tint, max(0.0, 1 + 0.55 * furrows + 0.25 * patches)))


@inlined
def leaf(images: Any, spot: Any, card: Any) -> Any:
    """A texel of a leaf card; cards differ a little."""
    size = images.card_size
    i, j = min(max(int(spot.u * size), 0), size - 1), min(max(int(spot.v * size), 0), size - 1)
    brightness = images.card_luminance[images.card_offset[card, 0] + j * size + i] / 255.0
    variety = 0.85 + 0.30 * hashed(spot.number // 2 * 3 + 1, 17)
    return surface(scaled(spot.tint, (0.50 + 0.75 * brightness) * variety), BLACK, 0.0, 0.0, TRANSLUCENCY)


@part
def metal(noise: Any, spot: Any, variety: Any) -> Any:
    """Galvanised or painted steel, streaked, dirty near the ground."""
    patches = noise_at(noise, PATCHES, spot.u * 0.7, spot.v * 0.25, spot.footprint_m * 0.5)
    streaks = noise_at(noise, LARGE_PATCHES, spot.u * 0.3 + variety, spot.v * 0.08, spot.footprint_m * 0.2)
    value = 1 + 0.10 * patches + 0.13 * streaks
    if spot.height_m < 0.9:
        value *= 0.86 + 0.14 * max(spot.height_m, 0.0) / 0.9
    return coated(scaled(spot.tint, value), 0.08, 0.18)


@part
def lamp_lens(lamp_power: Any) -> Any:
    """The lens of a street lamp."""
    return glowing(LENS, scaled(LENS_LIGHT, lamp_power), 0.3)


@part
def paint(spot: Any) -> Any:
    """Car paint under clear coat."""
    return coated(spot.tint, 0.05, 0.9)


@part
def glass() -> Any:
    """Windows of cars and shelters, dark inside."""
    return coated(GLASS, 0.08, 0.95)


@part
def rubber() -> Any:
    """Tyres and plastic."""
    return coated(RUBBER, 0.02, 0.1)


@part
def rim() -> Any:
    """Wheel rims and number plates."""
    return coated(RIM, 0.2, 0.5)


@part
def sign(signs: Any, spot: Any, plate: Any) -> Any:
    """A road sign; v runs upwards."""
    size = signs.shape[1]
    i = min(max(int(spot.u * size), 0), size - 1)
    j = min(max(int((1 - spot.v) * size), 0), size - 1)
    return coated((signs[plate, j, i, 0], signs[plate, j, i, 1], signs[plate, j, i, 2]), 0.03, 0.2)


@part
def tail_light(brightness: Any) -> Any:
    """Tail and brake lights."""
    return glowing(RED_PLASTIC, scaled(TAIL_LIGHT, brightness), 0.8)


@part
def headlight(brightness: Any) -> Any:
    """Headlights."""
    return glowing(CLEAR_PLASTIC, scaled(HEADLIGHT, brightness), 0.8)


@part
def plain(noise: Any, spot: Any) -> Any:
    """Cloth, roofs and all else of one colour."""
    u, v = spot.u * 0.4 + spot.point[0] * 0.1, spot.v * 0.4 + spot.point[1] * 0.1
    patches = noise_at(noise, PATCHES, u, v, spot.footprint_m * 0.3)
    return matt(scaled(spot.tint, max(0.0, 1 + 0.15 * patches)))
