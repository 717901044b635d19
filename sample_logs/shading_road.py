"""The road: asphalt with worn tracks, patches, cracks and covers, painted lines, and puddles.

Coordinates of the road's faces: u metres along the centre line, v metres to its left.
"""

from __future__ import annotations

import math
from typing import Any

from scpf.sample_logs.kernels import band, clamp, hashed, mixed, part, remainder, scaled, smooth_step
from scpf.sample_logs.shading_surface import coated, grey
from scpf.sample_logs.shading_textures import GRAIN, LARGE_PATCHES, PATCHES, noise_at, plane_noise

LANE_MIDDLE_M, TRACK_M = 1.85, 0.78
"""Middle of a lane from the centre line, and of a wheel's track from the lane's middle."""
EDGE_LINE_M = (3.28, 3.40)
YELLOW, WHITE = (0.62, 0.43, 0.07), (0.66, 0.66, 0.63)
STRETCH_M = 140.0
"""Over each of these lengths the centre is marked alike: a double line, or dashes."""
DASH_M, DASH_PERIOD_M = 3.0, 9.0
ZEBRA_M, STRIPE_M, STRIPE_PERIOD_M = 3.2, 0.55, 1.1
PATCH_PERIOD_M, COVER_PERIOD_M = 23.0, 61.0


@part
def _from_track_m(v: Any) -> tuple[float, float]:
    """Distance from the lane's middle, and from the nearest wheel track."""
    from_middle = abs(abs(v) - LANE_MIDDLE_M)
    return from_middle, abs(from_middle - TRACK_M)


@part
def _patched(u: Any, v: Any, footprint: Any) -> Any:
    """Share of a spot that was mended with newer, darker asphalt."""
    k = math.floor(u / PATCH_PERIOD_M)
    chance = hashed(k, 77)
    if chance <= 0.55:
        return 0.0
    along, start = u - k * PATCH_PERIOD_M, 2 + chance * 8
    length = 1.5 + 8 * hashed(k, 3)
    right, width = -3.2 + 6 * hashed(k, 5), 0.9 + 1.6 * hashed(k, 9)
    return band(along, start, start + length, footprint) * band(v, right, right + width, footprint)


@part
def _cracked(noise: Any, spot: Any, patches: Any) -> Any:
    """Darkness of cracks: level lines of noise, where another noise says that the road is old."""
    x, y, footprint = spot.point[0], spot.point[1], spot.footprint_m
    age = noise_at(noise, LARGE_PATCHES, x * 0.011, y * 0.011 + 0.5, footprint * 0.011)
    if age <= 0.0:
        return 0.0
    field = noise_at(noise, LARGE_PATCHES, x * 0.05 + 0.3, y * 0.05, footprint * 0.05) + 0.25 * patches
    away = abs(field - 0.15) * 16.0
    thin = min(1.0, 0.03 / (footprint + 0.012))
    return 0.6 * max(0.0, 1 - away / (0.10 + footprint * 1.2)) * min(1.0, age * 2) * thin


@part
def _centre_line(u: Any, v: Any, footprint: Any) -> Any:
    """Share of a spot under the yellow lines between the lanes."""
    if hashed(math.floor(u / STRETCH_M), 11) < 0.5:
        return band(v, -0.17, -0.06, footprint) + band(v, 0.06, 0.17, footprint)
    dash = band(remainder(u, DASH_PERIOD_M), 0.0, DASH_M, footprint)
    return band(v, -0.06, 0.06, footprint) * dash


@part
def _markings(u: Any, v: Any, footprint: Any, crossing_period: Any, crossing_start: Any) -> Any:
    """Shares of a spot under yellow and under white paint."""
    yellow = _centre_line(u, v, footprint)
    white = band(abs(v), EDGE_LINE_M[0], EDGE_LINE_M[1], footprint)
    after = remainder(u, crossing_period) - crossing_start
    if -3.0 < after < 7.0:
        on_zebra = band(after, 0.0, ZEBRA_M, footprint)
        stripe = band(remainder(v + 3.3, STRIPE_PERIOD_M), 0.0, STRIPE_M, footprint)
        if footprint > 0.6:
            stripe = 0.5
        if abs(v) > 3.3:
            stripe = 0.0
        white = max(white * (1 - on_zebra), on_zebra * stripe)
        yellow *= 1 - on_zebra
        if -3.2 < v < -0.25:
            white = max(white, band(after, -1.9, -1.5, footprint))
    return yellow, white


@part
def _cover_distance(u: Any, v: Any) -> Any:
    """Distance to the middle of the nearest manhole cover."""
    k = math.floor(u / COVER_PERIOD_M)
    across = -1.9 if hashed(k, 4) < 0.5 else 1.4
    return math.hypot(u - k * COVER_PERIOD_M - 20 - 30 * hashed(k, 2), v - across)


@part
def _puddle(large: Any, patches: Any, from_middle: Any, from_track: Any) -> Any:
    """Share of a spot of the wet road under standing water: hollows, and rather in the wheel tracks."""
    tracks = 0.35 / (1 + from_track * from_track * 14) - 0.25 / (1 + from_middle * from_middle * 4)
    return smooth_step(0.45, 1.25, large + 0.25 * patches + tracks)


@part
def road(noise: Any, spot: Any, crossing_period: Any, crossing_start: Any, wetness: Any) -> Any:
    """The surface of the carriageway."""
    u, v, footprint = spot.u, spot.v, spot.footprint_m
    grain = plane_noise(noise, GRAIN, spot.point, 0.9, footprint)
    patches = plane_noise(noise, PATCHES, spot.point, 0.11, footprint)
    large = plane_noise(noise, LARGE_PATCHES, spot.point, 0.023, footprint)
    from_middle, from_track = _from_track_m(v)
    value = 0.098 * (1 + 0.22 * grain + 0.055 * patches + 0.09 * large)
    # Tyres polish the tracks brighter; oil darkens the middle of the lane.
    value *= 1 + 0.10 / (1 + from_track * from_track * 22) - 0.12 / (1 + from_middle * from_middle * 16)
    value *= 1 - 0.33 * _patched(u, v, footprint)
    value *= 1 - _cracked(noise, spot, patches)
    colour = grey(value, 1.01, 0.985)
    from_cover = _cover_distance(u, v)
    if from_cover < 0.45:
        colour = grey(0.06 if from_cover < 0.34 else 0.11, 1.03, 0.96)
    wear = clamp(0.80 + 0.25 * patches + 0.35 * grain, 0.35, 1.0)
    yellow, white = _markings(u, v, footprint, crossing_period, crossing_start)
    colour = mixed(mixed(colour, YELLOW, yellow * wear), WHITE, white * wear)
    if wetness <= 0.0:
        return coated(colour, 0.03, 0.0)
    puddle = _puddle(large, patches, from_middle, from_track) * wetness
    return coated(scaled(colour, 1 - 0.5 * wetness), 0.02 + 0.03 * puddle, 0.35 * wetness + 0.6 * puddle)
