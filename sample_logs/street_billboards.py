"""Billboards on posts, framed boards, and the printed matter on them.

Every function draws one object at (x_m, z_m) of the street frame; see `street_canvas`.
"""

from __future__ import annotations

import cv2
import numpy as np

from scpf.models.instances import Image
from scpf.sample_logs.street_canvas import Canvas, Colour, Point, Tube
from scpf.sample_logs.street_looks import any_colour, grey, smooth_noise

FROM_BEHIND = 0.3
ON_A_BASE = 0.4
BESIDE = 0.5  # share whose posts are the board's frame, and go on to its upper edge
PRINTED_PX_PER_M = 48


def billboard(canvas: Canvas, rng: np.random.Generator, x_m: float, z_m: float) -> None:
    """A board on two posts, tall ones as well as low ones, often on a base of concrete."""
    wide, low, high = rng.uniform(1.0, 4.0), rng.uniform(0.5, 3.5), rng.uniform(0.8, 3.0)
    radius, beside = rng.uniform(0.04, 0.11), rng.random() < BESIDE
    apart, foot = wide + 2 * radius if beside else wide * rng.uniform(0.55, 1.0), 0.0
    spots = (x_m - apart / 2, x_m + apart / 2)
    if rng.random() < ON_A_BASE:
        across, foot, stone = rng.uniform(0.6, 1.6), rng.uniform(0.2, 0.7), grey(rng, 60, 240)
        for x in spots:
            base(canvas, (x, z_m), (across, foot), stone)
    tall = max(low + high * rng.uniform(0.8, 1.05), foot)
    posts = [Tube((x, foot, z_m), (x, tall, z_m), radius, radius) for x in spots]
    metal = grey(rng, 40, 235)
    behind = rng.random() < FROM_BEHIND
    if not behind:
        canvas.tubes(posts, metal)
    corners = _corners((x_m - wide / 2, low, z_m), (wide, high))
    canvas.texture(corners, _back(rng, wide, high) if behind else poster(rng, wide, high))
    if behind or beside:
        canvas.tubes(posts, metal)


def board(canvas: Canvas, rng: np.random.Generator, x_m: float, y_m: float, z_m: float) -> None:
    """A framed board, a poster or a box that hangs on a post; ``y_m``: its lower edge."""
    wide, high = ((0.2, 0.4), (0.45, 0.6), (0.7, 1.1))[rng.integers(3)] * rng.uniform(0.7, 1.4, 2)
    left, frame = x_m - wide * rng.choice([0.5, rng.uniform(0.0, 1.0)]), 0.06
    canvas.surface(_corners((left, y_m, z_m), (wide, high)), grey(rng, 20, 250))
    inside = _corners((left + frame, y_m + frame, z_m), (wide - 2 * frame, high - 2 * frame))
    canvas.surface(inside, any_colour(rng, 20, 250))


def base(canvas: Canvas, spot_m: tuple[float, float], size_m: tuple[float, float], colour: Colour) -> None:
    """A block of concrete or rubber under a post at ``spot_m`` (x, z); ``size_m``: width, which is depth, height."""
    (x, z), (wide, high) = spot_m, size_m
    left, right, near, far = x - wide / 2, x + wide / 2, z - wide / 2, z + wide / 2
    b, g, r = (min(level * 1.2, 255.0) for level in colour)
    canvas.surface(
        [(left, high, near), (right, high, near), (right, high, far), (left, high, far)], (b, g, r)
    )
    canvas.surface([(left, 0, near), (right, 0, near), (right, high, near), (left, high, near)], colour)


def poster(rng: np.random.Generator, width_m: float, height_m: float) -> Image:
    """Printed matter: soft shapes as of a photograph, fields of one colour, lines of letters, a frame."""
    w, h = int(width_m * PRINTED_PX_PER_M), int(height_m * PRINTED_PX_PER_M)
    ground = np.asarray(any_colour(rng, 20, 250), np.float32)
    picture = np.clip(ground + smooth_noise(rng, (h, w), w / rng.uniform(1.5, 5))[..., None] * 25, 0, 255)
    printed = np.ascontiguousarray(picture.astype(np.uint8))
    for _ in range(rng.integers(0, 9)):
        middle = (int(rng.uniform(0, w)), int(rng.uniform(0, h)))
        axes = (int(w * rng.uniform(0.03, 0.4)), int(h * rng.uniform(0.03, 0.25)))
        cv2.ellipse(printed, middle, axes, rng.uniform(0, 180), 0, 360, any_colour(rng, 10, 250), -1)
    printed = np.asarray(cv2.GaussianBlur(printed, (0, 0), rng.uniform(0.5, 4.0)), np.uint8)
    for _ in range(rng.integers(0, 3)):
        top = int(rng.choice([0, rng.uniform(0.5, 0.9)]) * h)
        printed[top : top + int(rng.uniform(0.1, 0.4) * h)] = any_colour(rng, 10, 250)
    for _ in range(rng.integers(0, 4)):
        _letters(printed, rng)
    edge = int(rng.choice([0, rng.uniform(0.03, 0.12)]) * PRINTED_PX_PER_M)
    if edge:
        cv2.rectangle(printed, (0, 0), (w - 1, h - 1), grey(rng, 20, 250), edge)
    return printed


def _letters(printed: Image, rng: np.random.Generator) -> None:
    """A line of what looks like letters from afar."""
    h, w = printed.shape[:2]
    tall, ink = max(2, int(h * rng.uniform(0.03, 0.12))), any_colour(rng, 0, 255)
    x, end, y = w * rng.uniform(0.03, 0.4), w * rng.uniform(0.5, 0.97), int(h * rng.uniform(0.05, 0.9))
    while x < end:
        wide = tall * rng.uniform(0.15, 0.6)
        up = int(tall * rng.choice([1.0, 0.7]))
        cv2.rectangle(printed, (int(x), y + tall - up), (int(x + wide), y + tall), ink, -1)
        x += wide + tall * rng.choice([0.2, 0.7], p=[0.8, 0.2])


def _back(rng: np.random.Generator, width_m: float, height_m: float) -> Image:
    """The grey back of a board, with ribs."""
    w, h = int(width_m * PRINTED_PX_PER_M), int(height_m * PRINTED_PX_PER_M)
    picture = np.full((h, w, 3), grey(rng, 20, 150), np.uint8)
    for y in np.linspace(0, h - 1, int(rng.integers(2, 6))):
        cv2.line(picture, (0, int(y)), (w, int(y)), grey(rng, 20, 180), int(rng.integers(1, 4)))
    return picture


def _corners(corner_m: Point, size_m: tuple[float, float]) -> list[Point]:
    """Of a rectangle that faces the camera, from its lower left one on, counter-clockwise."""
    (x, y, z), (wide, high) = corner_m, size_m
    return [(x, y, z), (x + wide, y, z), (x + wide, y + high, z), (x, y + high, z)]
