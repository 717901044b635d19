"""A file of times beside the images: a time a line, or a table of image and time."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path, PurePath
from typing import Final

from scpf.ingest.image_names import natural_order
from scpf.ingest.images import parse_time
from scpf.models.errors import InputError, UsageError

MAX_TEXT_BYTES: Final = 64 << 20
UNITS: Final = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
_SPELLED: Final = {"sec": "s", "seconds": "s", "msec": "ms", "usec": "us", "µs": "us", "nsec": "ns"}
_UNIT: Final = re.compile(r"(?:^|[\[( _])(n?sec|[mu]sec|seconds|[mnuµ]?s)[\])]?$")
_NUMBER: Final = re.compile(r"[+-]?[0-9]{1,20}(?:\.[0-9]{0,20})?(?:[eE][+-]?[0-9]{1,2})?")

Row = tuple[int, list[str]]
"""Line number and cells."""


@dataclass
class Sidecar:
    """Times in ns of images, None for an image without one; ``unclaimed``: rows of images that are not there."""

    stamps_ns: list[int | None]
    unclaimed: int = 0
    notes: list[str] = field(default_factory=list)


def read_sidecar(path: Path, names: Sequence[str], unit: str | None = None) -> Sidecar:
    """The times of the images ``names`` (file names, or numbers of a video's frames).

    A line is a time, or a row of image and time in either order: split by comma, semicolon, tab or space. A heading
    may name the columns, and the unit (``timestamp [ns]``, ``t_us``). Images are named by file name, with or without
    ending, by the counter in it, or counted from 0 (from 1 where that alone fits all: noted). ``unit`` is that of plain
    numbers; without it and without a heading, numbers above 1e14 are ns, others seconds; dates are UTC. Raises
    InputError, with the line, for what is no such file, and where fewer than half of the images have a time.
    """
    if unit is not None and unit not in UNITS:
        raise UsageError(f"a unit of time {unit!r}", f"known: {', '.join(UNITS)}")
    rows, heading = _rows(path)
    if not rows:
        raise InputError(f"{path} holds no time")
    if all(len(cells) == 1 for _, cells in rows):
        if len(rows) != len(names):
            hint = "the file needs one line an image; or name the images in a first column"
            raise InputError(f"{path} holds {len(rows)} times for {len(names)} images", hint)
        return Sidecar([_time(cells[0], unit, f"{path}:{line}") for line, cells in rows])

    image_column, time_column = _columns(path, rows, heading, names)
    unit = unit or (_unit_of(heading[time_column]) if heading else None)
    index_of, how = _matching([cells[image_column] for _, cells in rows], names)
    found: dict[int, int] = {}
    unclaimed = 0
    for line, cells in rows:
        place = f"{path}:{line}"
        stamp_ns = _time(cells[time_column], unit, place)
        index = index_of.get(cells[image_column])
        if index is None:
            unclaimed += 1
        elif index in found:
            raise InputError(f"{place}: a second time for {names[index]}")
        else:
            found[index] = stamp_ns
    if len(found) * 2 < len(names):
        example = f"{rows[0][1][image_column][:60]!r} and {names[0]!r}"
        raise InputError(
            f"{path} has times for {len(found)} of {len(names)} images (names: {example})",
            "is this the file of these images?",
        )
    sidecar = Sidecar([found.get(index) for index in range(len(names))], unclaimed)
    if how:
        sidecar.notes.append(f"{path.name} {how}")
    if unclaimed:
        sidecar.notes.append(f"{unclaimed} times in {path.name} are of images that are not there")
    return sidecar


def _rows(path: Path) -> tuple[list[Row], list[str] | None]:
    """Rows of equal width, and the heading where there is one (perhaps behind a ``#``)."""
    try:
        if path.stat().st_size > MAX_TEXT_BYTES:
            raise InputError(f"{path} is larger than {MAX_TEXT_BYTES >> 20} MiB", "is this a file of times?")
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not a text file ({error})") from error
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    commented = [line.lstrip("# ") for _, line in lines if line.startswith("#")]
    kept = [(number, line) for number, line in lines if not line.startswith("#")]
    delimiter = next((sign for sign in ",;\t" if kept and sign in kept[-1][1]), None)
    rows = [(number, _cells(line, delimiter, f"{path}:{number}")) for number, line in kept]
    heading = None
    if rows and not any(_NUMBER.fullmatch(cell) or _is_time(cell) for cell in rows[0][1]):
        heading = rows.pop(0)[1]
    elif rows and commented and len(rows[0][1]) > 1:
        last = _cells(commented[-1], delimiter, str(path))
        heading = last if len(last) == len(rows[0][1]) else None
    width = len(rows[0][1]) if rows else 0
    for number, cells in rows:
        if len(cells) != width:
            raise InputError(f"{path}:{number}: {len(cells)} columns, where the rows before have {width}")
    if heading is not None and len(heading) != width:
        heading = None
    return rows, heading


def _cells(line: str, delimiter: str | None, place: str) -> list[str]:
    if delimiter is None:
        return [line] if _is_time(line) else line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
    except (csv.Error, StopIteration) as error:
        raise InputError(f"{place}: not a row of a table ({error})") from error


def _columns(path: Path, rows: list[Row], heading: list[str] | None, names: Sequence[str]) -> tuple[int, int]:
    """Which column names the image, and which holds the time."""
    width = len(rows[0][1])
    if heading is not None:
        titles = [title.lower() for title in heading]
        times = [k for word in ("stamp", "time") for k, title in enumerate(titles) if word in title]
        times = [k for k in times if "exposure" not in titles[k]]
        words = ("file", "image", "name", "frame", "counter", "index", "number", "id", "seq")
        images = [k for word in words for k, title in enumerate(titles) if word in title and k not in times]
        if times and images:
            return images[0], times[0]
    if width > 2:
        hint = "name them in a first row, such as image,timestamp_ns"
        raise InputError(f"{path}: which of {width} columns hold image and time?", hint)
    stems = {PurePath(name).stem for name in names}
    swapped = all(PurePath(cells[1]).stem in stems for _, cells in rows[:10])
    straight = all(PurePath(cells[0]).stem in stems for _, cells in rows[:10])
    return (1, 0) if swapped and not straight else (0, 1)


def _matching(cells: Sequence[str], names: Sequence[str]) -> tuple[dict[str, int], str]:
    """Which image each cell means: by name, by stem, by counter, by place from 0 or from 1, whatever fits most.

    Also says how, where that has to be told.
    """
    by_name = {key: k for k, name in enumerate(names) for key in (PurePath(name).stem, name)}
    numbers = {_last_number(name): k for k, name in enumerate(names)}
    ways: list[dict[str, int | None]] = [
        {cell: by_name.get(cell, by_name.get(PurePath(cell).name)) for cell in cells},
        {cell: numbers.get(int(cell)) for cell in cells if _is_index(cell)},
        {cell: int(cell) if int(cell) < len(names) else None for cell in cells if _is_index(cell)},
        {cell: int(cell) - 1 if 0 < int(cell) <= len(names) else None for cell in cells if _is_index(cell)},
    ]
    found = [{cell: index for cell, index in way.items() if index is not None} for way in ways]
    best = max(found, key=len)  # the first of equals
    return best, "counts the images from 1" if best is found[3] else ""


def _last_number(name: str) -> int | None:
    key, _ = natural_order(name)
    return next((number for is_number, number, _ in reversed(key) if is_number), None)


def _is_index(cell: str) -> bool:
    return re.fullmatch(r"[0-9]{1,12}", cell) is not None


def _unit_of(title: str) -> str | None:
    found = _UNIT.search(title.strip().lower())
    return None if found is None else _SPELLED.get(found[1], found[1])


def _is_time(text: str) -> bool:
    try:
        parse_time(text, "")
    except InputError:
        return False
    return True


def _time(text: str, unit: str | None, place: str) -> int:
    """A time in ns; a number in ``unit`` where that is known, by exact arithmetic."""
    if unit is not None and _NUMBER.fullmatch(text):
        return round(Decimal(text) * UNITS[unit])
    return parse_time(text, place)
