"""Signs on their posts, which are no lamp posts, and plates that hang on those that are.

Every function draws one object at (x_m, z_m) of the street frame; see `street_canvas`.
"""

from __future__ import annotations

import numpy as np

from scpf.models.painting import plate_outline
from scpf.sample_logs.street_billboards import base
from scpf.sample_logs.street_canvas import Canvas, Colour, Tube
from scpf.sample_logs.street_looks import any_colour, grey

FROM_BEHIND = 0.4  # share of the signs whose posts stand before their grey backs
ON_A_BASE = 0.3
TRIANGLE, RECTANGLE, OCTAGON, DISC = 3, 4, 8, 16  # corners of a plate
TALL_SIGNS = (
    (TRIANGLE,),
    (TRIANGLE, RECTANGLE),
    (TRIANGLE, RECTANGLE, DISC),
    (RECTANGLE, RECTANGLE, OCTAGON),
)


def sign_post(canvas: Canvas, rng: np.random.Generator, x_m: float, z_m: float) -> None:
    """A traffic sign, a traffic light or a bare stub: shorter than any lamp post."""
    tall = rng.random() < 0.5
    height, foot = rng.uniform(2.2, 3.8) if tall else rng.uniform(1.0, 3.8), 0.0
    if rng.random() < ON_A_BASE:
        foot = rng.uniform(0.08, 0.2)
        base(canvas, (x_m, z_m), (rng.uniform(0.3, 0.9), foot), grey(rng, 20, 220))
    metal = grey(rng, 40, 220)
    back = grey(rng, 15, 130) if rng.random() < FROM_BEHIND else None
    radius = rng.uniform(0.025, 0.06)
    post = Tube((x_m, foot, z_m), (x_m, height, z_m), radius, radius)
    if not back:
        canvas.tubes([post], metal)
    if tall:
        top = height + rng.uniform(0.0, 0.5)
        for corners in TALL_SIGNS[rng.integers(len(TALL_SIGNS))]:
            size = rng.uniform(0.3, 0.55)
            plate(canvas, rng, x_m, top - size, z_m, back, corners, size)
            top -= 1.7 * size
    else:
        for level in np.arange(height - 0.3, height * 0.45, -rng.uniform(0.3, 0.75))[: rng.integers(0, 5)]:
            plate(canvas, rng, x_m, level, z_m, back)
    if back:
        canvas.tubes([post], metal)


def plate(
    canvas: Canvas,
    rng: np.random.Generator,
    x_m: float,
    y_m: float,
    z_m: float,
    back: Colour | None = None,
    corners: int | None = None,
    radius_m: float | None = None,
) -> None:
    """A plate about (x_m, y_m) that faces the camera, or is turned away where ``back`` is given.

    ``corners`` and ``radius_m`` are random where they are not given.
    """
    corners = corners or int(rng.choice([TRIANGLE, RECTANGLE, RECTANGLE, OCTAGON, DISC]))
    radius_m = radius_m or rng.uniform(0.22, 0.5)
    shape = plate_outline(corners, np.pi if rng.random() < 0.4 else 0.0)
    wide = high = radius_m
    if corners == RECTANGLE:
        wide, high = radius_m * rng.uniform(0.6, 1.4, 2)
        if rng.random() < 0.4:  # a street's name, an arrow
            high, x_m = high * 0.25, x_m + wide * rng.uniform(-0.7, 0.7)
    wide *= rng.choice([1.0, rng.uniform(0.4, 1.0)])  # turned to another street
    outline = np.column_stack([shape * (wide, high), np.zeros(corners)])
    middle = np.array((x_m, y_m, z_m))
    if back:
        canvas.surface(middle + outline, back)
        return
    canvas.surface(middle + outline, any_colour(rng, 10, 250))
    canvas.surface(middle + outline * 0.75, grey(rng, 100, 250, 30))
    if rng.random() < 0.6:
        stroke = np.array([(-0.12, -0.45, 0), (0.12, -0.45, 0), (0.12, 0.4, 0), (-0.12, 0.4, 0)])
        ink, size = any_colour(rng, 0, 120), np.array((wide, high, 1.0))
        canvas.surface(middle + stroke * size, ink)
        canvas.surface(middle + stroke[:, [1, 0, 2]] * size * 0.8, ink)
