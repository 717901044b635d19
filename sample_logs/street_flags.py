"""Flags that hang down from their staffs: as tall as lamp posts, and of another shape."""

from __future__ import annotations

import numpy as np

from scpf.models.labelled_images import IGNORED_ID
from scpf.sample_logs.street_canvas import Canvas, Tube
from scpf.sample_logs.street_looks import any_colour, grey

LEVELS = 9  # at which the outline of a cloth is drawn


def flags(canvas: Canvas, rng: np.random.Generator, x_m: float, z_m: float) -> None:
    """One to three of a make, side by side."""
    tall, radius, staff = rng.uniform(4.5, 9.5), rng.uniform(0.03, 0.06), grey(rng, 60, 250)
    slack, gap = rng.random() < 0.75, rng.uniform(1.5, 8.0) * np.sign(x_m)
    for k in range(rng.integers(1, 4)):
        x = x_m + k * gap
        knob, beside = rng.uniform(0.05, 0.12), rng.choice([-1, 1]) * rng.uniform(0.0, 0.35)
        parts = [
            Tube((x, 0, z_m), (x, tall, z_m), radius, radius * 0.7),
            Tube((x, tall, z_m), (x + beside, tall + 0.1, z_m), knob, knob * 0.6, rng.uniform(0.3, 0.9)),
        ]
        top = tall - rng.uniform(0.05, 0.3)
        drop = top * rng.uniform(0.35, 0.8)
        half_way = canvas.camera.project([(x, top - drop / 2, z_m)])[0][0]
        seen = half_way[1] > 0  # a bare staff without its top may as well be a lamp post
        canvas.tubes(parts, staff, 0 if seen else IGNORED_ID)
        _cloth(canvas, rng, x, top, drop, z_m, slack)


def _cloth(
    canvas: Canvas, rng: np.random.Generator, x_m: float, top_m: float, drop_m: float, z_m: float, slack: bool
) -> None:
    """In folds, narrow at the top and cut off below; a ``slack`` one falls along its staff."""
    wide = rng.uniform(0.14, 0.5) if slack else rng.uniform(0.6, 1.4)
    down = np.linspace(0, 1, LEVELS)
    widths = wide * (0.2 + 0.8 * down ** rng.uniform(0.3, 1.5)) * rng.uniform(0.8, 1.15, LEVELS)
    side, behind = rng.choice([-1, 1]), rng.uniform(0.0, 0.5)  # the part of it on the far side of the staff
    folds = int(rng.integers(2, 6))
    bounds = np.sort(np.concatenate([[0.0, 1.0], rng.uniform(0.1, 0.9, folds - 1)]))
    edges = x_m + side * widths[:, None] * (bounds[None] - behind)
    shades = rng.uniform(0.5, 1.15, folds)
    ends = np.sort(rng.uniform(0.1, 0.9, rng.integers(0, 3)))
    first = grey(rng, 15, 255)  # mostly of one colour with an emblem: a lamp post is of one colour, too
    colours = [first if rng.random() < 0.6 else any_colour(rng, 15, 255) for _ in range(len(ends) + 1)]
    fading = np.linspace(rng.uniform(0.4, 1.2), rng.uniform(0.4, 1.2), LEVELS)
    slants = rng.normal(0, 0.12, folds + 1) * wide
    for i in range(LEVELS - 1):
        b, g, r = colours[int(np.searchsorted(ends, (i + 0.5) / (LEVELS - 1)))]
        y1, y2 = top_m - drop_m * down[i], top_m - drop_m * down[i + 1]
        for k in range(folds):
            last = slants[k : k + 2] if i == LEVELS - 2 else np.zeros(2)
            corners = [(edges[i, k], y1, z_m), (edges[i, k + 1], y1, z_m),
                       (edges[i + 1, k + 1], y2 + last[1], z_m), (edges[i + 1, k], y2 + last[0], z_m)]  # fmt: skip
            lit = [min(255.0, c * shades[k] * fading[i]) for c in (b, g, r)]
            canvas.surface(corners, (lit[0], lit[1], lit[2]))
