"""House fronts and building sites: edges, pipes and tubes that are no lamp posts."""

from __future__ import annotations

import cv2
import numpy as np

from scpf.models.instances import Image
from scpf.sample_logs.street_canvas import Canvas, Tube
from scpf.sample_logs.street_looks import any_colour, grey, smooth_noise

FACADE_PX_PER_M = 20


def facade(rng: np.random.Generator, width_m: float, height_m: float) -> Image:
    """The picture of a house front: plaster, bricks or boards, windows, drain pipes, bands."""
    h, w = int(height_m * FACADE_PX_PER_M), int(width_m * FACADE_PX_PER_M)
    base = np.asarray(any_colour(rng, 40, 235) if rng.random() < 0.5 else grey(rng, 60, 250), np.float32)
    relief = smooth_noise(rng, (h, w), 30) * rng.uniform(1, 10) + smooth_noise(rng, (h, w), 3) * rng.uniform(
        0, 12
    )
    picture = np.clip(base + relief[..., None], 0, 255).astype(np.uint8)
    dark, light = (base * rng.uniform(0.3, 0.8)).tolist(), np.minimum(base * 1.3 + 15, 255).tolist()
    if rng.random() < 0.3:  # bricks or boards
        picture[:: max(2, int(rng.uniform(3, 12)))] = np.clip(base * 0.75, 0, 255).astype(np.uint8)
    glass = grey(rng, 10, 140)
    floor_m, bay_m = rng.uniform(2.6, 3.6), rng.uniform(1.8, 4.0)
    wide, high = bay_m * rng.uniform(0.3, 0.75), floor_m * rng.uniform(0.35, 0.7)
    scale = FACADE_PX_PER_M
    for level in np.arange(0.7, height_m - high, floor_m):
        if rng.random() < 0.2:
            cv2.rectangle(picture, (0, int(h - level * scale)), (w, int(h - level * scale) + 3), light, -1)
        for left in np.arange(0.6, width_m - wide, bay_m):
            a = (int(left * scale), int(h - (level + high) * scale))
            b = (int((left + wide) * scale), int(h - level * scale))
            cv2.rectangle(picture, a, b, light if rng.random() < 0.5 else dark, -1)
            cv2.rectangle(
                picture,
                (a[0] + 2, a[1] + 2),
                (b[0] - 2, b[1] - 2),
                tuple(c * rng.uniform(0.6, 1.4) for c in glass),
                -1,
            )
            if rng.random() < 0.6:
                middle = (a[0] + b[0]) // 2
                cv2.line(picture, (middle, a[1]), (middle, b[1]), light, 1)
    for _ in range(rng.integers(0, 4)):  # drain pipes
        x = int(rng.uniform(0, w))
        cv2.line(picture, (x, 0), (x, h), dark, int(rng.integers(1, 4)))
        cv2.line(picture, (x + 2, 0), (x + 2, h), light, 1)
    return picture


def scaffold(
    canvas: Canvas, rng: np.random.Generator, x_m: float, z_m: float, length_m: float, height_m: float
) -> None:
    """Two layers of tubes and planks before a façade that runs along the street."""
    bay, lift = rng.uniform(1.8, 3.0), rng.uniform(1.7, 2.2)
    zs, ys = np.arange(z_m, z_m + length_m, bay), np.arange(0, height_m + rng.uniform(0, 2), lift)
    r = rng.uniform(0.02, 0.04)
    tubes = []
    for depth in (np.sign(x_m) * 0.9, 0.0):
        tubes += [
            Tube((x_m + depth, 0, z), (x_m + depth, ys[-1] + 1.0, z), r, r, rng.uniform(0.7, 1.3)) for z in zs
        ]
        tubes += [Tube((x_m + depth, y + 0.02, zs[0]), (x_m + depth, y + 0.02, zs[-1]), r * s, r * s)
                  for y in ys[1:] for s in (1.0, 2.0)]  # fmt: skip
        tubes += [Tube((x_m + depth, y + 1.0, zs[0]), (x_m + depth, y + 1.0, zs[-1]), r, r) for y in ys]
    for y in ys[:-1]:
        i = int(rng.integers(0, max(1, len(zs) - 1)))
        if i + 1 < len(zs):
            tubes.append(Tube((x_m, y, zs[i]), (x_m, y + lift, zs[i + 1]), r, r))
    canvas.tubes(tubes, grey(rng, 40, 230))


def lumber(canvas: Canvas, rng: np.random.Generator, x_m: float, z_m: float) -> None:
    """Boards, panels and props side by side, as on a building site: leaning ones and upright ones."""
    high, upright = rng.uniform(1.5, 4.0), rng.random() < 0.4
    gap, lean = rng.uniform(0.1, 0.6), 0.0 if upright else rng.normal(0.2, 0.2)
    wide = rng.uniform(0.025, 0.12)
    tubes, x = [], x_m
    for _ in range(int(rng.integers(3, 14))):
        x += gap * rng.uniform(0.5, 1.5)
        r = wide * rng.uniform(0.6, 1.4)
        tip = (x + lean + rng.normal(0.0, 0.03 if upright else 0.2), high * rng.uniform(0.7, 1.1), z_m)
        tubes.append(Tube((x, 0, z_m), tip, r, r, rng.uniform(0.4, 1.3)))
    canvas.tubes(tubes, grey(rng, 60, 220, 25))


def site_fence(canvas: Canvas, rng: np.random.Generator, x_m: float, z_m: float) -> None:
    """Panels of thin mesh whose tubes stand two by two in blocks of concrete, along the street or across."""
    wide, high, count = rng.uniform(2.0, 3.5), rng.uniform(1.7, 2.3), int(rng.integers(1, 5))
    across = rng.random() < 0.4
    step = np.array((wide * np.sign(x_m), 0.0)) if across else np.array((0.0, wide))
    r, metal, block = rng.uniform(0.018, 0.035), grey(rng, 60, 230), grey(rng, 70, 240)
    mesh, gap = r * 0.2, rng.uniform(0.1, 0.25)
    for i in reversed(range(count)):
        first, last = np.array((x_m, z_m)) + i * step, np.array((x_m, z_m)) + (i + 0.96) * step
        (xa, za), (xb, zb) = first.tolist(), last.tolist()
        tubes = [Tube((x, 0.05, z), (x, high, z), r, r) for x, z in ((xa, za), (xb, zb))]
        tubes += [Tube((xa, y, za), (xb, y, zb), r, r) for y in (0.2, high)]
        tubes += [Tube((xa, y, za), (xb, y, zb), mesh, mesh) for y in np.arange(0.2, high, gap * 2)]
        for u in np.arange(gap / wide, 1, gap / wide):
            x, z = xa + u * (xb - xa), za + u * (zb - za)
            tubes.append(Tube((x, 0.2, z), (x, high, z), mesh, mesh))
        canvas.tubes(tubes, metal)
        foot = [(x, y, za) for x, y in ((xa - 0.35, 0), (xa + 0.35, 0), (xa + 0.3, 0.16), (xa - 0.3, 0.16))]
        canvas.surface(foot, block)
        if rng.random() < 0.25:  # a plate that warns
            u, y = rng.uniform(0.2, 0.4), high * rng.uniform(0.5, 0.8)
            (xa, za), (xb, zb) = (first + share * (last - first) for share in (u, u + rng.uniform(0.1, 0.3)))
            corners = [(xa, y, za), (xb, y, zb), (xb, y + 0.25, zb), (xa, y + 0.25, za)]
            canvas.surface(corners, grey(rng, 120, 255))
