"""The camera: intrinsics, lens, and where it sits on the vehicle.

Frames: ``camera`` is optical (x right, y down, z forward); ``body`` is x forward, y left, z up. Pixel (0, 0)
is the centre of the upper left pixel. OpenCV does the lens numerics.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError

Array = NDArray[np.float64]

R_BODY_OPTICAL: Final = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Rotation from an optical frame that looks straight ahead to the body frame."""

COEFFICIENTS: Final = {"plumb_bob": (0, 4, 5), "rational_polynomial": (8, 12, 14), "equidistant": (4,)}
"""Distortion models of ROS's CameraInfo, with the number of coefficients that each may have."""


def looking_ahead() -> Array:
    """``T_body_camera`` (4, 4) of a camera at the body origin that looks along the body's x axis."""
    transform = np.eye(4)
    transform[:3, :3] = R_BODY_OPTICAL
    return transform


@dataclass(frozen=True, eq=False)
class Camera:
    """A calibrated camera on the vehicle.

    ``matrix``: (3, 3) intrinsics in px. ``distortion``: coefficients of ``distortion_model``, in OpenCV's order.
    ``T_body_camera``: (4, 4), camera frame to body frame, metres.
    """

    width_px: int
    height_px: int
    matrix: Array
    distortion: Array = field(default_factory=lambda: np.zeros(5))
    distortion_model: str = "plumb_bob"
    T_body_camera: Array = field(default_factory=looking_ahead)

    def __post_init__(self) -> None:
        if self.distortion_model not in COEFFICIENTS:
            known = ", ".join(COEFFICIENTS)
            raise InputError(f"distortion model {self.distortion_model!r} is not known", f"known: {known}")
        if len(self.distortion) not in COEFFICIENTS[self.distortion_model]:
            raise InputError(f"{self.distortion_model} with {len(self.distortion)} coefficients")
        if self.matrix.shape != (3, 3) or not (self.matrix[0, 0] > 0 and self.matrix[1, 1] > 0):
            raise InputError("the camera matrix must be 3×3 with positive focal lengths")
        if self.width_px <= 0 or self.height_px <= 0:
            raise InputError(f"an image of {self.width_px}×{self.height_px} px")

    def rays(self, pixels: Array) -> Array:
        """Unit vectors (N, 3) in the camera frame through distorted pixels (N, 2)."""
        import cv2

        points = np.ascontiguousarray(pixels, dtype=np.float64).reshape(-1, 1, 2)
        if not len(points):  # OpenCV would give None
            return np.empty((0, 3))
        if self.distortion_model == "equidistant":
            flat = cv2.fisheye.undistortPoints(points, self.matrix, self.distortion[:4])
        else:
            # More iterations than OpenCV's five: at the image's corner those leave a pixel of error.
            criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-10)
            flat = cv2.undistortPoints(points, self.matrix, self.distortion, criteria=criteria)
        directions = np.column_stack([flat.reshape(-1, 2), np.ones(len(points))])
        unit: Array = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        return unit

    def project(self, points_camera_m: Array) -> Array:
        """Pixels (N, 2) of points (N, 3) in the camera frame; NaN for points that are not in front of it."""
        import cv2

        points = np.ascontiguousarray(points_camera_m, dtype=np.float64).reshape(-1, 3)
        pixels = np.full((len(points), 2), np.nan)
        ahead = points[:, 2] > 1e-6
        if ahead.any():
            shown = points[ahead].reshape(-1, 1, 3)
            zero = np.zeros(3)
            if self.distortion_model == "equidistant":
                image, _ = cv2.fisheye.projectPoints(shown, zero, zero, self.matrix, self.distortion[:4])
            else:
                image, _ = cv2.projectPoints(shown, zero, zero, self.matrix, self.distortion)
            pixels[ahead] = image.reshape(-1, 2)
        return pixels

    def bearings(self, pixels: Array) -> Array:
        """Bearings (N,) in rad of pixels (N, 2): angle about the body's z axis, from x, to the left positive."""
        body = self.rays(pixels) @ self.T_body_camera[:3, :3].T
        bearings: Array = np.arctan2(body[:, 1], body[:, 0])
        return bearings
