"""The street itself: where its lines run, and all that lies flat or far away."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from scpf.sample_logs.street_canvas import NEAREST_M, Canvas, Colour, Floats, Point, StreetCamera
from scpf.sample_logs.street_looks import any_colour, foliage, grey, smooth_noise

LEFT, RIGHT = -1, 1


@dataclass(frozen=True)
class Street:
    """A gently curved road with verges, seen by the camera of ``canvas``."""

    canvas: Canvas
    half_road_m: float
    shift_m: float
    curvature_per_m: float
    verge_m: float
    crowns: list[tuple[Floats, Floats]]  # leaves to cover all plants with

    @classmethod
    def random(cls, rng: np.random.Generator, width_px: int, height_px: int) -> Street:
        """A random street and camera."""
        camera = StreetCamera(rng, width_px, height_px)
        canvas = Canvas(camera, grey(rng, 120, 235), rng.uniform(120, 600), rng.uniform(-1, 1))
        return cls(
            canvas,
            half_road_m=rng.uniform(2.6, 7.0),
            shift_m=rng.uniform(-2.5, 2.5),
            curvature_per_m=rng.normal(0, 0.0007),
            verge_m=rng.uniform(1.0, 9.0),
            crowns=[foliage(rng) for _ in range(5)],
        )

    def x_m(self, side: int, beyond_kerb_m: float, z_m: float) -> float:
        """x of the place that lies so far beyond the kerb of one side (`LEFT` or `RIGHT`)."""
        bend = self.shift_m + self.curvature_per_m * z_m * z_m
        return float(bend + side * (self.half_road_m + beyond_kerb_m))

    def strip(
        self,
        from_kerb: tuple[int, float],
        to_kerb: tuple[int, float],
        z1_m: float,
        z2_m: float,
        colour: Colour,
    ) -> None:
        """A band of the ground between two lines along the street, each (side, metres beyond its kerb)."""
        zs = np.geomspace(z1_m, z2_m, 2 + int(6 * np.log(z2_m / z1_m)))
        line: list[Point] = [(self.x_m(*from_kerb, z), 0.0, z) for z in zs]
        line += [(self.x_m(*to_kerb, z), 0.0, z) for z in zs[::-1]]
        self.canvas.surface(line, colour)


def paint_ground(street: Street, rng: np.random.Generator) -> None:
    """Sky and clouds, distant woods and roofs, verges, pavements, road, markings, cracks."""
    canvas = street.canvas
    height, width = canvas.camera.height_px, canvas.camera.width_px
    horizon_px = float(np.clip(canvas.camera.project([(0.0, 0.0, 4000.0)])[0][0, 1], 1, height - 1))
    grain = np.sum([smooth_noise(rng, (height, width), cell) for cell in (2.5, 7, 40)], axis=0)
    soil = np.array(any_colour(rng, 30, 150)) + (grain * rng.uniform(3, 16))[..., None]
    below = (np.arange(height) > horizon_px)[:, None, None]
    picture = np.where(below, soil, _sky(rng, (height, width), horizon_px))
    canvas.image[:] = np.clip(picture, 0, 255).astype(np.uint8)
    _paint_backdrop(canvas, rng, horizon_px)
    _paint_road(street, rng)
    worn = canvas.image + below * grain[..., None] * rng.uniform(1, 7)
    canvas.image[:] = np.clip(worn, 0, 255).astype(np.uint8)


def _sky(rng: np.random.Generator, shape: tuple[int, int], horizon_px: float) -> Floats:
    blue = (rng.uniform(150, 255), rng.uniform(100, 200), rng.uniform(50, 150))
    top = np.array(blue if rng.random() < 0.6 else any_colour(rng, 50, 240))
    low = np.array(any_colour(rng, 120, 250))
    down = np.clip(np.arange(shape[0]) / horizon_px, 0, 1)[:, None, None]
    clouds = smooth_noise(rng, shape, 90) + 0.5 * smooth_noise(rng, shape, 25)
    white = np.clip(clouds - rng.uniform(-0.3, 2.0), 0, 1) * rng.uniform(0, 80)
    return np.asarray(top * (1 - down) + low * down + white[..., None])


def _paint_backdrop(canvas: Canvas, rng: np.random.Generator, horizon_px: float) -> None:
    """Far woods and roofs, one silhouette behind the other."""
    width = canvas.ids.shape[1]
    for i in range(rng.integers(0, 4)):
        tall_px = canvas.camera.focal_px * rng.uniform(0.01, 0.09)
        shape = smooth_noise(rng, (2, width), 60)[0] + 0.3 * smooth_noise(rng, (2, width), 6)[0]
        if rng.random() < 0.4:
            shape = np.repeat(shape[::30], 30)[:width]  # roofs
        ridge = horizon_px - tall_px * np.clip(1 + 0.6 * shape, -0.5, 3)
        outline = np.stack([np.arange(width, dtype=np.float64), ridge], axis=1)
        outline = np.vstack([outline, [(width, horizon_px + 3), (0, horizon_px + 3)]])
        canvas.polygon(outline, canvas.hazed(any_colour(rng, 20, 130), 250.0 - 60 * i))


def _paint_road(street: Street, rng: np.random.Generator) -> None:
    canvas = street.canvas
    street.strip((LEFT, 0), (RIGHT, 0), 1.9, 300, grey(rng, 40, 140))
    for side in (LEFT, RIGHT):
        if rng.random() < 0.6:
            street.strip((side, 0.25), (side, rng.uniform(1.5, 4.0)), 1.9, 300, grey(rng, 70, 200))
        street.strip((side, 0), (side, rng.uniform(0.12, 0.3)), 1.9, 300, grey(rng, 20, 230))
    for line_m in (-2 * street.half_road_m + 0.3, -street.half_road_m, -0.3):
        length_m = 3 if rng.random() < 0.6 else 6
        if rng.random() < 0.75:
            paint = grey(rng, 150, 245)
            for z in np.arange(2.5, 70, 6.0):
                street.strip((RIGHT, line_m), (RIGHT, line_m + 0.13), z, z + length_m, paint)
    for _ in range(rng.integers(0, 8)):  # cracks
        start = np.array([rng.uniform(-1, 1) * street.half_road_m, 0.0, rng.uniform(3, 20)])
        path = start + np.cumsum(rng.normal(0, (0.25, 0, 0.5), (12, 3)), axis=0)
        pixels = canvas.camera.project(np.maximum(path, (-99, 0, 2.0)))[0]
        cv2.polylines(canvas.image, [pixels.astype(np.int32)], False, grey(rng, 10, 90), 1, cv2.LINE_AA)


def paint_shadows(street: Street, rng: np.random.Generator) -> None:
    """Hard shadows across the ground, of posts as well as of trees and walls."""
    canvas = street.canvas
    shade = np.zeros(canvas.ids.shape, np.uint8)
    for _ in range(rng.integers(1, 9) if rng.random() < 0.65 else 0):
        z, x1, length_m, slant = (
            rng.uniform(3, 35),
            rng.uniform(-12, 8),
            rng.uniform(2, 14),
            rng.normal(0, 1.5),
        )
        wide = rng.uniform(0.08, 0.3) if rng.random() < 0.5 else rng.uniform(0.5, 4)
        x2 = x1 + length_m
        strip: list[Point] = [(x1, 0, z), (x2, 0, z + slant), (x2, 0, z + slant + wide), (x1, 0, z + wide)]
        pixels, depth = canvas.camera.project(strip)
        if depth.min() > NEAREST_M:
            cv2.fillPoly(shade, [np.clip(pixels, -8000, 8000).astype(np.int32)], 255, cv2.LINE_AA)
    if shade.any():
        ragged = smooth_noise(rng, (canvas.camera.height_px, canvas.camera.width_px), 9) > rng.uniform(
            -2.5, 0.3
        )
        opacity = cv2.GaussianBlur((shade * ragged).astype(np.float32), (0, 0), 1.2)[..., None] / 255
        canvas.image[:] = (canvas.image * (1 - opacity * rng.uniform(0.3, 0.75))).astype(np.uint8)


def paint_cables(street: Street, rng: np.random.Generator) -> None:
    """Cables across the sky, in front of everything."""
    canvas = street.canvas
    for _ in range(rng.integers(1, 5) if rng.random() < 0.25 else 0):
        z, y, sag = rng.uniform(8, 40), rng.uniform(6, 11), rng.uniform(0, 0.8)
        xs = np.linspace(-40, 40, 30)
        points: Floats = np.stack([xs, y - sag * np.cos(xs / 20), z + xs * rng.normal(0, 0.3)], axis=1)
        pixels = canvas.camera.project(np.maximum(points, (-99, 0, 3.0)))[0]
        cv2.polylines(canvas.image, [pixels.astype(np.int32)], False, grey(rng, 10, 80), 1, cv2.LINE_AA)
