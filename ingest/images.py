"""A folder of camera images: which files, in which order, of which size, at which times."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError, UsageError

Stamps = NDArray[np.int64]

FORMATS: Final = {".jpg": "jpeg", ".jpeg": "jpeg", ".png": "png"}
MAX_TEXT_BYTES: Final = 256 << 20
NS_ABOVE: Final = 1e14
"""A plain number above this is nanoseconds, below it seconds: 1e14 s are three million years, 1e14 ns a day."""


@dataclass(frozen=True)
class ImageFile:
    """An image of a folder; ``format`` is jpeg or png, by its content."""

    path: Path
    format: str
    width_px: int
    height_px: int


def list_images(folder: Path) -> list[ImageFile]:
    """The JPEG and PNG files of a folder, ordered by the numbers in their names (2 before 10).

    Sizes and formats come from the headers; nothing is decoded. Raises InputError for a folder without
    images, for a file that is no image, for two files with one number, and for images of different sizes.
    """
    from PIL import Image, UnidentifiedImageError

    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder", "give the folder that holds the image files")
    paths = sorted((path for path in folder.iterdir() if path.suffix.lower() in FORMATS), key=_natural)
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
    for one, other in pairwise(images):
        if _natural(one.path)[0] == _natural(other.path)[0]:
            raise InputError(f"{one.path.name} and {other.path.name} in {folder} have one number")
        if (one.width_px, one.height_px) != (other.width_px, other.height_px):
            sizes = f"{one.width_px}×{one.height_px} and {other.width_px}×{other.height_px} px"
            raise InputError(f"{one.path.name} and {other.path.name} in {folder} differ in size: {sizes}")
    return images


def _natural(path: Path) -> tuple[list[tuple[int, int, str]], str]:
    """The order of names in which numbers count as numbers, however many zeros they carry."""
    parts = re.split(r"(\d+)", path.stem)
    return [(1, int(part), "") if part.isdigit() else (0, 0, part) for part in parts], path.name


def stamps_at_rate(count: int, rate_hz: float, start_ns: int) -> Stamps:
    """Stamps (count,) of images taken at a fixed rate from ``start_ns`` on."""
    if not 0.0 < rate_hz < 1e6:
        raise UsageError(f"an image rate of {rate_hz} Hz", "give a positive rate, such as 13")
    return start_ns + np.round(np.arange(count) * (1e9 / rate_hz)).astype(np.int64)


def read_stamps(path: Path, images: list[ImageFile]) -> Stamps:
    """The stamps (N,) in ns of ``images`` (N), from a text file with a line an image, or a CSV.

    A line of text is seconds, nanoseconds (above 1e14), or ``YYYY-MM-DD hh:mm:ss.fffffffff`` in UTC (KITTI
    raw). A CSV has two columns, image (file name, with or without its ending, or number counted from 0) and
    time; a first row without a time is a heading. Rows of images that are not in the folder are an error, as is
    an image without a row. Raises InputError for these, and for times that do not increase.
    """
    if path.stat().st_size > MAX_TEXT_BYTES:
        raise InputError(f"{path} is larger than 256 MiB", "is this a file of times?")
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not a text file ({error})") from error
    lines = [line.strip() for line in lines]
    rows = [(number, line) for number, line in enumerate(lines, 1) if line and not line.startswith("#")]
    if rows and any("," in line or ";" in line for _, line in rows):
        stamps = _from_csv(path, rows, images)
    else:
        if len(rows) != len(images):
            hint = "the file needs one line an image"
            raise InputError(f"{path} holds {len(rows)} times for {len(images)} images", hint)
        stamps = [parse_time(line, f"{path}:{number}") for number, line in rows]
    checked = np.array(stamps, dtype=np.int64)
    backwards = np.flatnonzero(np.diff(checked) <= 0)
    if len(backwards):
        k = int(backwards[0])
        what = "the same time as" if checked[k] == checked[k + 1] else "an earlier time than"
        place = f"{path}: {images[k + 1].path.name} has {what} {images[k].path.name}"
        more = f" ({len(backwards)} such places)" if len(backwards) > 1 else ""
        raise InputError(f"{place}{more}", "correct the times, or remove the doubled images from the folder")
    return checked


def _from_csv(path: Path, rows: list[tuple[int, str]], images: list[ImageFile]) -> list[int]:
    delimiter = "," if "," in rows[0][1] else ";"
    names = {key: k for k, image in enumerate(images) for key in (image.path.name, image.path.stem)}
    found: dict[int, int] = {}
    for position, (number, line) in enumerate(rows):
        place = f"{path}:{number}"
        cells = [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
        if len(cells) < 2:
            raise InputError(f"{place}: one column, where image and time are needed")
        try:
            stamp_ns = parse_time(cells[1], place)
        except InputError:
            if position == 0:  # a heading
                continue
            raise
        index = names.get(cells[0], names.get(Path(cells[0]).name))
        if index is None and cells[0].isdigit() and int(cells[0]) < len(images):
            index = int(cells[0])
        if index is None:
            raise InputError(f"{place}: no image {cells[0]!r} in the folder")
        if index in found:
            raise InputError(f"{place}: a second time for {images[index].path.name}")
        found[index] = stamp_ns
    missing = [image.path.name for k, image in enumerate(images) if k not in found]
    if missing:
        raise InputError(
            f"{path} has no time for {len(missing)} of {len(images)} images, such as {missing[0]}"
        )
    return [found[k] for k in range(len(images))]


def parse_time(text: str, place: str) -> int:
    """Nanoseconds since 1970 of a number (seconds, ns above 1e14) or a UTC date; InputError names ``place``.

    Digits are kept: no time goes through a float.
    """
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
    raise InputError(f"{place}: {text[:60]!r} is not a time", "seconds, ns, or YYYY-MM-DD hh:mm:ss.fffffffff")
