"""Light on a spot: the sun and its shadows, sky and ground, street lamps, mirrored surroundings, and haze."""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scpf.sample_logs.kernels import (
    dot,
    inlined,
    minus,
    mixed,
    part,
    scaled,
    smooth_step,
    transformed,
)
from scpf.sample_logs.shading_textures import sky_at


class HeightMap(NamedTuple):
    """The scene seen along parallel rays: towards the sun, or from above."""

    height: NDArray[np.float32]
    """(rows, columns), of the highest face at each texel, metres."""
    T_texel_map: NDArray[np.float64]
    """(3, 4), map to column, row and height."""


class Lighting(NamedTuple):
    """All light of one frame."""

    sun_direction: tuple[float, float, float]
    sun_rgb: tuple[float, float, float]
    sky_rgb: tuple[float, float, float]
    """Irradiance from the sky on a face that looks up."""
    ground_rgb: tuple[float, float, float]
    """Irradiance from the ground on a face that looks down."""
    fog_rgb: tuple[float, float, float]
    fog_per_m: float
    glare: float
    casts_shadows: bool
    wetness: float
    lamp_power: float
    leaf_litter: float
    dryness: float
    ground_m: float
    """Height of the road in map."""
    towards_sun: HeightMap
    from_above: HeightMap
    lamps: NDArray[np.float64]
    """(L, 7): x, y, z, power; 0 for a lamp that shines down, 1 for a beam; direction of the beam x, y."""


LAMP_RGB: Final = (1.0, 0.80, 0.52)
LAMP_REACH_M: Final = 30.0
LIT_WITHIN_M: Final = 140.0
"""Lamps light what is nearer to the camera than this."""
BEAM_EXPONENT: Final = 40.0
FADE_TEXELS: Final = 64.0
"""Shadows fade out towards the border of their map."""
TURNS: Final = 16
"""Turned patterns of samples, one of them for each pixel: banding becomes fine noise."""
SUN_TAPS, ABOVE_TAPS = 5, 6


