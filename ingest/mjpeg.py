"""Frames of Motion-JPEG as JPEG files, byte for byte: cameras leave out the Huffman tables that all of them share."""

from __future__ import annotations

from functools import cache
from typing import Final, NamedTuple

MAX_SEGMENTS: Final = 1000


class JpegHeader(NamedTuple):
    """What lies before the pixels: whether tables are there, the size, and where the scan's header begins."""

    has_tables: bool
    width_px: int
    height_px: int
    scan_at: int


def as_jpeg(frame: bytes, size_px: tuple[int, int]) -> bytes | None:
    """The frame as a JPEG file: itself, or with the standard tables put in where it has none.

    None where it is no baseline JPEG of ``size_px`` (half frames of interlaced video): to be decoded instead.
    """
    header = _header(frame)
    if header is None or (header.width_px, header.height_px) != size_px:
        return None
    if header.has_tables:
        return frame
    return frame[: header.scan_at] + standard_tables() + frame[header.scan_at :]


def _header(data: bytes) -> JpegHeader | None:
    if data[:2] != b"\xff\xd8":
        return None
    at, tables, size = 2, False, (0, 0)
    for _ in range(MAX_SEGMENTS):
        if at + 4 > len(data) or data[at] != 0xFF:
            return None
        marker, length = data[at + 1], int.from_bytes(data[at + 2 : at + 4], "big")
        if marker == 0xC4:
            tables = True
        elif marker in (0xC0, 0xC1) and at + 9 <= len(data):
            size = (
                int.from_bytes(data[at + 7 : at + 9], "big"),
                int.from_bytes(data[at + 5 : at + 7], "big"),
            )
        elif marker == 0xDA:
            return JpegHeader(tables, *size, at)
        at += 2 + max(length, 2)
    return None


@cache
def standard_tables() -> bytes:
    """The tables of annex K.3 of the JPEG standard, as segments: those that libjpeg writes unless told otherwise."""
    from io import BytesIO

    from PIL import Image

    written = BytesIO()
    Image.new("RGB", (8, 8)).save(written, format="JPEG", optimize=False)
    data, at, found = written.getvalue(), 2, b""
    while data[at + 1] != 0xDA:
        end = at + 2 + int.from_bytes(data[at + 2 : at + 4], "big")
        if data[at + 1] == 0xC4:
            found += data[at:end]
        at = end
    return found
