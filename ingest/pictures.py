"""What the camera delivered: pictures that are read one by one, and how those that need it are encoded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import DamagedError, InputError, UsageError

Pixels = NDArray[np.uint8]

MAX_IMAGE_BYTES: Final = 256 << 20
MAX_PIXELS: Final = 128_000_000
"""Of one picture. Checked before anything of that size is allocated: headers are untrusted."""


class Encoded(NamedTuple):
    """A picture as the log stores it; ``format`` is ``jpeg`` or ``png``."""

    data: bytes
    format: str


class Picture(Protocol):
    """One picture of a source; nothing is read before ``encoded``."""

    @property
    def name(self) -> str:
        """What messages and tables of times call it: the file's name, or the number of a video's frame."""

    @property
    def width_px(self) -> int: ...

    @property
    def height_px(self) -> int: ...

    def encoded(self) -> Encoded:
        """The picture's bytes: the file's own where those are JPEG or PNG. Raises InputError for a damaged one."""


@dataclass(frozen=True)
class Encoding:
    """How pixels that were no JPEG or PNG become one. ``quality`` (1 to 100) is that of JPEG."""

    format: Literal["png", "jpeg"] = "png"
    quality: int = 95

    def __post_init__(self) -> None:
        if not 1 <= self.quality <= 100:
            raise UsageError(f"a JPEG quality of {self.quality}", "give a number from 1 to 100, such as 95")

    def __str__(self) -> str:
        return "PNG (lossless)" if self.format == "png" else f"JPEG at quality {self.quality}"

    def of(self, pixels: Pixels, place: str) -> Encoded:
        """Encode pixels (H, W) grey or (H, W, 3) blue, green, red. Raises InputError naming ``place``."""
        import cv2

        # Level 1: the highest level saves a tenth of the bytes and takes ten times as long.
        settings = (
            [cv2.IMWRITE_PNG_COMPRESSION, 1]
            if self.format == "png"
            else [cv2.IMWRITE_JPEG_QUALITY, self.quality]
        )
        try:
            done, data = cv2.imencode(f".{self.format}", pixels, settings)
        except cv2.error as error:
            raise InputError(f"{place} cannot be encoded as {self} ({error})") from error
        if not done:
            raise InputError(f"{place} cannot be encoded as {self}")
        return Encoded(data.tobytes(), self.format)


def check_size(width_px: int, height_px: int, place: str) -> None:
    """Raise DamagedError for a size that no camera has, before memory is asked for."""
    if width_px <= 0 or height_px <= 0 or width_px * height_px > MAX_PIXELS:
        limit = f"{MAX_PIXELS // 10**6} million"
        raise DamagedError(f"{place} claims {width_px}×{height_px} px, and the limit is {limit} pixels")


def read_whole(path: Path) -> bytes:
    """The bytes of a file. Raises InputError where it cannot be read or is larger than any picture."""
    try:
        size = path.stat().st_size
        if size > MAX_IMAGE_BYTES:
            raise InputError(f"{path} has {size} bytes, more than {MAX_IMAGE_BYTES >> 20} MiB: no picture")
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from error
