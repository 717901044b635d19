"""Where the maps of shadows and of what stands overhead lie, and which instances a view can hold."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.sample_logs.lens import Lens
from scpf.sample_logs.scene import Scene

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

AHEAD_M: Final = 40.0
"""The middle of both maps, ahead of the camera."""
SUN_TEXELS, SUN_HALF_M = 2048, 56.0
ABOVE_TEXELS, ABOVE_HALF_M = 900, 54.0
DRAWN_WITHIN_M: Final = 420.0
SMALLEST_SAMPLES: Final = 1.5
"""An instance whose radius covers less of the buffer is not drawn."""


def middle_ahead(T_map_camera: Floats, ground_m: float) -> Floats:
    """The point (3,) on the ground that the maps are centred on."""
    forward = T_map_camera[:2, 2] / max(float(np.linalg.norm(T_map_camera[:2, 2])), 1e-9)
    flat = T_map_camera[:2, 3] + forward * AHEAD_M
    return np.array([flat[0], flat[1], ground_m])


def sun_map(sun_direction: Floats, middle: Floats) -> Floats:
    """T_texel_map (3, 4) of parallel rays towards the sun."""
    right = np.cross(sun_direction, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    scale = SUN_TEXELS / (2 * SUN_HALF_M)
    return _centred(
        np.stack([right * scale, np.cross(sun_direction, right) * scale, sun_direction]), middle, SUN_TEXELS
    )


def above_map(middle: Floats) -> Floats:
    """T_texel_map (3, 4) of vertical rays."""
    scale = ABOVE_TEXELS / (2 * ABOVE_HALF_M)
    rotation = np.diag([scale, scale, 1.0])
    centred = _centred(rotation, middle, ABOVE_TEXELS)
    centred[2, 3] = 0.0  # heights as they are in map
    return centred


def _centred(rotation: Floats, middle: Floats, texels: int) -> Floats:
    offset = np.array([texels / 2, texels / 2, 0.0]) - rotation @ middle
    return np.column_stack([rotation, offset])


def at_their_level(scene: Scene, eye: Floats) -> tuple[NDArray[np.bool_], Floats]:
    """Which instances (N,) show the level of detail for an eye (3,), and their distances (N,), m."""
    distance = np.linalg.norm(scene.instance_centre_m - eye, axis=1)
    return (distance >= scene.lod_range_m[:, 0]) & (distance < scene.lod_range_m[:, 1]), distance


def in_map(scene: Scene, chosen: NDArray[np.bool_], T_texel_map: Floats, texels: int) -> Indices:
    """The chosen instances that cast into a map; ground casts nothing."""
    scale = float(np.linalg.norm(T_texel_map[0, :3]))
    x, y = (scene.instance_centre_m @ T_texel_map[:2, :3].T + T_texel_map[:2, 3]).T
    reach = scene.instance_radius_m * scale
    inside = (x > -reach) & (x < texels + reach) & (y > -reach) & (y < texels + reach)
    return np.nonzero(chosen & ~scene.is_ground & inside)[0]


def in_view(
    scene: Scene, chosen: NDArray[np.bool_], distance_m: Floats, T_camera_map: Floats, lens: Lens
) -> Indices:
    """The chosen instances that the buffer can hold, nearest first."""
    x, y, z = (scene.instance_centre_m @ T_camera_map[:, :3].T + T_camera_map[:, 3]).T
    radius = scene.instance_radius_m
    left, right, top, bottom = lens.edges
    shown = chosen & (z + radius > lens.view.near_m)
    # Each side of the buffer is a plane through the eye; a sphere beyond it by its radius is out of view.
    for outwards in (left * z - x, x - right * z):
        shown &= outwards < radius * math.hypot(1.0, max(abs(left), abs(right)))
    for outwards in (top * z - y, y - bottom * z):
        shown &= outwards < radius * math.hypot(1.0, max(abs(top), abs(bottom)))
    shown &= (distance_m < DRAWN_WITHIN_M) | scene.is_ground
    shown &= radius * lens.view.focal / np.maximum(distance_m, 1.0) > SMALLEST_SAMPLES
    found = np.nonzero(shown)[0]
    order = np.argsort(distance_m[found] - radius[found] * 0.5, kind="stable")
    return found[order]
