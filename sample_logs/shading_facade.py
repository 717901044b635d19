"""Walls of buildings: brick, concrete or panels, with a window in each bay of each floor."""

from __future__ import annotations

import math
from typing import Any

from scpf.sample_logs.kernels import band, hashed, inlined, mirrored, mixed, part, scaled
from scpf.sample_logs.shading_surface import BLACK, surface
from scpf.sample_logs.shading_textures import LARGE_PATCHES, PATCHES, noise_at, sky_at

BRICK, PANEL = 0, 2
BRICK_M, COURSE_M, MORTAR_M = 0.21, 0.075, 0.012
MORTAR, BAND, FRAME, BLIND = (0.40, 0.37, 0.33), (0.42, 0.40, 0.37), (0.12, 0.12, 0.12), (0.35, 0.35, 0.33)
LAMPLIGHT = (0.60, 0.47, 0.27)
LIT_SHARE = 0.33
FRAME_M = 0.06


@part
def _brick(spot: Any, tint: Any, shade: Any) -> Any:
    """Bricks in running bond."""
    footprint = spot.footprint_m
    if footprint >= 0.06:
        return scaled(tint, shade)
    row = math.floor(spot.v / COURSE_M)
    along = spot.u + 0.1 * (row & 1)
    column = math.floor(along / BRICK_M)
    mortar = max(
        band(spot.v - row * COURSE_M, 0.0, MORTAR_M, footprint),
        band(along - column * BRICK_M, 0.0, MORTAR_M, footprint),
    )
    return mixed(scaled(tint, shade * (0.86 + 0.28 * hashed(column, row))), MORTAR, mortar)


@part
def _wall(noise: Any, spot: Any, style: Any, floor_m: Any, in_bay: Any, in_floor: Any) -> Any:
    """The wall between the windows."""
    u, v, footprint = spot.u, spot.v, spot.footprint_m
    patches = noise_at(noise, PATCHES, u * 0.09, v * 0.09, footprint * 0.09)
    large = noise_at(noise, LARGE_PATCHES, u * 0.02, v * 0.02, footprint * 0.02)
    shade = 1 + 0.10 * patches + 0.10 * large
    if style == BRICK:
        between_floors = band(in_floor, floor_m - 0.35, floor_m, footprint)
        return mixed(_brick(spot, spot.tint, shade), BAND, between_floors)
    joint = max(band(in_bay, 0.0, 0.03, footprint), band(in_floor, 0.0, 0.03, footprint))
    return scaled(spot.tint, shade * (1 - 0.35 * joint - 0.07 * max(0.0, large)))


@part
def _pane(panorama: Any, direction: Any, normal: Any, cosine: Any, bay: Any, floor: Any, lit: Any) -> Any:
    """Light from a pane: the sky it mirrors, each pane a little out of true, and the lamp behind."""
    x, y, z = mirrored(direction, normal)
    x, z = x + (hashed(bay, floor) - 0.5) * 0.03, z + (hashed(floor, bay) - 0.5) * 0.02
    sky = sky_at(panorama, (x, y, max(z, 0.03)))
    grazing = (1 - cosine) * (1 - cosine)
    mirror = 0.10 + 0.9 * grazing * grazing
    return (
        sky[0] * mirror + LAMPLIGHT[0] * lit,
        sky[1] * mirror + LAMPLIGHT[1] * lit,
        sky[2] * mirror + LAMPLIGHT[2] * lit,
    )


@inlined
def facade(
    images: Any, spot: Any, direction: Any, normal: Any, cosine: Any, parameters: Any, lamp_power: Any
) -> Any:
    """The surface of a wall; ``parameters`` are style, height of a floor, width of a bay (m), the share of it
    that is glass, height of the building (m), and a number that tells buildings apart."""
    style, floor_m, bay_m = int(parameters[0]), parameters[1], parameters[2]
    glass, height_m, variety = parameters[3], parameters[4], int(parameters[5] * 100)
    u, v, footprint = spot.u, spot.v, spot.footprint_m
    floor, bay = math.floor(v / floor_m), math.floor(u / bay_m)
    in_bay, in_floor = u - bay * bay_m, v - floor * floor_m
    colour = _wall(images.noise, spot, style, floor_m, in_bay, in_floor)
    sill, lintel = (0.25, floor_m - 0.25) if style == PANEL else (0.9, floor_m - 0.55)
    left, right = bay_m * (0.5 - glass * 0.5), bay_m * (0.5 + glass * 0.5)
    window = band(in_bay, left, right, footprint) * band(in_floor, sill, lintel, footprint)
    if window <= 0.0 or v > height_m - 0.8 or v < 0.0:
        return surface(colour, BLACK, 0.0, 0.0, 0.0)
    middle = (left + right) / 2
    sides = max(
        band(in_bay, left, left + FRAME_M, footprint), band(in_bay, right - FRAME_M, right, footprint)
    )
    bars = max(
        band(in_floor, sill, sill + FRAME_M, footprint),
        band(in_bay, middle - FRAME_M / 2, middle + FRAME_M / 2, footprint),
    )
    frame = max(sides, bars)
    chance = hashed(bay * 7 + variety, floor * 13 + 1)
    room = 0.018 + 0.05 * chance * chance
    blind = 0.0
    if chance > 0.6:
        blind = band(in_floor, lintel - (chance - 0.5) * 2 * (lintel - sill), lintel, footprint)
    is_lit = lamp_power > 0.2 and hashed(bay + 91 + variety, floor) < LIT_SHARE
    inside = mixed(mixed((room, room, room), BLIND, blind), FRAME, frame)
    light = _pane(images.sky, direction, normal, cosine, bay, floor, lamp_power if is_lit else 0.0)
    return surface(mixed(colour, inside, window), scaled(light, window * (1 - frame)), 0.0, 0.0, 0.0)
