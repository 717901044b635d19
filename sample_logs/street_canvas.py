"""A painter's canvas for street scenes: image and instance ids are drawn together, far things first.

Colours are BGR, 0 to 255. Street frame: x right, y up from the road, z forward, in metres; the camera stands
at x = 0, z = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from scpf.models.instances import Image
from scpf.models.painting import SUBPIXEL_BITS, fill_polygon

Floats = NDArray[np.floating[Any]]
Colour = tuple[float, float, float]
Point = tuple[float, float, float]

OVERSAMPLING = 4  # tubes are covered on a 4 times finer grid: OpenCV's own edges make a 4 px pole 5 px thick
NEAREST_M = 1.5  # nothing nearer than this is drawn: it would need clipping at the image plane


class Tube(NamedTuple):
    """A straight, round, tapered piece from ``start_m`` to ``end_m``; ``shade`` multiplies the colour."""

    start_m: Point
    end_m: Point
    start_radius_m: float
    end_radius_m: float
    shade: float = 1.0


class StreetCamera:
    """A pinhole camera with a random focal length, height, pitch and roll."""

    def __init__(self, rng: np.random.Generator, width_px: int, height_px: int) -> None:
        self.width_px, self.height_px = width_px, height_px
        self.focal_px = width_px * rng.uniform(0.5, 1.15)
        self.height_m = rng.uniform(1.4, 2.4)
        pitch = np.arctan(rng.normal(0.0, 0.07) * height_px / self.focal_px)
        roll = np.deg2rad(rng.normal(0, 0.8))
        cp, sp, cr, sr = np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
        self.R_camera_street = np.array([[cr, sr, 0], [-sr, cr, 0], [0, 0, 1]]) @ np.array(
            [[1, 0, 0], [0, cp, sp], [0, -sp, cp]]
        )

    def project(self, points_m: Sequence[Point] | Floats) -> tuple[Floats, Floats]:
        """Pixels (N, 2) and depths (N,) in metres of street points (N, 3)."""
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 3) - (0.0, self.height_m, 0.0)
        x, y, z = self.R_camera_street @ points.T
        depth = np.maximum(z, 0.3)
        pixels = np.stack([self.width_px / 2 + self.focal_px * x / depth,
                           self.height_px / 2 - self.focal_px * y / depth], axis=1)  # fmt: skip
        return pixels, z


class Canvas:
    """``image`` (H, W, 3) uint8 BGR and ``ids`` (H, W) uint8, 0 where no lamp post is seen."""

    def __init__(self, camera: StreetCamera, haze_colour: Colour, haze_range_m: float, light: float) -> None:
        shape = (camera.height_px, camera.width_px)
        self.camera = camera
        self.image: Image = np.zeros((*shape, 3), np.uint8)
        self.ids: NDArray[np.uint8] = np.zeros(shape, np.uint8)
        self._haze_colour, self._haze_range_m, self._light = haze_colour, haze_range_m, light

    def hazed(self, colour: Colour, depth_m: float) -> Colour:
        """The colour as the air between lets it through."""
        clear = float(np.exp(-depth_m / self._haze_range_m))
        b, g, r = (c * clear + h * (1 - clear) for c, h in zip(colour, self._haze_colour, strict=True))
        return b, g, r

    def polygon(self, points_px: Floats | Sequence[Floats], colour: Colour) -> None:
        """Fills a polygon; it hides the lamp posts behind it."""
        fill_polygon(self.image, self.ids, points_px, colour)

    def surface(self, points_m: Sequence[Point] | Floats, colour: Colour) -> None:
        """Fills a polygon given in the street frame, unless a corner is too near."""
        pixels, depth = self.camera.project(points_m)
        if depth.min() > NEAREST_M:
            self.polygon(pixels, self.hazed(colour, float(depth.mean())))

    def tubes(self, tubes: Sequence[Tube], colour: Colour, instance_id: int = 0) -> None:
        """Draws round pieces of one object, with light and shade across, exactly covered pixels.

        ``ids`` becomes ``instance_id`` where at least half of a pixel is covered.
        """
        ends, depth = self.camera.project(np.array([p for t in tubes for p in (t.start_m, t.end_m)]))
        ends, depth = ends.reshape(-1, 2, 2), depth.reshape(-1, 2)
        radii = np.array([(t.start_radius_m, t.end_radius_m) for t in tubes])
        half = self.camera.focal_px * radii / np.maximum(depth, NEAREST_M)
        seen = depth.min(axis=1) > NEAREST_M
        if not seen.any():
            return
        reach = half[seen].max() + 2
        x1, y1 = np.maximum(np.floor(ends[seen].min(axis=(0, 1)) - reach), 0).astype(int)
        size = (self.camera.width_px, self.camera.height_px)
        x2, y2 = np.minimum(np.ceil(ends[seen].max(axis=(0, 1)) + reach), size).astype(int)
        if x2 <= x1 or y2 <= y1:
            return
        fine = np.zeros(((y2 - y1) * OVERSAMPLING, (x2 - x1) * OVERSAMPLING), np.uint8)
        for tube, pair, width in zip(
            np.array([t.shade for t in tubes])[seen], ends[seen] - (x1, y1), half[seen], strict=True
        ):
            _shade_tube(fine, pair * OVERSAMPLING, width * OVERSAMPLING, float(tube), self._light)
        near = self.hazed(colour, float(depth[seen].mean()))
        self._blend_shade(fine, slice(y1, y2), slice(x1, x2), near, instance_id)

    def _blend_shade(
        self, fine: NDArray[np.uint8], rows: slice, columns: slice, colour: Colour, instance_id: int
    ) -> None:
        """Lays an oversampled shade (0: nothing there, 100: the colour itself) over a part of the image."""
        height, width = fine.shape[0] // OVERSAMPLING, fine.shape[1] // OVERSAMPLING
        covered = (fine > 0).astype(np.uint8) * np.uint8(255)
        cover = cv2.resize(covered, (width, height), interpolation=cv2.INTER_AREA)
        shade = cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA)
        y, x = np.nonzero(cover)
        alpha = cover[y, x].astype(np.float32)[:, None] / 255
        part = self.image[rows, columns]
        lit = shade[y, x].astype(np.float32)[:, None] / 100 * np.asarray(colour, np.float32)
        part[y, x] = np.clip(part[y, x] * (1 - alpha) + lit, 0, 255).astype(np.uint8)
        self.ids[rows, columns][cover >= 128] = instance_id

    def seen_along(self, start_m: Floats, end_m: Floats) -> Floats:
        """The mean colour (3,) of what has been drawn between two points so far; grey where none is in the picture."""
        pixels, _ = self.camera.project(np.linspace(start_m, end_m, 24))
        x, y = np.floor(pixels).astype(int).T
        inside = (x >= 0) & (x < self.camera.width_px) & (y >= 0) & (y < self.camera.height_px)
        seen = self.image[y[inside], x[inside]]
        return np.asarray(seen.mean(axis=0) if len(seen) else np.full(3, 110.0))

    def stamp(
        self, alpha: Floats, shade: Floats, centre_px: Floats, size_px: tuple[float, float], colour: Colour
    ) -> None:
        """Lays a texture (h, w), opacity ``alpha`` 0 to 1 and brightness ``shade``, scaled to ``size_px``."""
        width, height = max(2, round(size_px[0])), max(2, round(size_px[1]))
        left, top = round(float(centre_px[0]) - width / 2), round(float(centre_px[1]) - height / 2)
        x1, y1 = max(left, 0), max(top, 0)
        x2, y2 = min(left + width, self.camera.width_px), min(top + height, self.camera.height_px)
        if x2 <= x1 or y2 <= y1 or width > 3000 or height > 3000:
            return
        shrinking = width < alpha.shape[1]
        method = cv2.INTER_AREA if shrinking else cv2.INTER_LINEAR
        crop = np.s_[y1 - top : y2 - top, x1 - left : x2 - left]
        opacity = cv2.resize(alpha, (width, height), interpolation=method)[crop][..., None]
        lit = cv2.resize(shade, (width, height), interpolation=method)[crop][..., None]
        part = self.image[y1:y2, x1:x2]
        mixed = part * (1 - opacity) + opacity * lit * np.asarray(colour, np.float32)
        part[:] = np.clip(mixed, 0, 255).astype(np.uint8)
        self.ids[y1:y2, x1:x2][opacity[..., 0] >= 0.5] = 0

    def texture(self, corners_m: Sequence[Point], texture: Image) -> None:
        """Hangs a picture on a quadrilateral (lower near, lower far, upper far, upper near corner)."""
        pixels, depth = self.camera.project(corners_m)
        if depth.min() < NEAREST_M:
            return
        x1, y1 = np.maximum(np.floor(pixels.min(axis=0)), 0).astype(int)
        x2, y2 = np.minimum(
            np.ceil(pixels.max(axis=0)) + 1, (self.camera.width_px, self.camera.height_px)
        ).astype(int)
        if x2 - x1 < 2 or y2 - y1 < 2:
            return
        h, w = texture.shape[:2]
        source = np.array([(0, h), (w, h), (w, 0), (0, 0)], np.float32)
        to_image = cv2.getPerspectiveTransform(source, (pixels - (x1, y1)).astype(np.float32))
        clear = float(np.exp(-depth.mean() / self._haze_range_m))
        hazed = cv2.addWeighted(
            texture, clear, np.full_like(texture, np.asarray(self._haze_colour, np.uint8)), 1 - clear, 0
        )
        size = (int(x2 - x1), int(y2 - y1))
        warped = cv2.warpPerspective(hazed, to_image, size, borderMode=cv2.BORDER_REPLICATE)
        inside = np.zeros((y2 - y1, x2 - x1), np.uint8)
        cv2.fillConvexPoly(inside, np.round(np.clip(pixels - (x1, y1), -30000, 30000)).astype(np.int32), 1)
        self.image[y1:y2, x1:x2][inside > 0] = warped[inside > 0]
        self.ids[y1:y2, x1:x2][inside > 0] = 0


def _shade_tube(fine: NDArray[np.uint8], ends: Floats, half: Floats, shade: float, light: float) -> None:
    """Stripes along one tube: brightest towards the light (-1 left to 1 right), darker at the rims."""
    along = ends[1] - ends[0]
    across = np.array([-along[1], along[0]]) / (np.linalg.norm(along) + 1e-6)
    half = np.maximum(half - 0.5, 0.0)  # fillPoly paints the pixels of the outline as well
    stripes = 5 if half.max() > 5 else 1
    edges = np.linspace(-1, 1, stripes + 1)
    for left, right in pairwise(edges):
        middle = (left + right) / 2
        side = -1.0 if across[0] < 0 else 1.0  # the light comes from the side whichever end is drawn first
        lit = (
            1.0
            if stripes == 1
            else 0.5 + 0.75 * max(0.0, 0.6 * np.sqrt(1 - middle**2) + 0.4 * middle * light * side)
        )
        quad = [ends[0] + across * half[0] * left, ends[1] + across * half[1] * left,
                ends[1] + across * half[1] * right, ends[0] + across * half[0] * right]  # fmt: skip
        fixed = np.round((np.clip(quad, -20000, 20000) - 0.5) * (1 << SUBPIXEL_BITS)).astype(np.int32)
        value = int(np.clip(100 * shade * lit, 1, 250))
        cv2.fillPoly(fine, [fixed], value, cv2.LINE_8, SUBPIXEL_BITS)
