"""Pictures without the lens's distortion, as ROS's image_rect topics carry them."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from scpf.models.camera import Camera
from scpf.models.errors import InputError
from scpf.sample_logs.finished_frames import encode_jpeg

JPEG_QUALITY = 90


class Rectifier:
    """Turns pictures of a camera into those of ``camera``: the same intrinsics and mount, no distortion."""

    def __init__(self, distorted: Camera) -> None:
        if distorted.distortion_model == "equidistant":
            raise InputError("a fisheye camera cannot keep its intrinsics without its distortion")
        self.camera = replace(distorted, distortion=np.zeros(5), distortion_model="plumb_bob")
        self._size_px = (distorted.width_px, distorted.height_px)
        self._maps = cv2.initUndistortRectifyMap(
            distorted.matrix, distorted.distortion, np.eye(3), distorted.matrix, self._size_px, cv2.CV_32FC1
        )

    def jpeg(self, jpeg: bytes) -> bytes:
        """The rectified picture, encoded anew. Raises InputError for one of another size, or that is no picture."""
        image = cv2.imdecode(np.frombuffer(jpeg, dtype=np.uint8), cv2.IMREAD_COLOR)
        if image is None or image.shape[1::-1] != self._size_px:
            raise InputError(f"no picture of {self._size_px[0]}×{self._size_px[1]} px")
        straight = cv2.remap(image, *self._maps, cv2.INTER_CUBIC)
        return encode_jpeg(np.asarray(straight[..., ::-1], dtype=np.uint8), JPEG_QUALITY)
