"""Landmarks of a CSV: degrees where the heading names latitude and longitude, else metres (x, y; see maps.py)."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from scpf.ingest.map_source import MAX_POINTS, MapSource, SourcePoint, degrees, read_bounded
from scpf.ingest.maps import read_points
from scpf.models.errors import InputError

MAX_BYTES: Final = 256 << 20
HEADINGS: Final = {
    "latitude": ("latitude", "lat", "latitude_deg", "lat_deg", "@lat", "y_lat", "gps_lat"),
    "longitude": ("longitude", "lon", "lng", "long", "longitude_deg", "lon_deg", "@lon", "x_lon", "gps_lon"),
    "id": ("id", "@id", "osm_id", "ref", "objectid", "fid", "name"),
    "class": ("class", "landmark_class", "type", "kind"),
    "height": ("height_m", "ellipsoid_height_m", "ellipsoid_height"),
    "variance": ("variance_m2",),
}
"""Names of columns, in lower case. A height must be named as one above the ellipsoid."""


def read_csv(path: Path, road: str | None = None) -> MapSource:
    """Landmarks, one a row. A CSV has no lines, so ``road`` finds nothing.

    Cells are separated by commas, semicolons or tabs. A row without a place is left out and counted. Raises
    InputError naming the line that cannot be read.
    """
    lines = read_bounded(path, MAX_BYTES).decode("utf-8-sig", errors="replace").splitlines()
    first = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    separator = max(",;\t", key=first.count)
    columns = _columns(first, separator)
    if not {"latitude", "longitude"} <= columns.keys():
        if separator != "," or columns.keys() & {"latitude", "longitude"}:
            hint = "columns: id,latitude,longitude[,class] in degrees, or id,x,y[,z][,class] in metres"
            raise InputError(f"{path}: the heading names no pair of coordinates", hint)
        return metric_points(path)
    source = MapSource(path, "CSV in degrees")
    if any("\ufffd" in line for line in lines):
        source.notes.append("the text is not UTF-8: letters that could not be read are shown as \ufffd")
    unclassed = 0
    for number, cells in _rows(path, lines, separator):
        if len(source.points) >= MAX_POINTS:
            raise InputError(f"{path}: more than {MAX_POINTS} rows", "cut it to the area of the drive")
        row = {name: cells[at].strip() if at < len(cells) else "" for name, at in columns.items()}
        if not row["latitude"] or not row["longitude"]:
            source.left_out["row without a place"] += 1
            continue
        try:
            place = degrees(row["longitude"], row["latitude"])
            height = float(row["height"]) if row.get("height") else None
            variance = float(row["variance"]) if row.get("variance") else None
            if not (abs(height or 0.0) < 1e5 and 0.0 <= (variance or 0.0) < 1e9):
                raise ValueError("a height or variance is out of all proportion")
        except ValueError as error:
            raise InputError(f"{path}:{number}: {error}", "decimal points, degrees") from error
        kind = row.get("class", "")
        unclassed += not kind
        name = row.get("id") or f"line {number}"
        source.points.append(SourcePoint(name, *place, height, kind or "light_pole", variance))
    if unclassed:
        source.notes.append(f"{unclassed} rows state no class: taken as light_pole")
    return source


def metric_points(path: Path, key: str | None = None) -> MapSource:
    """Landmarks in metres of a CSV or .npz, as ``maps.read_points`` reads them."""
    source = MapSource(path, "points in metres", georeferenced=False)
    try:
        found = read_points(path, key)
    except csv.Error as error:  # a cell of more than 128 KiB
        raise InputError(f"{path} cannot be read as CSV ({error})") from error
    source.points = [SourcePoint(mark.id, *mark.position_m, mark.landmark_class) for mark in found]
    return source


def _columns(heading: str, separator: str) -> dict[str, int]:
    """The place of each known column of a heading."""
    cells = [cell.strip().strip('"').lower() for cell in heading.split(separator)]
    found = {}
    for name, known in HEADINGS.items():
        at = next((cells.index(one) for one in known if one in cells), None)
        if at is not None:
            found[name] = at
    return found


def _rows(path: Path, lines: list[str], separator: str) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of each row below the heading; a quoted cell may run over several lines."""
    reader = csv.reader(lines, delimiter=separator)
    heading = True
    try:
        for cells in reader:
            if not any(cell.strip() for cell in cells) or cells[0].startswith("#"):
                continue
            if heading:
                heading = False
                continue
            yield reader.line_num, cells
    except csv.Error as error:
        raise InputError(f"{path}:{reader.line_num}: {error}") from error
