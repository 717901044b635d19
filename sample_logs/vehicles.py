"""Bodies of cars and buses: cross sections along the length, skinned; +x forward, centred, on the ground."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scpf.sample_logs.materials import Material
from scpf.sample_logs.mesh import Floats, Mesh, MeshBuilder, strip_faces

COLOURS = (
    (0.60, 0.60, 0.62),
    (0.03, 0.03, 0.035),
    (0.25, 0.26, 0.28),
    (0.35, 0.02, 0.02),
    (0.03, 0.06, 0.22),
    (0.72, 0.72, 0.70),
    (0.10, 0.11, 0.12),
    (0.05, 0.14, 0.08),
    (0.30, 0.20, 0.10),
)


class Vehicle(IntEnum):
    """Kinds of vehicles, in the order of their prototypes."""

    SEDAN = 0
    HATCHBACK = 1
    VAN = 2
    PICKUP = 3
    BUS = 4


class _Shape(NamedTuple):
    length_m: float
    half_width_m: float
    sections: list[tuple[float, float, float, float]]
    """(x, sill, belt, roof), metres; the sill is not drawn, it keeps the profile readable."""


_SHAPES = {
    Vehicle.SEDAN: _Shape(
        4.6,
        0.91,
        [
            (-2.30, 0.62, 0.95, 0.95),
            (-2.20, 0.95, 1.00, 1.00),
            (-1.55, 1.00, 1.02, 1.05),
            (-0.95, 1.00, 1.00, 1.40),
            (-0.30, 0.98, 0.98, 1.46),
            (0.35, 0.96, 0.96, 1.42),
            (1.05, 0.93, 0.93, 1.00),
            (1.90, 0.88, 0.88, 0.90),
            (2.20, 0.72, 0.80, 0.82),
            (2.30, 0.50, 0.62, 0.64),
        ],
    ),
    Vehicle.HATCHBACK: _Shape(
        4.4,
        0.93,
        [
            (-2.20, 0.70, 1.05, 1.10),
            (-2.12, 1.00, 1.08, 1.42),
            (-1.50, 1.05, 1.06, 1.66),
            (-0.50, 1.03, 1.03, 1.70),
            (0.40, 1.00, 1.00, 1.64),
            (1.15, 0.98, 0.98, 1.08),
            (1.85, 0.94, 0.94, 0.98),
            (2.12, 0.80, 0.86, 0.88),
            (2.20, 0.55, 0.66, 0.68),
        ],
    ),
    Vehicle.VAN: _Shape(
        5.2,
        0.98,
        [
            (-2.60, 0.70, 1.10, 1.30),
            (-2.55, 1.15, 1.15, 2.05),
            (-1.00, 1.15, 1.15, 2.12),
            (0.60, 1.12, 1.12, 2.10),
            (1.30, 1.10, 1.10, 1.95),
            (2.00, 1.05, 1.05, 1.20),
            (2.50, 0.90, 0.95, 0.98),
            (2.60, 0.60, 0.70, 0.72),
        ],
    ),
    Vehicle.PICKUP: _Shape(
        5.4,
        0.97,
        [
            (-2.70, 0.75, 1.02, 1.03),
            (-2.60, 1.00, 1.04, 1.05),
            (-0.75, 1.04, 1.06, 1.08),
            (-0.60, 1.06, 1.08, 1.72),
            (0.20, 1.05, 1.06, 1.78),
            (0.75, 1.04, 1.05, 1.72),
            (1.35, 1.03, 1.03, 1.14),
            (2.30, 0.98, 0.98, 1.02),
            (2.60, 0.85, 0.90, 0.92),
            (2.70, 0.60, 0.70, 0.72),
        ],
    ),
    Vehicle.BUS: _Shape(
        11.8,
        1.27,
        [
            (-5.90, 0.80, 1.20, 2.90),
            (-5.80, 1.20, 1.25, 3.05),
            (0.00, 1.20, 1.25, 3.10),
            (5.60, 1.20, 1.20, 3.05),
            (5.85, 1.10, 1.10, 2.90),
            (5.90, 0.70, 1.00, 2.70),
        ],
    ),
}
_SIDES = 12


def vehicle(kind: Vehicle) -> Mesh:
    """The body, windows, wheels and lights of one kind of vehicle."""
    shape, is_bus = _SHAPES[kind], kind == Vehicle.BUS
    ends = (shape.sections[0][0] + 0.02, shape.sections[-1][0] - 0.02)
    x = np.unique(np.concatenate([[s[0] for s in shape.sections], np.linspace(*ends, 26)]))
    at = [section[0] for section in shape.sections]
    belt = np.interp(x, at, [section[2] for section in shape.sections])
    roof = np.maximum(np.interp(x, at, [section[3] for section in shape.sections]), belt + 0.01)
    rings = _rings(shape, x, belt, roof, is_bus)
    mesh = MeshBuilder()
    mesh.add(
        rings.reshape(-1, 3),
        strip_faces(len(x), _SIDES, closed=True)[:, ::-1],
        material=np.repeat(_skin(kind, x, belt, roof), 2),
        smooth=True,
    )
    _add_ends(mesh, rings, is_bus)
    _add_wheels(mesh, shape, is_bus)
    _add_lights(mesh, kind, shape, float(belt[2]), float(belt[len(x) // 2]))
    return mesh.build()


def _rings(shape: _Shape, x: Floats, belt: Floats, roof: Floats, is_bus: bool) -> Floats:
    """Cross sections (n, 12, 3), from the right sill over the roof to the left one."""
    from_end = np.clip(np.minimum(x - x[0], x[-1] - x) / 0.35, 0, 1)
    width = shape.half_width_m * (0.80 + 0.20 * np.sqrt(from_end))
    floor = 0.32 if is_bus else 0.24
    rings = np.zeros((len(x), _SIDES, 3))
    for i in range(len(x)):
        cabin = roof[i] - belt[i]
        top = width[i] * (0.97 if is_bus else 1 - 0.24 * min(1.0, cabin / 0.5))
        waist = 0.58 if belt[i] > 0.62 else (floor + belt[i]) / 2
        half = [
            (width[i] * 0.82, floor),
            (width[i] * 0.97, floor + 0.10),
            (width[i], waist),
            (width[i] * 0.975, belt[i]),
            (top, roof[i] - 0.05 * min(1.0, cabin / 0.3)),
            (top * 0.55, roof[i] + 0.012),
        ]
        rings[i] = [(x[i], -y, z) for y, z in half] + [(x[i], y, z) for y, z in half[::-1]]
    return rings


def _skin(kind: Vehicle, x: Floats, belt: Floats, roof: Floats) -> NDArray[np.uint8]:
    """Material of each panel, (n - 1) * 12: paint, side windows between pillars, sloping screens, floor."""
    pillars = np.arange(-4.6, 5, 1.5) if kind == Vehicle.BUS else np.array([-0.28])
    panels = np.full((len(x) - 1, _SIDES), Material.PAINT, np.uint8)
    for i in range(len(x) - 1):
        cabin = min(roof[i] - belt[i], roof[i + 1] - belt[i + 1])
        slope = abs(roof[i + 1] - roof[i]) / (x[i + 1] - x[i])
        has_pillar = np.any(np.abs((x[i] + x[i + 1]) / 2 - pillars) < 0.06)
        blind = kind == Vehicle.VAN and x[i] < 0.5
        if cabin > 0.18 and not has_pillar and not blind:
            panels[i, [3, 7]] = Material.GLASS
        if slope > 0.42 and roof[i] > belt[i] + 0.02:
            panels[i, 4:7] = Material.GLASS
        panels[i, 11] = Material.RUBBER
    return panels.ravel()


def _add_ends(mesh: MeshBuilder, rings: Floats, is_bus: bool) -> None:
    for ring, sign in ((rings[0], -1), (rings[-1], 1)):
        for j in range(5):
            panel = ring[[j, j + 1, _SIDES - 2 - j, _SIDES - 1 - j]]
            if sign > 0:
                panel = panel[::-1]
            mesh.quad(panel, material=Material.PAINT)
            if is_bus and j >= 3:
                middle = panel.mean(axis=0)
                screen = middle + (panel - middle) * 0.92 + [sign * 0.012, 0, 0]
                mesh.quad(screen, material=Material.GLASS)


def _add_wheels(mesh: MeshBuilder, shape: _Shape, is_bus: bool) -> None:
    axles = (-3.2, 3.4) if is_bus else (-shape.length_m * 0.29, shape.length_m * 0.30)
    radius, spokes = (0.48 if is_bus else 0.33), 18
    angles = np.linspace(0, 2 * np.pi, spokes, endpoint=False)
    for x in axles:
        for side in (-1, 1):
            inner, outer = side * (shape.half_width_m - 0.20), side * (shape.half_width_m + 0.012)
            mesh.tube(
                [[x, inner, radius], [x, outer, radius]], [radius] * 2, spokes, Material.RUBBER, cap=True
            )
            hub = np.column_stack(
                [
                    x + radius * 0.62 * np.cos(angles),
                    np.full(spokes, outer),
                    radius * (1 + 0.62 * np.sin(angles)),
                ]
            )
            hub[:, 1] += side * 0.006
            fan = [[i, (i + 1) % spokes, spokes][::-side] for i in range(spokes)]
            mesh.add(np.vstack([hub, [x, outer + side * 0.01, radius]]), fan, material=Material.RIM)


def _add_lights(mesh: MeshBuilder, kind: Vehicle, shape: _Shape, rear_belt: float, belt: float) -> None:
    is_bus, half, width = kind == Vehicle.BUS, shape.length_m / 2, shape.half_width_m
    tail_z, tail_height = (1.0 if is_bus else rear_belt - 0.18), (0.4 if kind == Vehicle.VAN else 0.16)
    for side in (-1, 1):
        mesh.box([0.06 - half, side * width * 0.78, tail_z], [0.14, 0.30, tail_height], Material.TAIL_LIGHT)
        lamp_z = 0.75 if is_bus else 0.585
        mesh.box([half - 0.085, side * width * 0.62, lamp_z], [0.19, 0.30, 0.11], Material.HEADLIGHT)
        if not is_bus:
            mirror = [shape.length_m * 0.13, side * (width + 0.08), belt + 0.06]
            mesh.box(mirror, [0.16, 0.18, 0.12], Material.PAINT)
    mesh.box([0.005 - half, 0, 0.6 if is_bus else 0.72], [0.04, 0.50, 0.12], Material.RIM)
    mesh.box([half - 0.05, 0, 0.42], [0.14, 1.3 * width, 0.18], Material.RUBBER)
    mesh.box([0.05 - half, 0, 0.40], [0.14, 1.5 * width, 0.20], Material.RUBBER)
