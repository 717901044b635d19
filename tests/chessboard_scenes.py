"""Chessboards as a known camera shows them: corners by projection, and whole pictures by tracing each pixel's ray."""

from __future__ import annotations

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from scpf.ingest.chessboards import Board, View
from scpf.models.camera import Camera

BOARD = Board(9, 6, 0.03)
CAMERA = Camera(
    480,
    360,
    np.array([[420.0, 0, 235.0], [0, 424.0, 184.0], [0, 0, 1]]),
    np.array([-0.25, 0.08, 0.001, -0.0015, 0.0]),
)
FISHEYE = Camera(
    480,
    360,
    np.array([[200.0, 0, 236.0], [0, 201.0, 183.0], [0, 0, 1]]),
    np.array([0.03, -0.01, 0.004, -0.001]),
    "equidistant",
)
RATIONAL = Camera(
    480, 360, np.array([[300.0, 0, 238.0], [0, 301.0, 182.0], [0, 0, 1]]),
    np.array([0.4, 0.05, 0.0005, -0.0005, 0.002, 0.7, 0.15, 0.01]), "rational_polynomial",
)  # fmt: skip

Pose = tuple[np.ndarray, np.ndarray]


def poses(camera: Camera, count: int, seed: int = 0) -> list[Pose]:
    """Rotation and position of the board in the camera frame, so that each board lies in the picture."""
    rng = np.random.default_rng(seed)
    centre = BOARD.points_m().mean(axis=0)
    found: list[Pose] = []
    while len(found) < count:
        rotation = Rotation.from_euler(
            "xyz", rng.uniform([-40, -40, -180], [40, 40, 180]), degrees=True
        ).as_matrix()
        pixel = rng.uniform([60, 60], [camera.width_px - 60, camera.height_px - 60])
        depth = rng.uniform(0.25, 0.6) * camera.matrix[0, 0] / 400
        position = camera.rays(pixel[None])[0] * depth - rotation @ centre
        pixels = corners_of(camera, (rotation, position))
        size = np.array([camera.width_px, camera.height_px])
        if np.isfinite(pixels).all() and (pixels > 12).all() and (pixels < size - 12).all():
            found.append((rotation, position))
    return found


def corners_of(camera: Camera, pose: Pose) -> np.ndarray:
    """Where the corners (N, 2) are, px."""
    return camera.project(BOARD.points_m() @ pose[0].T + pose[1])


def views(camera: Camera, count: int, sigma_px: float, seed: int = 0) -> list[View]:
    """Views whose corners carry noise of a standard deviation per coordinate."""
    rng = np.random.default_rng(seed + 1)
    return [
        View(f"{k}.png", corners_of(camera, pose) + rng.normal(0, sigma_px, (BOARD.columns * BOARD.rows, 2)))
        for k, pose in enumerate(poses(camera, count, seed))
    ]


class Renderer:
    """Pictures of the board: each pixel is the mean of 2×2 rays, each of which meets a black or a white square."""

    def __init__(self, camera: Camera, samples: int = 2) -> None:
        self.shape = (camera.height_px, camera.width_px)
        self.samples = samples
        offsets = (np.arange(samples) + 0.5) / samples - 0.5
        y = (np.arange(camera.height_px)[:, None] + offsets).ravel()
        x = (np.arange(camera.width_px)[:, None] + offsets).ravel()
        grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        self.rays = camera.rays(grid)

    def picture(self, pose: Pose, rng: np.random.Generator) -> np.ndarray:
        """The picture (H, W), 8 bits, slightly blurred and noisy."""
        rotation, position = pose
        directions = self.rays @ rotation  # in the board's frame
        origin = -rotation.T @ position
        with np.errstate(divide="ignore", invalid="ignore"):
            length = -origin[2] / directions[:, 2]
            squares = np.floor((origin[:2] + directions[:, :2] * length[:, None]) / BOARD.square_m)
        inside = (
            (squares >= -1).all(axis=1)
            & (squares[:, 0] < BOARD.columns)
            & (squares[:, 1] < BOARD.rows)
            & (length > 0)
        )
        with np.errstate(invalid="ignore"):
            dark = inside & (np.nan_to_num(squares.sum(axis=1)) % 2 == 0)
        light = np.where(dark, 30.0, np.where(inside, 220.0, 200.0))
        n = self.samples
        light = light.reshape(self.shape[0], n, self.shape[1], n).mean(axis=(1, 3))
        noisy = cv2.GaussianBlur(light, (0, 0), 0.6) + rng.normal(0, 2.0, self.shape)
        return np.clip(noisy, 0, 255).astype(np.uint8)
