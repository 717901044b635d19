"""Instances of lamp poles along a straight road, by pinhole geometry: samples of known distance, without a picture.

Poles of 8 m stand 6 m beside the road, every 27 m, left and right in turn, each with its own height, tilt, base
and thickness as built; the camera sits 2 m above the road, looks 6° down, and rolls past with a driver's heading
and a car's pitch. Box and outline of an instance carry a detector's errors, each its own. Deviations are those of
the sketch that the features were first studied with.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.camera import Camera
from scpf.models.features import Features, measure
from scpf.models.instances import Instance
from scpf.replay.distance_training import Samples

Array = NDArray[np.float64]

WIDTH_PX: Final = 2048
HEIGHT_PX: Final = 1536
FOCAL_PX: Final = 1300.0
CAMERA_UP_M: Final = 2.0
CAMERA_PITCH_RAD: Final = float(np.radians(6.0))
DISTORTION: Final = -0.01
"""What is left of the lens' barrel distortion after rectification (per squared tangent)."""

SPACING_M: Final = 27.0
ARM_M: Final = 1.8
BASE_DIAMETER_M: Final = 0.22
TOP_DIAMETER_M: Final = 0.12
REACH_M: Final = (3.0, 50.0)


@dataclass(frozen=True)
class Pole:
    """A pole ``along`` and ``across`` the road (left positive, m), its base above the road and its height (m).

    ``lean``: metres to the left a metre of height; ``arm``: side of the arm, +1 left.
    """

    along: float
    across: float
    base_m: float
    height_m: float
    lean: float
    arm: float


def simulate(
    rng: np.random.Generator,
    images: int = 230,
    poles: int = 45,
    map_error_m: tuple[float, float] = (0.0, 0.0),
) -> Samples:
    """Samples of a drive of so many images, at random places, past so many poles.

    A sample's distance is that to the mapped pole, which is off by ``map_error_m`` (least, most).
    """
    column = [_pole(k, rng) for k in range(poles)]
    off, towards = rng.uniform(*map_error_m, poles), rng.uniform(0.0, 2.0 * np.pi, poles)
    instances: list[Instance] = []
    rows: list[tuple[float, str, int]] = []
    for k, along in enumerate(np.sort(rng.uniform(0.0, SPACING_M * poles, images))):
        across, heading = -1.5 + 0.3 * rng.normal(), np.radians(2.0) * rng.normal()
        pitch = CAMERA_PITCH_RAD + np.radians(0.4) * rng.normal()
        for n, pole in enumerate(column):
            ahead, beside = pole.along - along, pole.across - across
            hidden = np.clip((ahead - 25.0) / 40.0, 0.0, 0.8) + 0.03  # traffic and crowns, more so far away
            if not REACH_M[0] < ahead < REACH_M[1] or rng.uniform() < hidden:
                continue
            c, s = np.cos(heading), np.sin(heading)
            instance = see(pole, (c * ahead + s * beside, c * beside - s * ahead), pitch, rng)
            if instance is not None:
                instances.append(instance)
                mapped = ahead + off[n] * np.cos(towards[n]), beside + off[n] * np.sin(towards[n])
                rows.append((float(np.hypot(*mapped)), f"P{n}", k))
    distances, ids, stamps = zip(*rows, strict=True)
    measured: Features = measure(instances, WIDTH_PX, HEIGHT_PX)
    kept = np.flatnonzero(~measured.too_small)
    matrix = np.array([[FOCAL_PX, 0, WIDTH_PX / 2], [0, FOCAL_PX, HEIGHT_PX / 2], [0, 0, 1.0]])
    every = Samples(
        measured,
        np.array(distances),
        np.array(ids),
        np.array(stamps, dtype=np.int64),
        Camera(WIDTH_PX, HEIGHT_PX, matrix),
        images,
        0,
        {},
        np.full(len(rows), "light_pole"),
    )
    return every.rows(kept)


