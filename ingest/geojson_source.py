"""GeoJSON from elsewhere (RFC 7946, WGS 84): points are landmarks, lines pieces of a road.

Also a map of scpf itself, in degrees or in metres: it can be cut anew.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from scpf.ingest.landmark_tags import landmark_class
from scpf.ingest.map_source import (
    MAX_POINTS,
    OSM_ATTRIBUTION,
    MapSource,
    SourceLine,
    SourcePoint,
    degrees,
    place_node,
    read_bounded,
    same_name,
)
from scpf.models.errors import InputError
from scpf.models.geodesy import Origin

MAX_BYTES: Final = 256 << 20
NAME_FIELDS: Final = ("name", "NAME", "Name", "street", "STREET", "road", "ref")
CLASS_FIELDS: Final = ("class", "landmark_class")
ID_FIELDS: Final = ("id", "@id", "osm_id", "ref", "OBJECTID", "FID")
WGS84_NAMES: Final = ("CRS84", "EPSG::4326", "EPSG:4326", "EPSG::4979", "WGS84")


def read_geojson(path: Path, road: str | None = None) -> MapSource:
    """Landmarks and lines; with ``road``, only the lines with that ``name`` or ``ref``.

    A landmark's class is its ``class``, else what its OpenStreetMap tags say, else ``light_pole``. Raises
    InputError naming the feature that cannot be read, and for coordinates that are not WGS 84.
    """
    try:
        document = json.loads(read_bounded(path, MAX_BYTES))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is not JSON ({error})") from error
    if not isinstance(document, dict) or "type" not in document:
        raise InputError(f"{path} is not GeoJSON", "its outermost member is an object with a type")
    reader = _Reader(path, road, document)
    for number, (feature, geometry) in enumerate(_features(document)):
        reader.add(feature, geometry, number)
    return reader.finish()


def _features(document: dict[str, Any]) -> Iterator[tuple[Mapping[str, Any], Any]]:
    """Each feature (of a bare geometry: an empty one) and its geometry."""
    features = document.get("features") if document["type"] == "FeatureCollection" else [document]
    for feature in features if isinstance(features, list) else [None]:
        if not isinstance(feature, dict):
            yield {}, feature
        elif feature.get("type") == "Feature":
            yield feature, feature.get("geometry")
        else:
            yield {}, feature


class _Reader:
    def __init__(self, path: Path, road: str | None, document: dict[str, Any]) -> None:
        self._path, self._road = path, road
        member = document.get("scpf")
        member = member if isinstance(member, dict) else {}
        self.source = MapSource(path, "GeoJSON", georeferenced=member.get("coordinates") != "map_m")
        whose = [member.get("attribution"), document.get("attribution"), document.get("copyright")]
        self.source.attribution = next((text for text in whose if isinstance(text, str)), "")
        self.source.origin = self._origin(member) if self.source.georeferenced else None
        crs = document.get("crs")
        named = crs.get("properties", {}) if isinstance(crs, dict) else {}
        name = str(named.get("name", "")) if isinstance(named, dict) else str(named)
        if crs is not None and not any(name.endswith(known) for known in WGS84_NAMES):
            hint = "convert it first: ogr2ogr -t_srs EPSG:4326 OUT.geojson IN.geojson"
            raise InputError(f"{path}: coordinates are in {name or 'an unnamed system'}, not WGS 84", hint)
        self._vertices = self._unclassed = 0
        self._of_osm = "openstreetmap" in self.source.attribution.lower()

    def _origin(self, member: Mapping[str, Any]) -> Origin | None:
        if (stated := member.get("origin")) is None:
            return None
        try:
            latitude, longitude, height = stated
            longitude, latitude = degrees(longitude, latitude)
            return Origin(latitude, longitude, _finite(height))
        except (TypeError, ValueError) as error:
            raise InputError(f"{self._path}: the origin cannot be read ({error})") from error

    def add(self, feature: Mapping[str, Any], geometry: Any, number: int) -> None:
        """One feature: its points become landmarks, its lines pieces of a road."""
        place = f"{self._path}: feature {number}"
        given = feature.get("properties")
        properties: dict[str, Any] = given if isinstance(given, dict) else {}
        if "id" in feature:
            properties = {"@id": feature["id"], **properties}
        tags = properties.get("tags")
        properties = {**(tags if isinstance(tags, dict) else {}), **properties}
        if str(properties.get("@id", "")).startswith(("node/", "way/")):
            self._of_osm = True
        if geometry is None:
            self.source.left_out["feature without a geometry"] += 1
            return
        parts = geometry.get("geometries") if isinstance(geometry, dict) else None
        for part, one in enumerate(parts if isinstance(parts, list) else [geometry]):
            if not isinstance(one, dict):
                raise InputError(f"{place}: its geometry is not an object")
            kind, coordinates = one.get("type"), one.get("coordinates")
            try:
                if kind in ("Point", "MultiPoint"):
                    for row in self._rows([coordinates] if kind == "Point" else coordinates):
                        self._point(properties, row, number)
                elif kind in ("LineString", "MultiLineString"):
                    lines: Any = [coordinates] if kind == "LineString" else coordinates
                    for piece, rows in enumerate(lines):
                        suffix = f" part {part + piece + 1}" if part + piece else ""
                        self._line(properties, self._rows(rows), f"feature {number}{suffix}")
                else:
                    self.source.left_out[f"{str(kind)[:40]}: neither a landmark nor a line"] += 1
            except (ValueError, TypeError, KeyError) as error:
                raise InputError(f"{place}: its coordinates cannot be read ({error})") from error

    def _rows(self, coordinates: Any) -> list[tuple[float, float, float | None]]:
        rows = []
        for row in coordinates:
            if not isinstance(row, list) or len(row) < 2:
                raise ValueError(f"{str(row)[:40]} is no position")
            if self.source.georeferenced:
                x, y = degrees(row[0], row[1])
            else:
                x, y = _finite(row[0]), _finite(row[1])
            rows.append((x, y, _finite(row[2]) if len(row) > 2 and row[2] is not None else None))
        self._vertices += len(rows)
        if self._vertices > MAX_POINTS:
            raise InputError(
                f"{self._path}: more than {MAX_POINTS} places", "cut it to the area of the drive"
            )
        return rows

    def _point(self, properties: dict[str, Any], row: tuple[float, float, float | None], number: int) -> None:
        kind = _first(properties, CLASS_FIELDS) or landmark_class(properties)
        self._unclassed += kind is None
        name = (_first(properties, ID_FIELDS) or f"feature {number}").removeprefix("node/")
        variance = properties.get("variance_m2")
        if variance is not None and (variance := _finite(variance)) < 0.0:
            raise ValueError("variance_m2 is negative")
        self.source.points.append(SourcePoint(name, *row, kind or "light_pole", variance))

    def _line(
        self, properties: dict[str, Any], rows: list[tuple[float, float, float | None]], piece: str
    ) -> None:
        names = [str(properties[key]) for key in NAME_FIELDS if properties.get(key) is not None]
        self.source.add_name(names[0] if names else "", len(rows))
        own = properties.get("kind") == "centre_line"
        if self._road is not None and not same_name(self._road, *names):
            return
        if len(rows) < 2:
            self.source.left_out["line of less than two places"] += 1
            return
        if own and properties.get("half_width_m") is not None:
            self.source.half_width_m = _finite(properties["half_width_m"])
        oneway = str(properties.get("oneway", "no")).lower()
        if oneway == "-1":
            rows = rows[::-1]
        points = np.array([row[:2] for row in rows], dtype=float)
        nodes = tuple(place_node(x, y) for x, y, _ in rows)
        self.source.lines.append(SourceLine(piece, nodes, points, oneway in ("yes", "true", "1", "-1")))

    def finish(self) -> MapSource:
        """The source, once all features are added."""
        if self._unclassed:
            self.source.notes.append(f"{self._unclassed} points state no class: taken as light_pole")
        if self._of_osm and "odbl" not in self.source.attribution.lower():
            self.source.attribution = "; ".join(filter(None, (self.source.attribution, OSM_ATTRIBUTION)))
        return self.source


def _first(properties: Mapping[str, Any], fields: tuple[str, ...]) -> str | None:
    """The first of the fields that holds a text or a number."""
    values = (properties.get(key) for key in fields)
    return next(
        (str(value) for value in values if isinstance(value, str | int | float) and value != ""), None
    )


def _finite(value: Any) -> float:
    try:
        number = float(value)
    except OverflowError as error:
        raise ValueError(str(error)) from error
    if isinstance(value, bool) or not math.isfinite(number):
        raise ValueError(f"{value!r} is not a finite number")
    return number
