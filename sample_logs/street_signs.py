"""Signs and billboards on their posts, which are no lamp posts, and what hangs on those that are.

Every function draws one object at (x_m, z_m) of the street frame; see `street_canvas`.
"""

from __future__ import annotations

import numpy as np

from scpf.sample_logs.street_canvas import Canvas, Colour, Point, Tube
from scpf.sample_logs.street_looks import any_colour, grey

FROM_BEHIND = 0.35  # share of the signs and billboards whose posts stand before their grey backs
ON_A_BASE = 0.4


def sign_post(canvas: Canvas, rng: np.random.Generator, x_m: float, z_m: float) -> None:
    """A traffic sign, a traffic light or a bare stub: shorter than any lamp post."""
    height, foot = rng.uniform(1.0, 3.8), 0.0
    if rng.random() < ON_A_BASE:
        foot = rng.uniform(0.08, 0.2)
        _base(canvas, (x_m, z_m), (rng.uniform(0.3, 0.9), foot), grey(rng, 20, 220))
    post = Tube((x_m, foot, z_m), (x_m, height, z_m), *[rng.uniform(0.025, 0.06)] * 2)
    metal = grey(rng, 40, 220)
    back = grey(rng, 15, 130) if rng.random() < FROM_BEHIND else None
    if not back:
        canvas.tubes([post], metal)
    for level in np.arange(height - 0.3, height * 0.45, -rng.uniform(0.3, 0.75))[: rng.integers(0, 5)]:
        plate(canvas, rng, x_m, level, z_m, back)
    if back:
        canvas.tubes([post], metal)


def plate(
    canvas: Canvas, rng: np.random.Generator, x_m: float, y_m: float, z_m: float, back: Colour | None = None
) -> None:
    """A round, square, triangular or long plate facing the camera, or turned away where ``back`` is given."""
    corners = int(rng.choice([3, 4, 4, 16]))
    turn = {3: np.pi / 2, 4: np.pi / 4, 16: 0.0}[corners] + (np.pi if rng.random() < 0.3 else 0.0)
    angles = turn + np.arange(corners) * 2 * np.pi / corners
    wide, high = rng.uniform(0.22, 0.5) * np.where(corners == 4, rng.uniform(0.6, 1.4, 2), 1.0)
    if corners == 4 and rng.random() < 0.3:  # a street's name, an arrow
        high, x_m = high * 0.25, x_m + wide * rng.uniform(-0.7, 0.7)
    rims = ((1.0, back),) if back else ((1.0, any_colour(rng, 10, 250)), (0.75, grey(rng, 100, 250, 30)))
    for scale, colour in rims:
        points = np.stack([x_m + scale * wide * np.cos(angles), y_m + scale * high * np.sin(angles),
                           np.full(corners, z_m)], axis=1)  # fmt: skip
        canvas.surface(points, colour)


def billboard(canvas: Canvas, rng: np.random.Generator, x_m: float, z_m: float) -> None:
    """A board on two posts, tall ones as well as low ones, often on a base of concrete."""
    wide, low, high = rng.uniform(1.0, 4.0), rng.uniform(0.5, 3.5), rng.uniform(0.8, 3.0)
    apart, foot = wide * rng.uniform(0.55, 1.0), 0.0
    spots = (x_m - apart / 2, x_m + apart / 2)
    if rng.random() < ON_A_BASE:
        across, foot, stone = rng.uniform(0.6, 1.6), rng.uniform(0.2, 0.7), grey(rng, 60, 240)
        for x in spots:
            _base(canvas, (x, z_m), (across, foot), stone)
    radius, tall = rng.uniform(0.04, 0.11), low + high * rng.uniform(0.8, 1.05)
    posts = [Tube((x, foot, z_m), (x, max(tall, foot), z_m), radius, radius) for x in spots]
    metal, corner = grey(rng, 40, 235), (x_m - wide / 2, low, z_m)
    if rng.random() < FROM_BEHIND:
        back = grey(rng, 20, 150)
        _framed(canvas, corner, (wide, high), 0.12, back, back)
        canvas.tubes(posts, metal)
        return
    canvas.tubes(posts, metal)
    _framed(canvas, corner, (wide, high), 0.12, grey(rng, 150, 250), any_colour(rng, 20, 250))
    if rng.random() < 0.6:  # a band of print
        ink, y = any_colour(rng, 10, 250), low + high * rng.uniform(0.1, 0.5)
        _framed(canvas, (x_m - wide * 0.45, y, z_m), (wide * 0.9, high * 0.2), 0.0, ink, ink)


def _base(canvas: Canvas, spot_m: tuple[float, float], size_m: tuple[float, float], colour: Colour) -> None:
    """A block of concrete or rubber under a post at ``spot_m`` (x, z); ``size_m``: width, which is depth, height."""
    (x, z), (wide, high) = spot_m, size_m
    left, right, near, far = x - wide / 2, x + wide / 2, z - wide / 2, z + wide / 2
    b, g, r = (min(level * 1.2, 255.0) for level in colour)
    canvas.surface(
        [(left, high, near), (right, high, near), (right, high, far), (left, high, far)], (b, g, r)
    )
    canvas.surface([(left, 0, near), (right, 0, near), (right, high, near), (left, high, near)], colour)


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
