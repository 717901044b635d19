"""What the materials answer with, and what they are asked."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from scpf.sample_logs.kernels import part, scaled

BLACK = (0.0, 0.0, 0.0)


class Spot(NamedTuple):
    """The place on a face that is being shaded."""

    point: Any
    """(x, y, z) in map, metres."""
    height_m: Any
    """Above the road."""
    u: Any
    v: Any
    footprint_m: Any
    """Length on the face that a pixel covers."""
    tint: Any
    """Reflectance of the instance."""
    number: Any
    """Of the face, for variety among leaves."""


class Surface(NamedTuple):
    """How a face answers light at a spot."""

    reflectance: Any
    """Diffuse; red, green, blue."""
    emission: Any
    """Radiance of its own."""
    specular: Any
    """Reflectance of its coat, seen face on (Schlick's F0)."""
    gloss: Any
    """0 dull, 1 a mirror."""
    translucency: Any
    """Light that comes through from behind, for leaves."""


@part
def surface(reflectance: Any, emission: Any, specular: Any, gloss: Any, translucency: Any) -> Any:
    """A Surface of doubles, whatever the parts are: kernels need one type for all materials."""
    return Surface(
        (np.float64(reflectance[0]), np.float64(reflectance[1]), np.float64(reflectance[2])),
        (np.float64(emission[0]), np.float64(emission[1]), np.float64(emission[2])),
        np.float64(specular),
        np.float64(gloss),
        np.float64(translucency),
    )


@part
def matt(reflectance: Any) -> Any:
    """A surface that only scatters."""
    return surface(reflectance, BLACK, 0.0, 0.0, 0.0)


@part
def coated(reflectance: Any, specular: Any, gloss: Any) -> Any:
    """A surface that scatters under a coat that mirrors."""
    return surface(reflectance, BLACK, specular, gloss, 0.0)


@part
def glowing(reflectance: Any, emission: Any, gloss: Any) -> Any:
    """A lamp behind plastic."""
    return surface(reflectance, emission, 0.05, gloss, 0.0)


@part
def grey(value: Any, red: Any, blue: Any) -> Any:
    """A grey with the tinge that red and blue are relative to green."""
    return value * red, value, value * blue


@part
def wetted(reflectance: Any, darkening: Any, gloss: Any, wetness: Any) -> Any:
    """A porous surface: water darkens it and gives it a sheen."""
    if wetness <= 0.0:
        return matt(reflectance)
    return coated(scaled(reflectance, 1.0 - darkening * wetness), 0.03, gloss * wetness)
