"""What every reader of a foreign map returns: points, lines by name, whose data they are, and what was left out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError
from scpf.models.geodesy import Origin

Array = NDArray[np.float64]

OSM_ATTRIBUTION: Final = "© OpenStreetMap contributors, ODbL 1.0"
MAX_POINTS: Final = 2_000_000
"""Landmarks, and vertices of lines, that one source may hold."""
MAX_NAMES: Final = 100_000


@dataclass(frozen=True)
class SourcePoint:
    """A landmark as its file has it: ``x, y`` are longitude and latitude (deg), or metres; see MapSource.

    ``z_m`` is the ellipsoid height, or up in ``map`` where the source is in metres; None where unknown, like
    ``variance_m2``.
    """

    id: str
    x: float
    y: float
    z_m: float | None = None
    landmark_class: str = "light_pole"
    variance_m2: float | None = None


@dataclass(frozen=True, eq=False)
class SourceLine:
    """A piece of road: ``points`` (N, 2) as in SourcePoint, ``nodes`` (N) that lines share where they meet.

    ``oneway`` says that traffic runs in the order of the points only.
    """

    id: str
    nodes: tuple[Hashable, ...]
    points: Array
    oneway: bool = False


@dataclass
class MapSource:
    """A foreign map. ``georeferenced``: WGS 84 degrees; else metres in ``map``.

    ``lines`` are those of the road that was asked for (all, where none was), ``names`` every road's name with
    the number of its vertices. ``classes`` (None: all) are those that a map takes unless told otherwise.
    ``origin`` is that of a map of scpf itself. ``left_out`` counts, by reason, what could not be used;
    ``notes`` say what was assumed.
    """

    path: Path
    format: str
    georeferenced: bool = True
    points: list[SourcePoint] = field(default_factory=list)
    lines: list[SourceLine] = field(default_factory=list)
    names: Counter[str] = field(default_factory=Counter)
    attribution: str = ""
    classes: frozenset[str] | None = None
    half_width_m: float | None = None
    origin: Origin | None = None
    left_out: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)

    def add_name(self, name: str, vertices: int) -> None:
        """Count a road's name; those beyond MAX_NAMES are not kept (they only serve as a hint)."""
        if name and (name in self.names or len(self.names) < MAX_NAMES):
            self.names[name] += vertices


def same_name(wanted: str, *names: str | None) -> bool:
    """Whether one of ``names`` is ``wanted``, whatever the case and the spaces."""
    key = " ".join(wanted.split()).casefold()
    return any(name is not None and " ".join(name.split()).casefold() == key for name in names)


def printable(text: str) -> str:
    """A name of someone else's file, fit for a line on a terminal."""
    return "".join(sign if sign.isprintable() else "?" for sign in text[:60])


def degrees(longitude: object, latitude: object) -> tuple[float, float]:
    """Longitude and latitude as numbers. Raises ValueError for what is not on the globe, swapped perhaps."""
    if isinstance(longitude, bool) or isinstance(latitude, bool):
        raise ValueError("true and false are no coordinates")
    try:
        x, y = float(longitude), float(latitude)  # type: ignore[arg-type]
    except (TypeError, OverflowError) as error:
        raise ValueError(str(error)) from error
    if not (-180.0 <= x <= 180.0 and -90.0 <= y <= 90.0):
        raise ValueError(f"longitude {x:g}, latitude {y:g} is not on the globe")
    return x, y


def place_node(x: float, y: float) -> tuple[float, float]:
    """The node of a vertex in files without node ids: its place, to 1e-7 (a centimetre in degrees)."""
    return round(x, 7), round(y, 7)


def read_bounded(path: Path, limit_bytes: int) -> bytes:
    """The whole file. Raises InputError where it cannot be read or is larger than ``limit_bytes``."""
    try:
        with path.open("rb") as file:
            data = file.read(limit_bytes + 1)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from error
    if len(data) > limit_bytes:
        raise InputError(f"{path} is larger than {limit_bytes >> 20} MiB", "cut it to the area of the drive")
    return data
