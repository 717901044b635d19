"""What is drawn on the map, as plain points: rings, ellipses, road edges, the camera's view, surfaces."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.camera import Camera
from scpf.models.instances import BoolMask
from scpf.replay.step import Surface

Array = NDArray[np.float64]
Points = NDArray[np.float32]

LOG_PROBABILITY_FLOOR: Final = -20.0
VIOLATION_SPAN_M: Final = 15.0


def on_ground(points_m: Array, height_m: float = 0.0) -> Points:
    """Points (N, 3), float32, of horizontal positions (N, 2)."""
    flat = np.asarray(points_m, dtype=np.float32).reshape(-1, np.shape(points_m)[-1])[:, :2]
    return np.column_stack([flat, np.full(len(flat), height_m, dtype=np.float32)])


def ring(centre_m: Array, radius_m: float, off_m: float = 0.05) -> Points:
    """A closed circle (K, 3) of straight pieces that are nowhere further than ``off_m`` from it."""
    half_step = np.arccos(1.0 - min(off_m / max(radius_m, off_m), 1.0))
    count = max(24, int(np.ceil(np.pi / half_step))) + 1
    angle = np.linspace(0.0, 2.0 * np.pi, count)
    return on_ground(centre_m + radius_m * np.column_stack([np.cos(angle), np.sin(angle)]))


def ellipse(mean_m: Array, covariance_m2: Array, sigmas: float = 2.0) -> Points:
    """The closed ellipse (25, 3) at ``sigmas`` standard deviations of a horizontal position."""
    values, vectors = np.linalg.eigh(covariance_m2[:2, :2])
    axes = vectors * np.sqrt(np.maximum(values, 0.0)) * sigmas
    angle = np.linspace(0.0, 2.0 * np.pi, 25)
    return on_ground(mean_m[:2] + np.column_stack([np.cos(angle), np.sin(angle)]) @ axes.T)


def road_lines(centre_line_m: Array, half_width_m: float) -> list[Points]:
    """The road's left edge, centre line and right edge (M, 3) each; none without a centre line."""
    if len(centre_line_m) < 2:
        return []
    along = np.gradient(centre_line_m, axis=0)
    if np.allclose(centre_line_m[0], centre_line_m[-1]):
        along[0] = along[-1] = centre_line_m[1] - centre_line_m[-2]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    left = np.column_stack([-along[:, 1], along[:, 0]]) * half_width_m
    return [on_ground(centre_line_m + side * left) for side in (1.0, 0.0, -1.0)]


def view_wedge(camera: Camera, position_m: Array, heading: Array, length_m: float = 12.0) -> Points:
    """The sides of the camera's horizontal view (3, 3), the body at ``position_m`` facing ``heading`` (2,)."""
    middle = camera.height_px / 2.0
    edges = camera.bearings(np.array([[0.0, middle], [camera.width_px - 1.0, middle]]))
    yaw = np.arctan2(heading[1], heading[0])
    sides = position_m + length_m * np.column_stack([np.cos(yaw + edges), np.sin(yaw + edges)])
    return on_ground(np.array([sides[0], position_m, sides[1]]))


def relative_log_probability(surface: Surface) -> tuple[Points, float]:
    """Log-probability (R, C) relative to its maximum, from −20 to 0, and that maximum.

    The viewer colours by smallest and largest value: an unbounded tail would leave the rest one colour.
    """
    values = surface.log_probability
    finite = np.isfinite(values)
    peak = float(values[finite].max()) if finite.any() else LOG_PROBABILITY_FLOOR
    relative = np.where(finite, np.where(finite, values, 0.0) - peak, LOG_PROBABILITY_FLOOR)
    return np.clip(relative, LOG_PROBABILITY_FLOOR, 0.0).astype(np.float32), peak


def relative_violation(surface: Surface) -> tuple[Points, float]:
    """Sum of violations (R, C) above its minimum, up to 15 m, and that minimum.

    The viewer colours values that all lie between 0 and 255 on that scale: the lowest are put a millimetre
    below zero, which makes it colour from smallest to largest.
    """
    values = surface.violation
    finite = np.isfinite(values)
    lowest = float(values[finite].min()) if finite.any() else 0.0
    relative = np.where(finite, np.where(finite, values, 0.0) - lowest, VIOLATION_SPAN_M)
    return np.clip(np.where(relative <= 0.0, -1e-3, relative), None, VIOLATION_SPAN_M).astype(
        np.float32
    ), lowest


def cell_centre(surface: Surface, best: BoolMask) -> Points:
    """Centre (1, 3) in map of the one cell set in ``best`` (R, C); (0, 3) where several are as good."""
    cells = np.argwhere(best)
    if len(cells) != 1:
        return np.zeros((0, 3), dtype=np.float32)
    return on_ground(np.asarray(surface.corner_m) + surface.cell_m * cells[:, ::-1])
