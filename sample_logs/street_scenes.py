"""Random street scenes with light poles, to train the segmenter on pictures that anyone may use.

Each scene is painted from its seed alone: ground, backdrop, shadows, then all objects from far to near, then
the camera's own faults. What resembles a lamp post (stakes, trunks, scaffolds, sign posts, house edges) is
plentiful, because a network trained without it takes it for one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from scpf.models.instances import Image
from scpf.sample_logs.street_billboards import billboard
from scpf.sample_logs.street_canvas import Canvas
from scpf.sample_logs.street_flags import flags
from scpf.sample_logs.street_ground import LEFT, RIGHT, Street, paint_cables, paint_ground, paint_shadows
from scpf.sample_logs.street_houses import facade, lumber, scaffold, site_fence
from scpf.sample_logs.street_lamps import LampDesign, lamp_post
from scpf.sample_logs.street_looks import any_colour
from scpf.sample_logs.street_objects import car, fence
from scpf.sample_logs.street_plants import bush, tree
from scpf.sample_logs.street_signs import sign_post

SIZES_PX = ((1024, 768), (1248, 384), (1152, 640))
SIZE_SHARES = (0.5, 0.36, 0.14)
MOST_LAMPS = 200  # ids above are for the ignored ones
BEFORE_A_SCAFFOLD = 0.6  # share of the scaffolds with a lamp post before them, whatever else stands there

Thing = tuple[float, Callable[[], None]]  # distance (m) and how to draw it


@dataclass(frozen=True)
class ScaffoldPlace:
    """Where a scaffold stands: side of the street (`LEFT` or `RIGHT`), x of its front, and from which z how far."""

    side: int
    front_m: float
    z_m: float
    length_m: float


def scene(seed: int, size_px: tuple[int, int] | None = None) -> tuple[Image, NDArray[np.uint8]]:
    """The scene of a seed: image (H, W, 3) uint8 **BGR** and instance ids (H, W) uint8.

    ids: 0 background, 1 to 200 lamp posts, 255 small lanterns that may be found or not.
    ``size_px``: (width, height); by default one of `SIZES_PX` at random.
    """
    rng = np.random.default_rng(seed)
    width, height = size_px or SIZES_PX[rng.choice(len(SIZES_PX), p=SIZE_SHARES)]
    street = Street.random(rng, width, height)
    paint_ground(street, rng)
    paint_shadows(street, rng)
    houses, scaffolds = _houses(street, rng)
    things = houses + _clutter(street, rng) + _lamps(street, rng, scaffolds)
    for _, draw in sorted(things, key=lambda thing: -thing[0]):
        draw()
    paint_cables(street, rng)
    return _photograph(rng, street.canvas.image), street.canvas.ids


def _houses(street: Street, rng: np.random.Generator) -> tuple[list[Thing], list[ScaffoldPlace]]:
    """Rows of houses on most sides, some behind scaffolds."""
    found: list[Thing] = []
    scaffolds: list[ScaffoldPlace] = []
    for side in (LEFT, RIGHT):
        z = rng.uniform(2.5, 30) if rng.random() < 0.8 else np.inf
        set_back = street.verge_m + rng.uniform(0, 6)
        while z < 130:
            length, tall = rng.uniform(7, 24), rng.uniform(4, 20)
            x = street.x_m(side, set_back + rng.uniform(0, 2), z + length / 2)
            light = 1.0
            if rng.random() < 0.4:
                light = rng.choice([1.0, rng.uniform(0.2, 0.7)])  # a shell without windows is dark
                place = ScaffoldPlace(side, x - side * rng.uniform(0.8, 1.5), z, length)
                draw = partial(scaffold, street.canvas, rng, place.front_m, z, length, tall)
                found.append((z + length * 0.3, draw))
                found += _before_a_scaffold(street, rng, place)
                scaffolds.append(place)
            house = partial(_house, street.canvas, rng, side, x, z, length, tall, light)
            found.append((z + length * 0.6, house))
            z += length + (rng.uniform(1, 14) if rng.random() < 0.5 else 0.0)
    return found, scaffolds


def _house(
    canvas: Canvas,
    rng: np.random.Generator,
    side: int,
    x_m: float,
    z_m: float,
    length_m: float,
    height_m: float,
    light: float,
) -> None:
    """Front along the street, gable towards the camera, a roof."""
    near, far, back = max(z_m, 2.0), z_m + length_m, x_m + side * rng.uniform(7, 14)
    wall = np.asarray(facade(rng, length_m, height_m) * light, np.uint8)
    gable = np.clip(wall * rng.uniform(0.5, 1.3), 0, 255).astype(np.uint8)  # in another light
    canvas.texture([(x_m, 0, near), (back, 0, near), (back, height_m, near), (x_m, height_m, near)], gable)
    canvas.texture([(x_m, 0, near), (x_m, 0, far), (x_m, height_m, far), (x_m, height_m, near)], wall)
    tiles, ridge, middle = any_colour(rng, 20, 140), height_m + rng.uniform(0, 5), (x_m + back) / 2
    eaves = x_m - side * 0.4
    canvas.surface([(x_m, height_m, near), (back, height_m, near), (middle, ridge, near)], tiles)
    canvas.surface(
        [(eaves, height_m, near), (eaves, height_m, far), (middle, ridge, far), (middle, ridge, near)], tiles
    )


def _before_a_scaffold(street: Street, rng: np.random.Generator, place: ScaffoldPlace) -> list[Thing]:
    """What is taken for a lamp post the more easily the more of its like stand behind it."""
    found: list[Thing] = []
    for _ in range(rng.integers(0, 4)):
        z = max(place.z_m, 4.0) + rng.uniform(0, 0.3) * place.length_m
        x = place.front_m - place.side * rng.uniform(0.3, 3.0)
        draw = (sign_post, sign_post, site_fence, lumber, billboard)[rng.integers(5)]
        found.append((z, partial(draw, street.canvas, rng, x, z)))
    return found


def _clutter(street: Street, rng: np.random.Generator) -> list[Thing]:
    """Signs, fences, boards, building timber, cars, trees and bushes."""
    found: list[Thing] = []
    furniture = (
        (sign_post, 5, 4.0),
        (fence, 3, 4.0),
        (billboard, 4, 4.0),
        (flags, 5, 10.0),
        (lumber, 2, 4.0),
        (site_fence, 3, 4.0),
    )
    for side in (LEFT, RIGHT):
        for draw, most, nearest_m in furniture:
            for _ in range(rng.integers(0, most)):
                z = _distance_m(rng, nearest_m)
                x = street.x_m(side, rng.uniform(0.2, 1.0 + 1.5 * street.verge_m), z)
                found.append((z, partial(draw, street.canvas, rng, x, z)))
        for _ in range(rng.integers(0, 4)):
            z = _distance_m(rng, 7.0)
            x = street.x_m(side, -rng.uniform(0.8, 3), z)
            found.append((z, partial(car, street.canvas, rng, x, z)))
        row = rng.uniform(1, street.verge_m + 1)
        for plant, most in ((tree, 10), (bush, 8)):
            for _ in range(rng.integers(0, most)):
                z = _distance_m(rng, 5.0)
                x = street.x_m(side, row if rng.random() < 0.5 else rng.uniform(0.8, 20), z)
                found.append((z, partial(plant, street.canvas, rng, x, z, street.crowns)))
    return found


def _distance_m(rng: np.random.Generator, nearest_m: float) -> float:
    """Near things are drawn as often as far ones: uniform in the logarithm, to 80 m."""
    return float(np.exp(rng.uniform(np.log(nearest_m), np.log(80))))


def _lamps(street: Street, rng: np.random.Generator, scaffolds: Sequence[ScaffoldPlace]) -> list[Thing]:
    """Rows of one make on either side, single ones of other streets further off, and some before scaffolds.

    Those stand before the scaffold's nearer half, so that the camera sees its tubes beside and behind them.
    """
    spots: list[tuple[float, float, int, LampDesign]] = []
    for side in (LEFT, RIGHT):
        make = LampDesign.random(rng)
        if rng.random() < 0.75:
            z, gap, beyond = rng.uniform(3.5, 30), rng.uniform(14, 40), rng.uniform(0.4, 4.0)
            while z < 90:
                if rng.random() < 0.9:
                    spots.append((street.x_m(side, beyond, z), z, -side, make))
                z += gap * rng.uniform(0.85, 1.15)
        for _ in range(rng.integers(0, 3)):
            z = rng.uniform(10, 60)
            spots.append((street.x_m(side, rng.uniform(4, 25), z), z, int(rng.choice([LEFT, RIGHT])), make))
        for place in scaffolds:
            if place.side == side and rng.random() < BEFORE_A_SCAFFOLD:
                z = max(place.z_m, 5.0) + rng.uniform(0, 0.5) * place.length_m
                spots.append((place.front_m - side * rng.uniform(0.5, 3.5), z, -side, make))
    return [
        (z, partial(lamp_post, street.canvas, rng, x, z, towards, make, i))
        for i, (x, z, towards, make) in enumerate(spots[:MOST_LAMPS], start=1)
    ]


def _photograph(rng: np.random.Generator, painted: Image) -> Image:
    """Lens blur, exposure, contrast curve and sensor noise."""
    blurred = cv2.GaussianBlur(painted, (0, 0), rng.uniform(0.35, 0.85))
    gain, lift = rng.uniform(0.7, 1.1), rng.uniform(-10, 25)
    curve = 255 * (np.arange(256) / 255) ** rng.uniform(0.7, 1.5) * gain + lift
    noise = rng.standard_normal(painted.shape, dtype=np.float32) * np.float32(rng.uniform(0.5, 6))
    toned = curve.astype(np.float32)[blurred] + noise
    return np.asarray(np.clip(toned, 0, 255), np.uint8)
