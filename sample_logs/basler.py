"""The default camera: like a Basler with a 5 mm lens behind the windscreen of a bus."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.camera import R_BODY_OPTICAL, Camera
from scpf.models.errors import InputError

Array = NDArray[np.float64]

FULL_WIDTH_PX, FULL_HEIGHT_PX = 2048, 1536
SMALLEST_WIDTH_PX: Final = 64
FOCAL_PX: Final = (1465.0, 1465.0 * 1.0007)
CENTRE_OFF_PX: Final = (11.3, -9.6)
"""Of the principal point, from the middle of the sensor."""
DISTORTION: Final = (-0.19, 0.055, 0.0006, -0.0004, 0.0)
AHEAD_M, HEIGHT_M = 1.9, 2.3
"""Place in the body's frame, whose origin is on the road."""
YAW_DEG, PITCH_DEG, ROLL_DEG = 0.4, -2.6, 0.2
"""To the left, upwards, and clockwise as the camera sees it."""


def basler_camera(width_px: int = FULL_WIDTH_PX) -> Camera:
    """The camera binned or scaled to any width whose height is three quarters of it.

    Raises InputError where that is no whole number of pixels.
    """
    if width_px <= 0 or width_px % 4:
        raise InputError(f"a width of {width_px} px", "4:3 pictures are a multiple of 4 px wide")
    scale = width_px / FULL_WIDTH_PX
    # The sensor's left edge is at -0.5 px: pixel (0, 0) is the centre of the upper left pixel.
    centre_x = (FULL_WIDTH_PX / 2 + CENTRE_OFF_PX[0]) * scale - 0.5
    centre_y = (FULL_HEIGHT_PX / 2 + CENTRE_OFF_PX[1]) * scale - 0.5
    matrix = np.array(
        [[FOCAL_PX[0] * scale, 0.0, centre_x], [0.0, FOCAL_PX[1] * scale, centre_y], [0.0, 0.0, 1.0]]
    )
    mounted = mount(AHEAD_M, HEIGHT_M, YAW_DEG, PITCH_DEG, ROLL_DEG)
    return Camera(
        width_px, width_px * 3 // 4, matrix, np.array(DISTORTION), "plumb_bob", T_body_camera=mounted
    )


def mount(ahead_m: float, height_m: float, yaw_deg: float, pitch_deg: float, roll_deg: float) -> Array:
    """``T_body_camera`` (4, 4) of a camera in the middle, turned to the left, upwards, and clockwise as it sees."""
    mounted = np.eye(4)
    mounted[:3, :3] = rotation(2, yaw_deg) @ rotation(1, -pitch_deg) @ rotation(0, roll_deg) @ R_BODY_OPTICAL
    mounted[:3, 3] = ahead_m, 0.0, height_m
    return mounted


def rotation(axis: int, angle_deg: float) -> Array:
    """Rotation matrix (3, 3) about the x, y or z axis (0, 1, 2), by the right-hand rule."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    turn[i, i] = turn[j, j] = c
    turn[i, j], turn[j, i] = -s, s
    return turn
