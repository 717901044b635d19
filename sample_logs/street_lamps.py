"""Lamp posts of many makes."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scpf.models.labelled_images import IGNORED_ID
from scpf.sample_logs.street_billboards import board
from scpf.sample_logs.street_canvas import Canvas, Colour, Floats, Tube
from scpf.sample_logs.street_looks import grey
from scpf.sample_logs.street_signs import plate

LEAST_LAMP_POST_M = 4.0  # park lanterns below are lamps, but hardly landmarks
FAINT = 0.25  # share of the posts that are hardly brighter or darker than what lies behind them
WITH_BOARDS = 0.3


@dataclass(frozen=True)
class LampDesign:
    """One make of lamp post: a street side has the same make throughout."""

    height_m: float
    radius_m: float
    taper: float
    collar: float  # the lower part is thicker by this factor
    collar_height_m: float
    style: str
    arm_m: float
    arm_rise: float
    head_m: float
    head_radius_m: float
    head_shade: float
    colour: Colour

    @classmethod
    def random(cls, rng: np.random.Generator) -> LampDesign:
        """A random make; slender posts with one short arm and low ones with a hood are the commonest in towns."""
        style = str(rng.choice(["short", "arm", "double", "curve", "top"], p=[0.32, 0.18, 0.1, 0.14, 0.26]))
        arm = {
            "short": (0.2, 1.2),
            "arm": (1.0, 3.0),
            "double": (0.5, 2.6),
            "curve": (0.8, 2.6),
            "top": (0.0, 0.1),
        }
        heights = (3.8, 6.0) if style == "top" and rng.random() < 0.7 else (4.5, 11.0)
        level = ((12, 70), (60, 150), (130, 245))[rng.choice(3, p=[0.42, 0.28, 0.3])]
        return cls(
            height_m=rng.uniform(*heights),
            radius_m=rng.uniform(0.04, 0.11),
            taper=rng.choice([1.0, rng.uniform(0.45, 0.95)], p=[0.3, 0.7]),
            collar=rng.choice([1.0, rng.uniform(1.2, 1.8)]),
            collar_height_m=rng.uniform(0.4, 2.2),
            style=style,
            arm_m=rng.uniform(*arm[style]),
            arm_rise=rng.choice([0.0, rng.uniform(0.0, 0.4)]),
            head_m=rng.uniform(0.45, 1.0),
            head_radius_m=rng.uniform(0.05, 0.14),
            head_shade=rng.uniform(0.6, 1.5),
            colour=grey(rng, *level, 15),
        )


def lamp_post(
    canvas: Canvas,
    rng: np.random.Generator,
    x_m: float,
    z_m: float,
    towards: int,
    make: LampDesign,
    instance_id: int,
) -> None:
    """A lamp post with its arms and heads; ``towards`` is -1 or 1: the side of x where the road lies."""
    lean = rng.normal(0, 0.008, 2)
    top = np.array((x_m + lean[0] * make.height_m, make.height_m, z_m + lean[1] * make.height_m))
    base = np.array((x_m, 0.0, z_m))
    step = base + (top - base) * make.collar_height_m / make.height_m
    tubes = [
        _tube(base, step, make.radius_m * make.collar, make.radius_m * make.collar),
        _tube(step, top, make.radius_m, make.radius_m * make.taper),
    ]
    if make.style == "top":
        tubes += _lantern(top, make)
    for direction in {"top": (), "double": (-1, 1)}.get(make.style, (towards,)):
        tubes += _arm(top, direction, make)
    ignored = make.style == "top" and make.height_m < LEAST_LAMP_POST_M
    colour = make.colour
    if rng.random() < FAINT:
        share = rng.choice([rng.uniform(0.5, 0.85), rng.uniform(1.15, 1.5)])
        b, g, r = canvas.seen_along(base, top) * share
        colour = (float(b), float(g), float(r))
    canvas.tubes(tubes, colour, IGNORED_ID if ignored else instance_id)
    if rng.random() < WITH_BOARDS:  # signs, posters and boxes hang on it, never at its very top
        for _ in range(rng.integers(1, 4)):
            hang = plate if rng.random() < 0.3 else board
            hang(canvas, rng, x_m, rng.uniform(0.6, 0.65 * make.height_m), z_m - 0.1)


def _lantern(top: Floats, make: LampDesign) -> list[Tube]:
    """A lantern, a globe or a hood upon the post, by its profile of radii."""
    radius = make.head_radius_m * 1.8 + 0.06
    profiles = (
        (0.5, 1.0, 1.0, 0.3),
        (0.6, 1.0, 1.0, 0.6),
        (0.2, 0.3, 1.6, 0.4),
        (1.5, 1.5, 0.2, 0.1),
        (0.7, 0.4, 2.4, 1.9),  # a glass below a wide, flat hood
        (0.5, 0.5, 2.0, 0.2),
    )
    profile = profiles[int(make.head_m * 1000) % len(profiles)]
    levels = [_beyond(top, 0.0, height) for height in np.linspace(0, make.head_m * 0.8, 4)]
    return [
        _tube(levels[i], levels[i + 1], radius * profile[i], radius * profile[i + 1], make.head_shade)
        for i in range(3)
    ]


def _arm(top: Floats, direction: int, make: LampDesign) -> list[Tube]:
    """Arm and head towards one side."""
    thin = make.radius_m * 0.5
    if make.style == "curve":
        turns = np.linspace(0, 1.5, 6)
        rise = 0.6 * make.arm_m
        points = [_beyond(top, direction * make.arm_m * np.sin(t), rise * (1 - np.cos(t))) for t in turns]
        tubes = [_tube(a, b, thin, thin * 0.9) for a, b in pairwise(points)]
        end = points[-1]
    else:
        end = _beyond(top, direction * make.arm_m, make.arm_m * make.arm_rise)
        tubes = [_tube(_beyond(top, 0.0, -0.06), end, thin, thin * 0.9)]
    tip = _beyond(end, direction * make.head_m, make.head_m * 0.3 * make.arm_rise - 0.02)
    middle = (end + tip) / 2
    fat = make.head_radius_m
    tubes.append(_tube(end, middle, 0.6 * fat, fat, make.head_shade))
    tubes.append(_tube(middle, tip, fat, 0.7 * fat, make.head_shade))
    return tubes


def _beyond(point_m: Floats, right_m: float, up_m: float) -> Floats:
    return np.asarray(point_m + np.array([right_m, up_m, 0.0]))


def _tube(
    start_m: Floats, end_m: Floats, start_radius_m: float, end_radius_m: float, shade: float = 1.0
) -> Tube:
    (xa, ya, za), (xb, yb, zb) = start_m.tolist(), end_m.tolist()
    return Tube((xa, ya, za), (xb, yb, zb), start_radius_m, end_radius_m, shade)
