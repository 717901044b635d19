"""The sky as a panorama: gradient, clouds, and a line of far trees at the horizon."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from scpf.sample_logs.shading_textures import LOWEST_SKY_RAD
from scpf.sample_logs.textures import tile_noise
from scpf.sample_logs.weather import Weather

Floats = NDArray[np.float64]
ELEVATIONS, AZIMUTHS = 384, 1536
CLOUD_TILE, CLOUD_TILE_PER_HEIGHT = 1024, 150.0
TREE_GREEN = (0.065, 0.089, 0.065)
TREE_LINE_RAD, TREE_EDGE_RAD = 0.012, 0.0016


def sky_panorama(weather: Weather, seed: int) -> NDArray[np.float32]:
    """Radiance (elevations, azimuths, 3): columns go round from the map's x axis, rows lie quadratically closer
    at the horizon, from LOWEST_SKY_RAD to the zenith."""
    rng = np.random.default_rng([seed, 11])
    rows = np.linspace(0, 1, ELEVATIONS) ** 2 * (np.pi / 2 - LOWEST_SKY_RAD) + LOWEST_SKY_RAD
    elevation, azimuth = np.meshgrid(rows, np.linspace(0, 2 * np.pi, AZIMUTHS, endpoint=False), indexing="ij")
    direction = np.stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ],
        axis=-1,
    )
    towards_sun = np.clip(direction @ weather.sun_direction, 0, 1)[..., None]
    noise = _cloud_noise(direction, rng)
    if weather.cloud_cover >= 1:
        sky = _overcast(weather, direction[..., 2], noise)
    else:
        sky = _clear(weather, direction[..., 2], towards_sun)
        cover, colour = _clouds(weather, elevation, noise, towards_sun)
        sky = sky * (1 - cover) + colour * cover
    return np.ascontiguousarray(_with_tree_line(sky, weather, elevation, azimuth, rng), np.float32)


def ambient_light(weather: Weather, panorama: NDArray[np.float32]) -> tuple[Floats, Floats]:
    """Irradiance (3,) of faces that look up, from the sky, and of those that look down, from the ground."""
    high = panorama[ELEVATIONS * 2 // 5 :].reshape(-1, 3).mean(axis=0, dtype=np.float64)
    sky = weather.ambient * (0.55 * high + 0.45 * np.array(weather.horizon_rgb)) * 0.95
    sun = np.array(weather.sun_rgb) * max(0.0, float(weather.sun_direction[2]))
    return sky, 0.20 * (sun + sky) * np.array([1.0, 0.97, 0.80])


def _clear(weather: Weather, up: Floats, towards_sun: Floats) -> Floats:
    low = (1 - np.clip(up, 0, 1))[..., None] ** 3.2
    sky = np.array(weather.zenith_rgb) * (1 - low) + np.array(weather.horizon_rgb) * low
    halo = 1 + 0.55 * towards_sun**6 * (weather.glare > 0)
    return np.asarray(sky * halo + np.array(weather.sun_rgb) * 0.05 * towards_sun**3)


def _overcast(weather: Weather, up: Floats, noise: Floats) -> Floats:
    """A closed cover, darker in places and towards the zenith than at the horizon."""
    depth = 0.72 + 0.28 * (1 - np.clip(up, 0, 1)[..., None] ** 0.7)
    return np.asarray(np.array(weather.horizon_rgb) * (0.80 + 0.13 * noise[..., None]) * depth * 1.05)


def _cloud_noise(direction: Floats, rng: np.random.Generator) -> Floats:
    """Noise (elevations, azimuths) as it lies on a flat layer overhead."""
    coarse = tile_noise(rng, CLOUD_TILE, 1.45, lowest=2).astype(np.float32)
    fine = tile_noise(rng, CLOUD_TILE, 1.0, lowest=8).astype(np.float32)
    away = CLOUD_TILE_PER_HEIGHT / (np.maximum(direction[..., 2], 0.02) + 0.06)
    x = (direction[..., 0] * away).astype(np.float32) % CLOUD_TILE
    y = (direction[..., 1] * away).astype(np.float32) % CLOUD_TILE
    layers = [cv2.remap(tile, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP) for tile in (coarse, fine)]
    return np.asarray(layers[0] + 0.28 * layers[1], np.float64)


def _clouds(weather: Weather, elevation: Floats, noise: Floats, towards_sun: Floats) -> tuple[Floats, Floats]:
    """Cover (..., 1) and colour (..., 3): thick parts are darker, and bright about the sun."""
    threshold = 1.9 - 2.9 * weather.cloud_cover
    cover = np.clip((noise - threshold) / 1.1, 0, 1)[..., None]
    cover = cover * cover * (3 - 2 * cover) * np.clip(elevation / 0.10, 0, 1)[..., None]
    shade = np.clip(1 - 0.42 * np.clip((noise - threshold - 0.6) / 1.6, 0, 1), 0.4, 1)[..., None]
    colour = weather.cloud_brightness * np.array([1.0, 0.985, 0.97]) * shade * (0.72 + 0.5 * towards_sun**2)
    if weather.sun_elevation_rad < 0.26:
        colour = colour * np.array([1.08, 0.92, 0.80])
    return cover, colour


def _with_tree_line(
    sky: Floats, weather: Weather, elevation: Floats, azimuth: Floats, rng: np.random.Generator
) -> Floats:
    around = azimuth[0]
    hills = rng.uniform(0, 1, 95)
    crowns = np.abs(rng.normal(0, 1, 699))
    height = TREE_LINE_RAD + 0.016 * _closed_line(around, hills) + 0.004 * _closed_line(around, crowns)
    is_tree = np.clip((height - elevation) / TREE_EDGE_RAD, 0, 1)[..., None]
    horizon = np.array(weather.horizon_rgb)
    trees = np.array(TREE_GREEN) * horizon.mean() + horizon * 0.33
    return np.asarray(sky * (1 - is_tree) + trees * is_tree)


def _closed_line(around: Floats, values: Floats) -> Floats:
    """Values spread evenly round the horizon, joined by straight lines."""
    ticks = np.linspace(0, 2 * np.pi, len(values) + 1)
    return np.asarray(np.interp(around, ticks, np.append(values, values[0])))
