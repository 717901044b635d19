"""Pictures whose pixels have to be encoded for a log: TIFF, PGM, raw dumps of the sensor, Bayer mosaics.

The log holds 8 bit. Of deeper pixels the significant bits are said (10, 12, 16), and the lower ones are cut off.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.pictures import Encoded, Encoding, Pixels, check_size, read_whole
from scpf.models.errors import DamagedError, InputError, UsageError

BAYER: Final = ("rggb", "bggr", "grbg", "gbrg")
"""Colours of the upper left 2×2 pixels, by rows."""
BITS: Final = (8, 10, 12, 14, 16)
PILLOW_FORMATS: Final = ("JPEG", "PNG", "TIFF", "PPM")
DAMAGE: Final = (OSError, ValueError, SyntaxError, KeyError, IndexError, TypeError, EOFError, struct.error)
"""What Pillow raises for damaged files, by format and place."""


@dataclass(frozen=True)
class RawLayout:
    """How pixels are laid out: the ``bayer`` mosaic (None: grey or colour already), ``bits`` (None: all that the
    type has), and the size of dumps without a header.
    """

    bayer: str | None = None
    bits: int | None = None
    size_px: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        if self.bayer is not None and self.bayer not in BAYER:
            raise UsageError(f"a Bayer mosaic {self.bayer!r}", f"known: {', '.join(BAYER)}")
        if self.bits is not None and self.bits not in BITS:
            raise UsageError(f"pixels of {self.bits} bits", f"known: {', '.join(map(str, BITS))}")

    def eight_bits(self, pixels: NDArray[Any], place: str) -> Pixels:
        """Demosaiced where there is a mosaic, and 8 bits deep: grey (H, W) or blue, green, red (H, W, 3)."""
        if self.bayer is not None:
            if pixels.ndim != 2:
                raise InputError(f"{place} has {pixels.shape[2]} channels: no Bayer mosaic", "omit --bayer")
            pixels = demosaic(pixels, self.bayer)
        if pixels.dtype == np.uint8:
            return pixels
        bits = self.bits or 16
        peak = int(pixels.max(initial=0))
        if peak >> bits:
            hint = "give the number of bits that the camera delivered as --raw-bits"
            raise InputError(f"{place} holds the value {peak}, more than {bits} bits", hint)
        return (pixels >> (bits - 8)).astype(np.uint8)


def demosaic(pixels: NDArray[Any], bayer: str) -> NDArray[Any]:
    """Blue, green, red (H, W, 3) of a mosaic (H, W), 8 or 16 bits. OpenCV interpolates, edge-aware."""
    import cv2

    # OpenCV names a mosaic by its second row's second and third pixel: its BG is our RGGB.
    codes = {
        "rggb": cv2.COLOR_BayerBG2BGR_EA,
        "bggr": cv2.COLOR_BayerRG2BGR_EA,
        "grbg": cv2.COLOR_BayerGB2BGR_EA,
        "gbrg": cv2.COLOR_BayerGR2BGR_EA,
    }
    colours: NDArray[Any] = cv2.cvtColor(np.ascontiguousarray(pixels), codes[bayer])
    return colours


def parse_size(text: str) -> tuple[int, int]:
    """Width and height of ``2048x1536``. Raises UsageError."""
    found = re.fullmatch(r"([0-9]{1,5})[x×]([0-9]{1,5})", text.strip().lower())
    if found is None or not (int(found[1]) and int(found[2])):
        raise UsageError(
            f"a picture size {text[:40]!r}", "give width and height in pixels, such as 2048x1536"
        )
    check_size(int(found[1]), int(found[2]), "--raw-size")
    return int(found[1]), int(found[2])


@dataclass(frozen=True)
class RawDump:
    """A file of nothing but pixels, row by row: one byte each, or two, little-endian, from 10 bits on."""

    path: Path
    width_px: int
    height_px: int
    layout: RawLayout
    encoding: Encoding

    @property
    def name(self) -> str:
        return self.path.name

    def encoded(self) -> Encoded:
        """The pixels, encoded. Raises DamagedError for a file of another size than the layout says."""
        deep = (self.layout.bits or 8) > 8
        data = read_whole(self.path)
        needed = self.width_px * self.height_px * (2 if deep else 1)
        if len(data) != needed:
            raise DamagedError(
                f"{self.path} {_size_text(len(data), self)}", _size_hint(len(data), self, deep)
            )
        pixels = np.frombuffer(data, dtype="<u2" if deep else np.uint8)
        pixels = pixels.reshape(self.height_px, self.width_px).astype(
            np.uint16 if deep else np.uint8, copy=False
        )
        return self.encoding.of(self.layout.eight_bits(pixels, str(self.path)), str(self.path))


@dataclass(frozen=True)
class PixelFile:
    """A TIFF, PGM or PNG whose pixels are decoded and encoded anew."""

    path: Path
    width_px: int
    height_px: int
    layout: RawLayout
    encoding: Encoding

    @property
    def name(self) -> str:
        return self.path.name

    def encoded(self) -> Encoded:
        """The pixels, encoded. Raises InputError for a damaged file."""
        pixels = read_pixels(self.path)
        return self.encoding.of(self.layout.eight_bits(pixels, str(self.path)), str(self.path))


def picture_size(path: Path) -> tuple[int, int]:
    """Width and height by the file's header. Raises InputError for no picture, or one of several pages."""
    from PIL import Image

    try:
        with Image.open(path, formats=PILLOW_FORMATS) as image:
            width_px, height_px = image.size
            pages = bool(getattr(image, "is_animated", False))
    except (*DAMAGE, Image.DecompressionBombError) as error:
        raise _unreadable(path, error) from error
    check_size(width_px, height_px, str(path))
    if pages:
        raise InputError(f"{path} holds several pages", "split it into files of one picture each")
    return width_px, height_px


