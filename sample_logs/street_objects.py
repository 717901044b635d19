"""Street furniture and cars: posts, plates and rails that are no lamp posts.

Every function draws one object at (x_m, z_m) of the street frame; see `street_canvas`.
"""

from __future__ import annotations

import numpy as np

from scpf.sample_logs.street_canvas import Canvas, Colour, Point, Tube
from scpf.sample_logs.street_looks import any_colour, grey


def sign_post(canvas: Canvas, rng: np.random.Generator, x_m: float, z_m: float) -> None:
    """A traffic sign, a traffic light or a bare stub: shorter than any lamp post."""
    height = rng.uniform(1.0, 3.4)
    canvas.tubes(
        [Tube((x_m, 0, z_m), (x_m, height, z_m), *[rng.uniform(0.025, 0.06)] * 2)], grey(rng, 40, 220)
    )
    for level in np.arange(height - 0.3, height * 0.45, -0.75)[: rng.integers(0, 4)]:
        plate(canvas, rng, x_m, level, z_m)


def plate(canvas: Canvas, rng: np.random.Generator, x_m: float, y_m: float, z_m: float) -> None:
    """A round, square, triangular or long plate facing the camera."""
    corners = int(rng.choice([3, 4, 4, 16]))
    turn = {3: np.pi / 2, 4: np.pi / 4, 16: 0.0}[corners] + (np.pi if rng.random() < 0.3 else 0.0)
    angles = turn + np.arange(corners) * 2 * np.pi / corners
    wide, high = rng.uniform(0.22, 0.5) * np.where(corners == 4, rng.uniform(0.6, 1.4, 2), 1.0)
    for scale, colour in ((1.0, any_colour(rng, 10, 250)), (0.75, grey(rng, 100, 250, 30))):
        points = np.stack([x_m + scale * wide * np.cos(angles), y_m + scale * high * np.sin(angles),
                           np.full(corners, z_m)], axis=1)  # fmt: skip
        canvas.surface(points, colour)


def billboard(canvas: Canvas, rng: np.random.Generator, x_m: float, z_m: float) -> None:
    """A board on two posts."""
    wide, low, high = rng.uniform(1.0, 3.5), rng.uniform(0.5, 3.0), rng.uniform(1.0, 3.0)
    canvas.tubes([Tube((x_m + s, 0, z_m), (x_m + s, low + high, z_m), *[rng.uniform(0.04, 0.09)] * 2)
                  for s in (-wide / 2, wide / 2)], grey(rng, 40, 220))  # fmt: skip
    _framed(
        canvas, (x_m - wide / 2, low, z_m), (wide, high), 0.12, grey(rng, 150, 250), any_colour(rng, 20, 250)
    )


def board(canvas: Canvas, rng: np.random.Generator, x_m: float, y_m: float, z_m: float) -> None:
    """A framed board, a poster or a box that hangs on a post; ``y_m``: its lower edge."""
    wide, high = ((0.2, 0.4), (0.45, 0.6), (0.7, 1.1))[rng.integers(3)] * rng.uniform(0.7, 1.4, 2)
    left = x_m - wide * rng.choice([0.5, rng.uniform(0.0, 1.0)])
    _framed(canvas, (left, y_m, z_m), (wide, high), 0.06, grey(rng, 20, 250), any_colour(rng, 20, 250))


def _framed(
    canvas: Canvas,
    corner_m: Point,
    size_m: tuple[float, float],
    frame_m: float,
    frame: Colour,
    inside: Colour,
) -> None:
    """A rectangle that faces the camera, of two colours; ``corner_m``: its lower left one."""
    (x, y, z), (wide, high) = corner_m, size_m
    for inset, colour in ((0.0, frame), (frame_m, inside)):
        x1, x2, y1, y2 = x + inset, x + wide - inset, y + inset, y + high - inset
        canvas.surface([(x1, y1, z), (x2, y1, z), (x2, y2, z), (x1, y2, z)], colour)


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
