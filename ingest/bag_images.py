"""Uncompressed images of ROS (sensor_msgs/Image) as PNG, which keeps every pixel."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError

MAX_SIDE_PX: Final = 1 << 15
CHANNELS: Final = {
    "mono8": 1, "8UC1": 1, "bgr8": 3, "rgb8": 3, "8UC3": 3, "bgra8": 4, "rgba8": 4, "8UC4": 4,
    "bayer_rggb8": 1, "bayer_bggr8": 1, "bayer_gbrg8": 1, "bayer_grbg8": 1,
}  # fmt: skip
"""Encodings that are read, and their bytes a pixel; 8UCn counts as BGR, as OpenCV has it."""


def to_png(image: Any) -> NDArray[np.uint8]:
    """The bytes of a PNG. InputError for an encoding that is not read, and for data of another size than stated."""
    import cv2

    width, height, step, encoding = int(image.width), int(image.height), int(image.step), str(image.encoding)
    channels = CHANNELS.get(encoding)
    if channels is None:
        raise InputError(f"images in {encoding[:40]!r} are not read (known: {', '.join(CHANNELS)})")
    if not 0 < width <= MAX_SIDE_PX or not 0 < height <= MAX_SIDE_PX:
        raise InputError(f"an image of {width}×{height} px")
    data = np.asarray(image.data, dtype=np.uint8)
    if step < width * channels or len(data) < step * height:
        raise InputError(f"an image of {width}×{height} px in {len(data)} bytes, {step} a row")
    rows = data[: step * height].reshape(height, step)[:, : width * channels]
    pixels = np.ascontiguousarray(rows.reshape(height, width, channels))
    # OpenCV names a Bayer pattern by its second row: RGGB of everyone else is its BG.
    change = {
        "rgb8": cv2.COLOR_RGB2BGR, "rgba8": cv2.COLOR_RGBA2BGR, "bgra8": cv2.COLOR_BGRA2BGR, "8UC4": cv2.COLOR_BGRA2BGR,
        "bayer_rggb8": cv2.COLOR_BayerBG2BGR, "bayer_bggr8": cv2.COLOR_BayerRG2BGR,
        "bayer_gbrg8": cv2.COLOR_BayerGR2BGR, "bayer_grbg8": cv2.COLOR_BayerGB2BGR,
    }.get(encoding)  # fmt: skip
    try:
        picture = pixels if change is None else cv2.cvtColor(pixels, change)
        done, encoded = cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    except cv2.error as error:
        raise InputError(f"an image of {width}×{height} px cannot be encoded") from error
    if not done:
        raise InputError(f"an image of {width}×{height} px cannot be encoded")
    return np.asarray(encoded, dtype=np.uint8)