def see(
    pole: Pole, place_m: tuple[float, float], pitch_rad: float, rng: np.random.Generator
) -> Instance | None:
    """The instance of a pole at ``place_m`` (ahead, left) of the camera; None where its base is not in the image."""
    ahead, beside = place_m
    heights = np.linspace(0.0, pole.height_m, 65)
    axis = _project(ahead, beside + pole.lean * heights, pole.base_m - CAMERA_UP_M + heights, pitch_rad)
    inside = (axis[:, 1] >= 0) & (axis[:, 1] < HEIGHT_PX) & (axis[:, 0] >= 0) & (axis[:, 0] < WIDTH_PX)
    if inside.sum() < 12 or not inside[:6].any():
        return None
    thick = (
        FOCAL_PX / ahead * (BASE_DIAMETER_M + (TOP_DIAMETER_M - BASE_DIAMETER_M) * heights / pole.height_m)
    )
    reach = np.linspace(0.0, ARM_M, 24)
    arm = _project(
        ahead,
        beside + pole.lean * pole.height_m + pole.arm * reach,
        pole.base_m - CAMERA_UP_M + pole.height_m + 0.25 * np.sin(reach / ARM_M * np.pi / 2.0),
        pitch_rad,
    )
    cut_top = bool(axis[-1, 1] < 0.0)
    mask = _drawn(axis, thick, arm, cut_top, rng)
    used_rows, used_columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    if len(used_rows) < 12:
        return None
    x1, x2 = int(used_columns[0]), int(used_columns[-1]) + 1
    y1, y2 = int(used_rows[0]), int(used_rows[-1]) + 1
    sigma = 2.5 + 0.004 * (y2 - y1)  # of the box' upper side; its lower one hides in grass and kerbs
    box = (
        float(np.clip(x1 + 0.7 * sigma * rng.normal(), 0.0, WIDTH_PX - 2.0)),
        0.0 if cut_top else float(np.clip(y1 + sigma * rng.normal(), 0.0, HEIGHT_PX - 20.0)),
        float(np.clip(x2 + 0.7 * sigma * rng.normal(), 2.0, WIDTH_PX)),
        float(np.clip(y2 + 1.3 * sigma * rng.normal(), 20.0, HEIGHT_PX)),
    )
    return Instance(box, mask[y1:y2, x1:x2].copy(), (x1, y1), 1.0)


def _pole(k: int, rng: np.random.Generator) -> Pole:
    side = 1.0 if k % 2 == 0 else -1.0
    return Pole(
        (k + rng.uniform(-0.4, 0.4)) * SPACING_M,
        side * (6.0 + rng.uniform(-0.5, 0.5)),
        0.25 * rng.normal(),
        8.0 + 0.08 * rng.normal(),
        float(np.tan(np.radians(0.7) * rng.normal())),
        -side,
    )


def _project(ahead: float, left: Array, up: Array, pitch_rad: float) -> Array:
    """Pixels (N, 2) of points relative to the camera (m), which looks ``pitch_rad`` down."""
    c, s = np.cos(pitch_rad), np.sin(pitch_rad)
    depth = np.maximum(ahead * c - up * s, 0.5)
    across, down = -left / depth, -(up * c + ahead * s) / depth
    bent = 1.0 + DISTORTION * (across**2 + down**2)
    return np.column_stack([WIDTH_PX / 2 + FOCAL_PX * across * bent, HEIGHT_PX / 2 + FOCAL_PX * down * bent])


def _drawn(
    axis: Array, thick_px: Array, arm: Array, cut_top: bool, rng: np.random.Generator
) -> NDArray[np.bool_]:
    """The mask (H, W) with a segmenter's errors: where it ends, and how wide it is, varying slowly along it."""
    top, base = axis[:, 1].min(), axis[0, 1]
    sigma = 2.5 + 0.004 * (base - max(top, 0.0))
    first = 0 if cut_top else int(np.clip(top + 0.7 * sigma * rng.normal(), 0, HEIGHT_PX - 1))
    last = int(np.clip(base + 0.9 * sigma * rng.normal(), first + 1, HEIGHT_PX))
    rows = np.arange(first, last)
    centre = np.interp(rows, axis[::-1, 1], axis[::-1, 0])
    thick = np.interp(rows, axis[::-1, 1], thick_px[::-1])
    knots = np.linspace(first, last, 5)
    thick = np.maximum(thick + np.interp(rows, knots, rng.normal(size=5)) * (0.8 + 0.03 * thick), 1.0)
    mask = np.zeros((HEIGHT_PX, WIDTH_PX), dtype=np.bool_)
    columns = np.arange(WIDTH_PX)
    mask[first:last] = np.abs(columns - centre[:, None]) <= 0.5 * thick[:, None]
    half = max(0.25 * float(thick_px[-1]), 1.0)
    for one, other in pairwise(arm):
        x1, x2 = int(min(one[0], other[0])), int(max(one[0], other[0])) + 1
        y1, y2 = int(min(one[1], other[1]) - half), int(max(one[1], other[1]) + half) + 1
        if y2 > 0:
            mask[max(y1, 0) : y2, max(x1, 0) : max(x2, 0)] = True
    return mask