def is_deep(path: Path) -> bool:
    """Whether its pixels are more than 8 bits deep, by the header. Raises InputError for no picture."""
    from PIL import Image

    try:
        with Image.open(path, formats=PILLOW_FORMATS) as image:
            return image.mode.startswith("I")
    except (*DAMAGE, Image.DecompressionBombError) as error:
        raise _unreadable(path, error) from error


def read_pixels(path: Path) -> NDArray[Any]:
    """Grey (H, W) or blue, green, red (H, W, 3) pixels, uint8 or uint16. Raises InputError for a damaged file."""
    from PIL import Image

    picture_size(path)
    try:
        with Image.open(path, formats=PILLOW_FORMATS) as image:
            if image.mode in ("L", "1"):
                return np.asarray(image.convert("L"))
            if image.mode.startswith("I"):
                wide = np.asarray(image)
                if wide.size and (int(wide.min()) < 0 or int(wide.max()) > 0xFFFF):
                    raise InputError(f"{path} holds values that are not 16 bit")
                return wide.astype(np.uint16)
            if image.mode == "F":
                raise InputError(f"{path} holds floating-point pixels", "export it with 8 or 16 bits a pixel")
            colours = np.asarray(image.convert("RGB"))
            return np.ascontiguousarray(colours[:, :, ::-1])
    except (*DAMAGE, Image.DecompressionBombError, MemoryError) as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: BaseException) -> InputError:
    return InputError(f"{path} is not a readable picture ({error})", "remove it, or copy it again")


def _size_text(size: int, raw: RawDump) -> str:
    bits = raw.layout.bits or 8
    return f"has {size} bytes, and {raw.width_px}×{raw.height_px} px of {bits} bits were said"


def _size_hint(size: int, raw: RawDump, deep: bool) -> str:
    pixels = raw.width_px * raw.height_px
    if size * 2 == pixels * 3:
        return "that is 12 bit packed, which is not read: record it unpacked"
    if not deep and size == pixels * 2:
        return "that is two bytes a pixel: give --raw-bits 10, 12, 14 or 16"
    return "is --raw-size right, and the file whole?"
