"""The six weathers: light, sky, haze and water. Radiances are linear, red, green and blue, 1 about a lit white wall."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

Rgb = tuple[float, float, float]

RANDOM: Final = "random"
"""A name for any of them, with another sun and haze."""


@dataclass(frozen=True)
class Weather:
    """Light and air of one moment of a day."""

    name: str
    sun_elevation_rad: float
    sun_azimuth_rad: float
    """Counter-clockwise from the map's x axis."""
    sun_rgb: Rgb
    """Irradiance of a face that looks at the sun; 0 where clouds hide it."""
    zenith_rgb: Rgb
    horizon_rgb: Rgb
    cloud_cover: float
    """0 clear, 1 overcast."""
    cloud_brightness: float
    ambient: float
    """Factor on the light that the sky gives to faces."""
    fog_per_m: float
    """Extinction (Koschmieder's law)."""
    wetness: float
    lamp_power: float
    """Of street lamps and windows, 0 off; above 0.2 they light the scene."""
    glare: float
    """Strength of the halo about the sun, and of light that the lens scatters."""
    exposure: float
    """Brightness that the automatic exposure aims at, relative to a clear day."""
    gain: float
    """Sensor gain; noise grows with it."""
    leaf_litter: float = 0.0
    """Share of the lawns under fallen leaves."""
    dryness: float = 0.0
    """0 green lawns, 1 withered ones."""

    @property
    def casts_shadows(self) -> bool:
        """Whether direct sunlight reaches the ground."""
        return max(self.sun_rgb) > 0.5

    @property
    def lamps_are_lit(self) -> bool:
        """Whether street lamps and headlights light the scene."""
        return self.lamp_power > 0.2

    @property
    def sun_direction(self) -> NDArray[np.float64]:
        """Unit vector (3,) in map towards the sun."""
        across = np.cos(self.sun_elevation_rad)
        azimuth = self.sun_azimuth_rad
        return np.array([across * np.cos(azimuth), across * np.sin(azimuth), np.sin(self.sun_elevation_rad)])


WEATHERS: Final = {
    weather.name: weather
    for weather in (
        Weather(
            "clear",
            sun_elevation_rad=math.radians(44),
            sun_azimuth_rad=2.3,
            sun_rgb=(3.3, 3.05, 2.6),
            zenith_rgb=(0.20, 0.38, 0.85),
            horizon_rgb=(0.78, 0.92, 1.10),
            cloud_cover=0.10,
            cloud_brightness=1.9,
            ambient=1.0,
            fog_per_m=0.0011,
            wetness=0.0,
            lamp_power=0.0,
            glare=1.0,
            exposure=1.0,
            gain=1.0,
        ),
        Weather(
            "cloudy",
            sun_elevation_rad=math.radians(38),
            sun_azimuth_rad=-0.6,
            sun_rgb=(2.5, 2.35, 2.1),
            zenith_rgb=(0.24, 0.38, 0.72),
            horizon_rgb=(0.80, 0.90, 1.0),
            cloud_cover=0.55,
            cloud_brightness=1.7,
            ambient=1.1,
            fog_per_m=0.0014,
            wetness=0.0,
            lamp_power=0.0,
            glare=0.6,
            exposure=1.0,
            gain=1.0,
        ),
        Weather(
            "overcast",
            sun_elevation_rad=math.radians(50),
            sun_azimuth_rad=1.0,
            sun_rgb=(0.0, 0.0, 0.0),
            zenith_rgb=(0.62, 0.66, 0.72),
            horizon_rgb=(0.80, 0.82, 0.85),
            cloud_cover=1.0,
            cloud_brightness=1.0,
            ambient=1.5,
            fog_per_m=0.0026,
            wetness=0.0,
            lamp_power=0.0,
            glare=0.0,
            exposure=1.0,
            gain=1.0,
        ),
        Weather(
            "rain",
            sun_elevation_rad=math.radians(50),
            sun_azimuth_rad=1.0,
            sun_rgb=(0.0, 0.0, 0.0),
            zenith_rgb=(0.36, 0.39, 0.43),
            horizon_rgb=(0.50, 0.53, 0.56),
            cloud_cover=1.0,
            cloud_brightness=0.62,
            ambient=1.25,
            fog_per_m=0.0068,
            wetness=1.0,
            lamp_power=0.25,
            glare=0.0,
            exposure=1.05,
            gain=1.0,
        ),
        Weather(
            "lowsun",
            sun_elevation_rad=math.radians(11),
            sun_azimuth_rad=0.9,
            sun_rgb=(3.4, 2.35, 1.25),
            zenith_rgb=(0.25, 0.36, 0.66),
            horizon_rgb=(1.15, 0.92, 0.66),
            cloud_cover=0.30,
            cloud_brightness=1.5,
            ambient=0.62,
            fog_per_m=0.0024,
            wetness=0.0,
            lamp_power=0.0,
            glare=1.6,
            exposure=0.92,
            gain=1.0,
        ),
        Weather(
            "dusk",
            sun_elevation_rad=math.radians(3),
            sun_azimuth_rad=0.5,
            sun_rgb=(0.10, 0.06, 0.04),
            zenith_rgb=(0.055, 0.085, 0.19),
            horizon_rgb=(0.30, 0.24, 0.24),
            cloud_cover=0.45,
            cloud_brightness=0.20,
            ambient=0.85,
            fog_per_m=0.0022,
            wetness=0.0,
            lamp_power=1.0,
            glare=0.0,
            exposure=0.80,
            gain=3.2,
        ),
    )
}


def drawn_weather(rng: np.random.Generator) -> Weather:
    """One of the weathers, with the sun somewhere else, other haze, and lawns as at any time of the year."""
    weather = WEATHERS[str(rng.choice(list(WEATHERS)))]
    return replace(
        weather,
        sun_azimuth_rad=float(rng.uniform(-np.pi, np.pi)),
        sun_elevation_rad=weather.sun_elevation_rad * float(rng.uniform(0.7, 1.25)),
        fog_per_m=weather.fog_per_m * float(rng.uniform(0.6, 1.5)),
        leaf_litter=float(rng.uniform(0.0, 0.8)) if rng.uniform() < 0.25 else 0.0,
        dryness=float(rng.uniform(0.0, 1.0)),
    )
