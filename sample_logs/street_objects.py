"""Fences and cars.

Every function draws one object at (x_m, z_m) of the street frame; see `street_canvas`.
"""

from __future__ import annotations

import numpy as np

from scpf.sample_logs.street_canvas import Canvas, Point, Tube
from scpf.sample_logs.street_looks import any_colour, grey


def fence(canvas: Canvas, rng: np.random.Generator, x_m: float, z_m: float) -> None:
    """Posts with rails or a tight grid, along the street or across; bollards where there are no rails."""
    gap, count, high = rng.uniform(1.0, 2.5), int(rng.integers(3, 9)), rng.uniform(0.7, 2.0)
    along = rng.random() < 0.7
    radius = rng.uniform(0.02, 0.08)
    spots = [(x_m, z_m + i * gap) if along else (x_m + i * gap * np.sign(x_m), z_m) for i in range(count)]
    tubes = [Tube((x, 0, z), (x, high, z), radius, radius) for x, z in spots]
    (xa, za), (xb, zb) = spots[0], spots[-1]
    levels_m = high * np.linspace(0.15, 1.0, rng.integers(2, 5))
    rails = levels_m[: 0 if rng.random() < 0.3 else None]
    tubes += [Tube((xa, y, za), (xb, y, zb), radius * 0.5, radius * 0.5) for y in rails]
    if rng.random() < 0.3:
        for u in np.linspace(0, 1, count * 6):
            x, z = xa + u * (xb - xa), za + u * (zb - za)
            tubes.append(Tube((x, 0.1, z), (x, high, z), radius * 0.3, radius * 0.3))
    canvas.tubes(tubes, grey(rng, 30, 230))


def car(canvas: Canvas, rng: np.random.Generator, x_m: float, z_m: float) -> None:
    """A car, van or bus, from behind, with its flank towards the camera."""
    wide, high, length = ((1.8, 1.5, 4.2), (2.0, 2.3, 5.5), (2.5, 3.1, 11.0))[
        rng.choice(3, p=[0.75, 0.18, 0.07])
    ]
    paint, glass = any_colour(rng, 10, 240), grey(rng, 10, 80)
    profile = [(-1, 0.25), (-1, 0.6), (-0.8, 1.0), (0.8, 1.0), (1, 0.6), (1, 0.25)]
    rear = [(x_m + a * wide / 2, b * high, z_m) for a, b in profile]
    inner = -np.sign(x_m) * wide / 2
    outline = ((0.25, 0), (0.6, 0), (0.95, 0.1), (0.95, 0.6), (0.6, 0.8), (0.55, 1), (0.25, 1))
    flank: list[Point] = [(x_m + inner, b * high, z_m + u * length) for b, u in outline]
    shadow: list[Point] = [
        (x_m + a * wide * 0.6, 0.0, z_m + b * length) for a, b in ((-1, 0), (1, 0), (1, 1), (-1, 1))
    ]
    canvas.surface(shadow, (15.0, 15.0, 15.0))
    canvas.surface(flank, (paint[0] * 0.75, paint[1] * 0.75, paint[2] * 0.75))
    side: list[Point] = [
        (x_m + inner, b * high, z_m + u * length)
        for b, u in ((0.62, 0.08), (0.9, 0.15), (0.9, 0.58), (0.62, 0.7))
    ]
    canvas.surface(side, glass)
    canvas.surface(rear, paint)
    canvas.surface(
        [
            (x_m + a * wide / 2, b * high, z_m)
            for a, b in ((-0.85, 0.62), (-0.7, 0.93), (0.7, 0.93), (0.85, 0.62))
        ],
        glass,
    )
    for a in (-0.8, 0.8):
        x = x_m + a * wide / 2
        canvas.surface([(x - 0.15, 0.45 * high, z_m), (x + 0.15, 0.45 * high, z_m), (x + 0.15, 0.58 * high, z_m),
                        (x - 0.15, 0.58 * high, z_m)], (30.0, 30.0, 200.0))  # fmt: skip
        canvas.surface(
            [(x - 0.14, 0.0, z_m), (x + 0.14, 0.0, z_m), (x + 0.14, 0.5, z_m), (x - 0.14, 0.5, z_m)],
            (18.0, 18.0, 18.0),
        )
