"""A folder of camera images: which files, in which order, of which size; and times as people write them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Final

from scpf.ingest.image_names import natural_order
from scpf.ingest.pictures import Encoded, check_size, read_whole
from scpf.models.errors import InputError

FORMATS: Final = {".jpg": "jpeg", ".jpeg": "jpeg", ".png": "png"}
NS_ABOVE: Final = 1e14
"""A plain number above this is nanoseconds, below it seconds: 1e14 s are three million years, 1e14 ns a day."""


@dataclass(frozen=True)
class ImageFile:
    """An image of a folder; ``format`` is jpeg or png, by its content."""

    path: Path
    format: str
    width_px: int
    height_px: int

    @property
    def name(self) -> str:
        """The file's name."""
        return self.path.name

    def encoded(self) -> Encoded:
        """The file's own bytes. Raises InputError where it cannot be read."""
        return Encoded(read_whole(self.path), self.format)


def list_images(folder: Path) -> list[ImageFile]:
    """The JPEG and PNG files of a folder, ordered by the numbers in their names (2 before 10).

    Sizes and formats come from the headers; nothing is decoded. Raises InputError for a folder without
    images, for a file that is no image, for two files with one number, and for images of different sizes.
    """
    from PIL import Image, UnidentifiedImageError

    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder", "give the folder that holds the image files")
    paths = [path for path in folder.iterdir() if path.suffix.lower() in FORMATS]
    paths.sort(key=lambda path: natural_order(path.name))
    if not paths:
        known = ", ".join(sorted(FORMATS))
        raise InputError(f"{folder} holds no image", f"known are files named {known}")
    images = []
    for path in paths:
        try:
            with Image.open(path, formats=("JPEG", "PNG")) as image:
                images.append(ImageFile(path, str(image.format).lower(), *image.size))
        except (UnidentifiedImageError, OSError, ValueError, Image.DecompressionBombError) as error:
            raise InputError(
                f"{path} is not a readable image ({error})", "remove it, or copy it again"
            ) from error
        check_size(images[-1].width_px, images[-1].height_px, str(path))
    for one, other in pairwise(images):
        if natural_order(one.name)[0] == natural_order(other.name)[0]:
            raise InputError(f"{one.path.name} and {other.path.name} in {folder} have one number")
        if (one.width_px, one.height_px) != (other.width_px, other.height_px):
            sizes = f"{one.width_px}×{one.height_px} and {other.width_px}×{other.height_px} px"
            raise InputError(f"{one.path.name} and {other.path.name} in {folder} differ in size: {sizes}")
    return images


def parse_time(text: str, place: str) -> int:
    """Nanoseconds since 1970 of a number (seconds, ns above 1e14) or a UTC date; InputError names ``place``.

    Digits are kept: no time goes through a float. A time outside the years 1678 to 2262 does not fit 64 bits of
    ns, and is none.
    """
    stamp_ns = _parse(text)
    if stamp_ns is None or abs(stamp_ns) >= 1 << 63:
        hint = "seconds, ns, or YYYY-MM-DD hh:mm:ss.fffffffff"
        raise InputError(f"{place}: {text[:60]!r} is not a time", hint)
    return stamp_ns


def _parse(text: str) -> int | None:
    plain = re.fullmatch(r"([+-]?\d{1,19})(?:\.(\d*))?", text)
    if plain:
        whole, fraction = int(plain[1]), plain[2] or ""
        if abs(whole) >= NS_ABOVE:
            return whole
        nanoseconds = int(fraction[:9].ljust(9, "0"))
        return whole * 10**9 + (-nanoseconds if text.startswith("-") else nanoseconds)
    if re.fullmatch(r"[+-]?\d*\.?\d+(e[+-]?\d{1,2})", text, re.IGNORECASE):  # KITTI odometry's times.txt
        value = float(text)
        return round(value) if abs(value) >= NS_ABOVE else round(value * 1e9)
    dated = re.fullmatch(r"(\d{4}-\d\d-\d\d)[ T](\d\d:\d\d:\d\d)(?:\.(\d{1,9}))?Z?", text)
    try:
        if dated:
            moment = datetime.fromisoformat(f"{dated[1]}T{dated[2]}").replace(tzinfo=UTC)
            return int(moment.timestamp()) * 10**9 + int((dated[3] or "").ljust(9, "0"))
    except ValueError:
        pass
    return None
