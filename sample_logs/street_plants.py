"""Trees, young trees tied to stakes, bushes: leaves that hide lamp posts and stems that resemble them."""

from __future__ import annotations

import numpy as np

from scpf.sample_logs.street_canvas import Canvas, Floats, Tube
from scpf.sample_logs.street_looks import grey


def tree(
    canvas: Canvas, rng: np.random.Generator, x_m: float, z_m: float, crowns: list[tuple[Floats, Floats]]
) -> None:
    """A leafy tree, a young one tied to stakes, a bare one or a fir."""
    kind = rng.choice(["leafy", "young", "bare", "fir"], p=[0.35, 0.37, 0.15, 0.13])
    bark = grey(rng, 15, 120, 15)
    height = rng.uniform(3.5, 7.0) if kind == "young" else rng.uniform(4, 13)
    radius = rng.uniform(0.03, 0.07) if kind == "young" else rng.uniform(0.07, 0.3)
    bend = x_m + rng.normal(0, 0.2)
    fork = height * rng.uniform(0.25, 0.5)
    tip = (bend + rng.normal(0, 0.2), height * 0.85, z_m)
    trunk = [
        Tube((x_m, 0, z_m), (bend, fork, z_m), radius, radius * 0.8),
        Tube((bend, fork, z_m), tip, radius * 0.8, radius * 0.4),
    ]
    if kind == "bare":
        for _ in range(rng.integers(8, 24)):
            start = (bend, rng.uniform(fork, height * 0.8), z_m)
            twig = (bend + rng.normal(0, height * 0.2), start[1] + rng.uniform(0.3, 0.35 * height), z_m)
            trunk.append(Tube(start, twig, radius * 0.3, radius * 0.1))
    if kind == "young":
        spread, tall = rng.uniform(0.25, 0.7), rng.uniform(1.2, 2.4)
        stake = rng.uniform(0.035, 0.07)
        feet = rng.uniform(0, 6.3) + np.arange(rng.integers(2, 5)) * 2 * np.pi / 3
        slant = rng.uniform(0.4, 1.0)
        posts = [((x_m + spread * np.cos(a)), z_m + spread * np.sin(a)) for a in feet]
        wood = [
            Tube((x, 0, z), (x_m + slant * (x - x_m), tall, z_m + slant * (z - z_m)), stake, stake)
            for x, z in posts
        ]
        if rng.random() < 0.7:
            wood.append(
                Tube((x_m - slant * spread, tall, z_m), (x_m + slant * spread, tall, z_m), 0.03, 0.03)
            )
        canvas.tubes(wood, grey(rng, 50, 220, 20))
    canvas.tubes(trunk, bark)
    if kind == "bare":
        return
    green = (rng.uniform(10, 60), rng.uniform(35, 140), rng.uniform(15, 100))
    px_per_m = canvas.camera.focal_px / z_m
    for i in range(7 if kind == "fir" else rng.integers(2, 6)):
        if kind == "fir":
            level, wide, high = height * (0.2 + 0.12 * i), height * 0.09 * (7.5 - i), height * 0.35
            centre = (x_m, level, z_m)
        else:
            wide, high = height * rng.uniform(0.25, 0.6), height * rng.uniform(0.25, 0.55)
            centre = (bend + rng.normal(0, height * 0.09), height * rng.uniform(0.55, 0.88), z_m)
        pixel = canvas.camera.project([centre])[0][0]
        alpha, shade = crowns[rng.integers(len(crowns))]
        canvas.stamp(alpha, shade, pixel, (wide * px_per_m, high * px_per_m), canvas.hazed(green, z_m))


def bush(
    canvas: Canvas, rng: np.random.Generator, x_m: float, z_m: float, crowns: list[tuple[Floats, Floats]]
) -> None:
    """A bush or a piece of hedge."""
    alpha, shade = crowns[rng.integers(len(crowns))]
    high, wide = rng.uniform(0.5, 2.5), rng.uniform(1.0, 5.0)
    pixel = canvas.camera.project([(x_m, high * 0.4, z_m)])[0][0]
    px_per_m = canvas.camera.focal_px / z_m
    green = (rng.uniform(10, 60), rng.uniform(30, 130), rng.uniform(15, 100))
    canvas.stamp(alpha, shade, pixel, (wide * px_per_m, high * px_per_m), canvas.hazed(green, z_m))
