"""Cameras of training sets: any usual lens behind any windscreen, drawn at random."""

from __future__ import annotations

from typing import Final

import numpy as np

from scpf.models.camera import Camera
from scpf.sample_logs.basler import DISTORTION, FOCAL_PX, FULL_WIDTH_PX, SMALLEST_WIDTH_PX, mount

ASPECTS: Final = (3 / 4, 3 / 4, 10 / 16, 9 / 16)
SCALES: Final = (1.0, 1.0, 0.8, 0.625)
"""Of the width that was asked for."""
ZOOM: Final = (0.7, 1.6)
"""Focal length, relative to the default camera's at the same width."""
MOST_DISTORTION: Final = 1.2
"""Relative to the default camera's; a longer lens bends less."""
HEIGHT_M: Final = (1.2, 3.1)
"""From a car's windscreen to a coach's."""
AHEAD_M: Final = (0.8, 2.4)


def drawn_camera(width_px: int, rng: np.random.Generator) -> Camera:
    """A camera of ``width_px`` or somewhat fewer, 4:3, 16:10 or 16:9, mounted by hand: off by some degrees."""
    width = max(round(width_px * float(rng.choice(SCALES)) / 4) * 4, SMALLEST_WIDTH_PX)
    height = round(width * float(rng.choice(ASPECTS)))
    zoom = float(np.exp(rng.uniform(*np.log(ZOOM))))
    focal_px = zoom * FOCAL_PX[0] * width / FULL_WIDTH_PX
    centre_x, centre_y = rng.normal(0.0, 0.01, 2) * width + [width / 2 - 0.5, height / 2 - 0.5]
    matrix = np.array([[focal_px, 0.0, centre_x], [0.0, focal_px, centre_y], [0.0, 0.0, 1.0]])
    distortion = np.array(DISTORTION) * float(rng.uniform(0.0, MOST_DISTORTION)) / max(zoom, 1.0)
    T_body_camera = mount(
        float(rng.uniform(*AHEAD_M)),
        float(rng.uniform(*HEIGHT_M)),
        float(rng.normal(0.0, 3.0)),
        float(np.clip(rng.normal(-1.0, 2.5), -7.0, 5.0)),
        float(rng.normal(0.0, 1.0)),
    )
    return Camera(width, height, matrix, distortion, "plumb_bob", T_body_camera=T_body_camera)