def _patterns() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Offsets (16, taps, 2) in texels of the samples about a spot in the two maps."""
    turn = (np.arange(TURNS) + 0.5) / TURNS
    sun, above = np.zeros((TURNS, SUN_TAPS, 2)), np.zeros((TURNS, ABOVE_TAPS, 2))
    for k in range(1, SUN_TAPS):
        angle = (k + turn) * np.pi / 2
        sun[:, k] = np.column_stack([np.cos(angle), np.sin(angle)]) * (1.1 + 0.5 * turn)[:, None]
    for k in range(ABOVE_TAPS):
        angle = (k + turn) * np.pi / 3
        above[:, k] = np.column_stack([np.cos(angle), np.sin(angle)]) * (1.0 + 2.2 * (k % 3) + turn)[:, None]
    return sun, above


_SUN_PATTERN, _ABOVE_PATTERN = _patterns()


@part
def sunlit(towards_sun: Any, point: Any, bias_m: Any, jitter: Any) -> Any:
    """Share of the sun that reaches a spot (Reeves, Salesin and Cook, "Rendering antialiased shadows with depth
    maps", 1987)."""
    rows, columns = towards_sun.height.shape
    x, y, height = transformed(towards_sun.T_texel_map, point[0], point[1], point[2])
    inner = min(min(x, columns - x), min(y, rows - y)) - 4.0
    if inner <= 0.0:
        return 1.0
    open_taps, turn = 0, int(jitter * TURNS) & (TURNS - 1)
    for k in range(SUN_TAPS):
        i, j = int(x + _SUN_PATTERN[turn, k, 0]), int(y + _SUN_PATTERN[turn, k, 1])
        if towards_sun.height[j, i] <= height + bias_m:
            open_taps += 1
    share = open_taps / SUN_TAPS
    return 1.0 - (1.0 - share) * min(1.0, inner / FADE_TEXELS)


@part
def open_sky(from_above: Any, point: Any, jitter: Any) -> Any:
    """Share of the sky's light that reaches a spot that looks up, by what stands higher around it."""
    rows, columns = from_above.height.shape
    x, y, _ = transformed(from_above.T_texel_map, point[0], point[1], point[2])
    inner = min(min(x, columns - x), min(y, rows - y)) - 13.0
    if inner <= 0.0:
        return 1.0
    hidden, turn = 0.0, int(jitter * TURNS) & (TURNS - 1)
    for k in range(ABOVE_TAPS):
        i, j = int(x + _ABOVE_PATTERN[turn, k, 0]), int(y + _ABOVE_PATTERN[turn, k, 1])
        above = from_above.height[j, i] - point[2]
        if above > 0.06:
            hidden += 1.0 / (1.0 + above * above * 0.22)
    return 1.0 - 0.88 * hidden / ABOVE_TAPS * min(1.0, inner / FADE_TEXELS)


@part
def lamplight(lamps: Any, point: Any, normal: Any, translucency: Any) -> Any:
    """Irradiance from the lamps about a spot, before their colour."""
    total = 0.0
    for k in range(lamps.shape[0]):
        if abs(lamps[k, 0] - point[0]) > LAMP_REACH_M or abs(lamps[k, 1] - point[1]) > LAMP_REACH_M:
            continue
        to_lamp = minus((lamps[k, 0], lamps[k, 1], lamps[k, 2]), point)
        squared = dot(to_lamp, to_lamp)
        if squared > LAMP_REACH_M * LAMP_REACH_M or squared < 0.02:
            continue
        inverse = 1.0 / math.sqrt(squared)
        if lamps[k, 4] < 0.5:
            out = to_lamp[2] * inverse
            strength = out * out
        else:
            out = -(to_lamp[0] * lamps[k, 5] + to_lamp[1] * lamps[k, 6]) * inverse
            strength = math.pow(max(out, 0.0), BEAM_EXPONENT)
        facing = dot(normal, to_lamp) * inverse
        if translucency > 0:
            facing = 0.4 + 0.6 * abs(facing)
        if out > 0.0 and facing > 0.0:
            total += strength * lamps[k, 3] * facing / (squared + 1.0)
    return total


@inlined
def sunlight_on(lighting: Any, direction: Any, normal: Any, translucency: Any) -> Any:
    """How much of the sun's irradiance a face takes, were it not in shadow; leaves also take it from behind."""
    facing = dot(normal, lighting.sun_direction)
    if translucency <= 0:
        return max(0.0, facing)
    through = max(0.0, dot(direction, lighting.sun_direction))
    front = 0.25 + 0.75 * max(0.0, facing) if facing > -0.2 else 0.12
    return front + translucency * through * through * 0.9


@inlined
def skylight_on(lighting: Any, normal: Any) -> Any:
    """Irradiance from sky and ground, by how far a face looks up."""
    return mixed(lighting.ground_rgb, lighting.sky_rgb, 0.5 + 0.5 * normal[2])


@part
def schlick(specular: Any, gloss: Any, direction: Any, normal: Any) -> Any:
    """Reflectance of a coat by the angle of view (Schlick, "An inexpensive BRDF model", 1994)."""
    grazing = 1.0 - min(1.0, abs(dot(direction, normal)))
    fresnel = specular + (1.0 - specular) * grazing**5
    return fresnel * gloss * 1.2 if gloss < 0.5 else fresnel


@inlined
def mirrored_sky(lighting: Any, sky: Any, reflected: Any) -> Any:
    """What a coat mirrors in a direction: the sky, darker near the horizon where things stand, or the ground."""
    if reflected[2] <= 0.0:
        return scaled(lighting.ground_rgb, 0.35)
    x, y, z = reflected
    seen = sky_at(sky, (x, y, max(z, 0.02)))
    return scaled(seen, 0.35 + 0.65 * smooth_step(0.0, 0.22, z))


@inlined
def sun_highlight(lighting: Any, reflected: Any, specular: Any, gloss: Any) -> Any:
    """The sun's own mirror image, blurred by a coat's roughness (Blinn and Phong)."""
    towards = dot(reflected, lighting.sun_direction)
    if towards <= 0.0:
        return 0.0
    power = 20.0 + gloss * gloss * 500.0
    return min(specular * (power + 8) * 0.04 * math.pow(towards, power), 6.0)


@inlined
def sky_and_sun(lighting: Any, sky: Any, direction: Any) -> Any:
    """Radiance of the sky with the sun's disc and the glow about it."""
    red, green, blue = sky_at(sky, direction)
    towards = dot(direction, lighting.sun_direction)
    if towards <= 0.9 or lighting.glare <= 0.0:
        return red, green, blue
    glow = lighting.glare * (math.pow(towards, 64.0) * 0.25 + math.pow(towards, 900.0) * 2.0)
    if towards > 0.99996:
        glow += lighting.glare * 30.0
    sun = lighting.sun_rgb
    return red + glow * sun[0], green + glow * sun[1], blue + glow * sun[2]


@inlined
def through_haze(lighting: Any, colour: Any, distance_m: Any) -> Any:
    """A colour seen through the air (Koschmieder's law)."""
    return mixed(colour, lighting.fog_rgb, 1.0 - math.exp(-distance_m * lighting.fog_per_m))
