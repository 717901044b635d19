"""KML: Placemarks with a Point are landmarks, those with a LineString pieces of a road.

Format: OGC 12-007r2. Heights are left out: KML counts them from the sea or from the ground, not the ellipsoid.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from scpf.ingest.map_source import (
    MAX_POINTS,
    MapSource,
    SourceLine,
    SourcePoint,
    degrees,
    place_node,
    same_name,
)
from scpf.ingest.xml_stream import stream
from scpf.models.errors import InputError

MAX_BYTES: Final = 256 << 20
CLASS_FIELDS: Final = ("class", "landmark_class")
UNUSED: Final = ("Polygon", "LinearRing", "Model", "Track", "MultiTrack")


def read_kml(path: Path, road: str | None = None) -> MapSource:
    """Landmarks and lines of a KML file; with ``road``, only the lines of Placemarks of that name.

    A landmark's id is its Placemark's ``id``, else its name; its class a data field ``class``, else
    ``light_pole``. Raises InputError naming the Placemark whose coordinates cannot be read, DamagedError.
    """
    reader = _Reader(path, road)
    stream(path, reader.start, reader.end, reader.text, max_bytes=MAX_BYTES)
    return reader.finish()


class _Reader:
    def __init__(self, path: Path, road: str | None) -> None:
        self._path, self._road = path, road
        self.source = MapSource(path, "KML")
        self._open: list[str] = []
        self._text: list[str] = []
        self._count = self._vertices = self._unclassed = 0
        self._clear({})

    def _clear(self, attributes: dict[str, str]) -> None:
        self._id, self._name, self._fields = attributes.get("id", ""), "", dict[str, str]()
        self._field = ""
        self._geometries: list[tuple[str, str]] = []

    def start(self, name: str, attributes: dict[str, str], depth: int) -> None:
        if depth == 0 and name != "kml":
            raise InputError(f"{self._path}: the root is <{name}>, not <kml>")
        self._open.append(name)
        self._text = []
        if name == "Placemark":
            self._count += 1
            self._clear(attributes)
        elif name in ("Data", "SimpleData"):
            self._field = attributes.get("name", "")
        elif name in UNUSED and "Placemark" in self._open and self._open[-2] not in UNUSED:
            if self._open[-2] not in ("innerBoundaryIs", "outerBoundaryIs"):
                self.source.left_out[f"{name}: neither a landmark nor a line"] += 1
        elif name == "NetworkLink":
            self.source.left_out["NetworkLink: what it points to is not read"] += 1

    def text(self, data: str) -> None:
        self._text.append(data)

    def end(self, name: str, depth: int) -> None:
        self._open.pop()
        parent = self._open[-1] if self._open else ""
        content, self._text = "".join(self._text), []
        if name == "name" and parent == "Placemark":
            self._name = " ".join(content.split())
        elif (name == "value" and parent == "Data") or name == "SimpleData":
            self._fields[self._field] = content.strip()
        elif name == "coordinates" and parent in ("Point", "LineString"):
            self._geometries.append((parent, content))
        elif name == "Placemark":
            for number, (kind, coordinates) in enumerate(self._geometries):
                self._add(kind, coordinates, number)
            self._geometries = []

    def _add(self, kind: str, text: str, number: int) -> None:
        place = f"{self._path}: Placemark {self._count}" + (f" {self._name!r}" if self._name else "")
        try:
            # Some writers put spaces around the commas, where the format has them between places.
            tight = ",".join(part.strip() for part in text.split(","))
            rows = [_place(row) for row in tight.split()]
        except ValueError as error:
            raise InputError(f"{place}: {error}", "coordinates are longitude,latitude[,height]") from error
        self._vertices += len(rows)
        if self._vertices > MAX_POINTS:
            raise InputError(
                f"{self._path}: more than {MAX_POINTS} places", "cut it to the area of the drive"
            )
        if kind == "Point":
            if len(rows) != 1:
                raise InputError(f"{place}: a Point of {len(rows)} places")
            given = next((self._fields[key] for key in CLASS_FIELDS if self._fields.get(key)), "")
            self._unclassed += not given
            name = self._id or self._name or f"placemark {self._count}"
            self.source.points.append(SourcePoint(name, *rows[0], landmark_class=given or "light_pole"))
            return
        self.source.add_name(self._name, len(rows))
        if self._road is None or same_name(self._road, self._name):
            if len(rows) < 2:
                self.source.left_out["line of less than two places"] += 1
                return
            nodes = tuple(place_node(*row) for row in rows)
            name = f"placemark {self._count}" + (f" part {number + 1}" if number else "")
            self.source.lines.append(SourceLine(name, nodes, np.array(rows)))

    def finish(self) -> MapSource:
        """The source, once the file is read."""
        if self._unclassed:
            self.source.notes.append(f"{self._unclassed} Placemarks state no class: taken as light_pole")
        return self.source


def _place(text: str) -> tuple[float, float]:
    longitude, comma, rest = text.partition(",")
    if not comma:
        raise ValueError(f"{text[:40]!r} is no pair of coordinates")
    return degrees(longitude, rest.partition(",")[0])
