"""Trees and bushes: trunks and branches as tubes, crowns of leaf cards in three levels of detail."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scpf.sample_logs.materials import Material
from scpf.sample_logs.mesh import Floats, Mesh, MeshBuilder, unit

LOD_RANGES_M = ((0.0, 34.0), (34.0, 85.0), (85.0, 1e9))
"""Distances from the camera at which each level of detail is shown."""
_CARD_UV = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])


class Tree(NamedTuple):
    """One level of detail of a tree; trunk and crown are separate, for only the crown has holes."""

    trunk: Mesh
    crown: Mesh


class _Cards:
    """Collects leaf cards: centre (3,), half sides (3,), normal (3,) for the light."""

    def __init__(self) -> None:
        self._corners: list[Floats] = []
        self._normals: list[Floats] = []
        self._uv: list[Floats] = []

    def add(self, corners: Floats, normal: Floats, uv: Floats = _CARD_UV) -> None:
        self._corners.append(corners)
        self._normals.append(np.tile(normal, (4, 1)))
        self._uv.append(uv)

    def build(self) -> Mesh:
        first = 4 * np.arange(len(self._corners))[:, None]
        faces = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])], axis=1).reshape(
            -1, 3
        )
        mesh = MeshBuilder()
        mesh.add(
            np.concatenate(self._corners),
            faces,
            np.concatenate(self._uv),
            np.concatenate(self._normals),
            Material.LEAF,
        )
        return mesh.build()


def broadleaf(rng: np.random.Generator, height_m: float, trunk_m: float, radius_m: float, level: int) -> Tree:
    """A broad-leaved tree whose crown fills an uneven ellipsoid from trunk_m to height_m.

    Cards sit on and in leaf clumps of differing size, turned and sized at random, so that neither the clumps
    nor the cards show their outline. The same generator state gives the same tree at every level.
    """
    lean = rng.normal(0, 0.12, 2)
    middle, half = (trunk_m + height_m) / 2, (height_m - trunk_m) / 2
    radii = np.array([radius_m * rng.uniform(0.85, 1.1), radius_m * rng.uniform(0.85, 1.1), half])
    clumps = _clumps(rng, radii) + np.array([0, 0, middle])
    sizes = radius_m * rng.uniform(0.26, 0.52, len(clumps))
    trunk = MeshBuilder()
    z = np.linspace(0, height_m * 0.75, 6)
    path = np.column_stack([np.outer((z / height_m) ** 2 * 3, lean), z])
    base = 0.02 * height_m + 0.04
    stem = np.interp(z, [0, 0.3, height_m * 0.75], [base * 1.5, base, base * 0.3])
    trunk.tube(path, stem, (14, 8, 5)[level], Material.BARK)
    if level < 2:
        for clump in clumps[::2]:
            root = path[2] + [0, 0, rng.uniform(-0.03, 0.15) * trunk_m]
            root[2] = min(max(root[2], trunk_m * 0.75), clump[2] - 0.2)
            bend = (root + clump) / 2 + [0, 0, 0.15]
            limb = [base * 0.35, base * 0.22, base * 0.08]
            trunk.tube([root, bend, clump], limb, (6, 4)[level], Material.BARK)
    cards = _Cards()
    per_clump, half_side = (40, 15, 6)[level], (0.50, 0.85, 1.45)[level] * radius_m / 2.6
    for clump, size in zip(clumps, sizes, strict=True):
        for _ in range(per_clump):
            out = unit(rng.normal(size=3))
            centre = clump + out * size * rng.uniform(0.35, 1.1) * np.array([1, 1, 0.8])
            # Leaves are lit as the crown is, not each card for itself: half the crown's normal, half its own.
            light = 0.55 * unit((centre - [0, 0, middle]) / radii) + 0.45 * out
            _add_leaf_card(cards, rng, centre, out, half_side * rng.uniform(0.5, 1.35), light)
    return Tree(trunk.build(), cards.build())


def _clumps(rng: np.random.Generator, radii: Floats) -> Floats:
    """Middles (n, 3) of leaf clumps: most near the surface of the ellipsoid, evenly spread, a few inside."""
    count = int(rng.integers(17, 24))
    k = np.arange(count) + 0.5
    # Fibonacci sphere: even spread without a grid (Swinbank & Purser, 2006).
    polar, turn = np.arccos(1 - 2 * k / count), np.pi * (1 + 5**0.5) * k + rng.uniform(0, 6.28)
    sphere = np.column_stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)])
    sphere = unit(sphere + rng.normal(0, 0.22, sphere.shape))
    depth = rng.uniform(0.45, 0.82, (count, 1))
    return np.asarray(sphere * depth * radii)


def _add_leaf_card(
    cards: _Cards, rng: np.random.Generator, centre: Floats, out: Floats, half_side: float, light: Floats
) -> None:
    """Add a card that looks about ``out``, turned and stretched at random, lit along ``light``."""
    across = unit(np.cross(out + rng.normal(size=3) * 0.8, rng.normal(size=3)))
    up = unit(np.cross(across, out + rng.normal(size=3) * 0.7))
    wide, tall = across * half_side, up * half_side * rng.uniform(0.65, 1.2)
    corners = np.array([-wide - tall, wide - tall, wide + tall, -wide + tall]) + centre
    cards.add(corners, light)


def conifer(rng: np.random.Generator, height_m: float, level: int) -> Tree:
    """A spruce: whorls of drooping twigs that shorten towards the top."""
    trunk, cards = MeshBuilder(), _Cards()
    trunk.tube(
        [[0.0, 0, 0], [0, 0, height_m * 0.95]], [0.02 * height_m, 0.02], (10, 6, 5)[level], Material.BARK
    )
    whorls, twigs, spread = (22, 12, 6)[level], (13, 9, 6)[level], (0.42, 0.55, 0.85)[level]
    twig_uv = np.array([[0.25, 0], [0.75, 0], [1, 1], [0, 1]])
    for k in range(whorls):
        z = 0.06 * height_m + 0.92 * height_m * (k / (whorls - 1)) ** 0.95
        reach = 0.24 * height_m * max(0.0, 1 - z / height_m) ** 0.85 + 0.10
        count, first = max(4, int(twigs * (1 - 0.6 * k / whorls))), rng.uniform(0, 6)
        for j in range(count):
            angle = first + 2 * np.pi * j / count + rng.normal(0, 0.12)
            out = np.array([np.cos(angle), np.sin(angle), 0.0])
            side = np.array([-out[1], out[0], 0.0])
            width, length = reach * spread * rng.uniform(0.85, 1.15), reach * rng.uniform(0.85, 1.12)
            root = np.array([0, 0, z])
            tip = root + out * length - [0, 0, (0.42 + 0.15 * rng.normal()) * length]
            corners = [
                root - side * width * 0.3,
                root + side * width * 0.3,
                tip + side * width,
                tip - side * width,
            ]
            cards.add(np.array(corners), unit(out * 0.8 + [0, 0, 0.6]), twig_uv)
    return Tree(trunk.build(), cards.build())


def bush(rng: np.random.Generator) -> Mesh:
    """A round bush about 1.5 m wide."""
    cards = _Cards()
    for _ in range(90):
        out = unit(rng.normal(size=3))
        out[2] = abs(out[2])
        centre = out * [0.75, 0.75, 0.62] * rng.uniform(0.7, 1) + [0, 0, 0.15]
        _add_leaf_card(cards, rng, centre, out, 0.30 * rng.uniform(0.6, 1.2), out)
    return cards.build()
