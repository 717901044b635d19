"""Map files: GeoJSON read and written, lists of points read, and lines in metres."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError
from scpf.models.npz import load_arrays
from scpf.models.road_map import Landmark, RoadMap, from_geojson, to_geojson

Array = NDArray[np.float64]

MAX_FILE_BYTES: Final = 256 << 20
LINE_STEP_M: Final = 2.0
"""Spacing of a centre line that is taken from a trajectory."""


def read_map(path: Path) -> RoadMap:
    """The road map of a GeoJSON file. Raises InputError naming the file, and the feature that is not readable."""
    try:
        document = json.loads(_bytes(path))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is not JSON ({error})", "a map is a GeoJSON FeatureCollection") from error
    return from_geojson(document, str(path))


def encode_map(road_map: RoadMap) -> bytes:
    """The map as the GeoJSON text that files and logs hold."""
    return (json.dumps(to_geojson(road_map), ensure_ascii=False, indent=1) + "\n").encode()


def write_map(path: Path, road_map: RoadMap, *, overwrite: bool = False) -> None:
    """Write a map as GeoJSON. Raises InputError for a file that exists, unless ``overwrite``."""
    if path.exists() and not overwrite:
        raise InputError(f"{path} exists", "choose another name, or give --overwrite")
    path.write_bytes(encode_map(road_map))


def read_points(path: Path, key: str | None = None) -> list[Landmark]:
    """The landmarks of a CSV (columns id, x, y, perhaps z, class), or of an ``.npz`` (an array (N, 2 or 3)).

    Coordinates are metres in the ``map`` frame. A CSV without a heading has these columns in this order. In
    an ``.npz`` the ids are the row numbers; ``key`` names the array where there are several. Raises InputError.
    """
    if path.suffix.lower() in (".npz", ".npy"):
        return _array_points(path, key)
    lines = _bytes(path).decode("utf-8-sig", errors="replace").splitlines()
    rows = [
        (number, [cell.strip() for cell in row])
        for number, row in enumerate(csv.reader(lines), 1)
        if row and not row[0].startswith("#")
    ]
    columns = {"id": 0, "x": 1, "y": 2, "z": 3, "class": 4}
    if rows and "x" in (heading := [cell.lower().removesuffix("_m") for cell in rows[0][1]]):
        columns = {name: heading.index(name) for name in columns if name in heading}
        if not {"x", "y"} <= columns.keys():
            raise InputError(f"{path}:1: the heading names no column y", "columns: id,x,y[,z][,class]")
        rows = rows[1:]
    if not rows:
        raise InputError(f"{path} holds no point")
    landmarks: list[Landmark] = []
    for number, cells in rows:

        def cell(name: str, default: str, cells: list[str] = cells) -> str:
            place = columns.get(name, len(cells))
            return (cells[place] if place < len(cells) else "") or default

        try:
            x, y, z = (float(cell(name, default)) for name, default in (("x", ""), ("y", ""), ("z", "0")))
        except ValueError as error:
            raise InputError(f"{path}:{number}: {error}", "columns: id,x,y[,z][,class]") from error
        if not np.isfinite([x, y, z]).all():
            raise InputError(f"{path}:{number}: a coordinate is not finite")
        landmarks.append(Landmark(cell("id", str(len(landmarks))), (x, y, z), cell("class", "light_pole")))
    ids = [mark.id for mark in landmarks]
    if len(set(ids)) < len(ids):
        twice = next(one for k, one in enumerate(ids) if one in ids[:k])
        raise InputError(f"{path}: two points have the id {twice!r}", "give every point its own id")
    return landmarks


def decimate(track_m: Array, step_m: float) -> Array:
    """The points (M, 2) of a track (N, 2) at least ``step_m`` from the one kept before; the last one stays."""
    kept = [track_m[0]]
    for point in track_m[1:]:
        if np.hypot(*(point - kept[-1])) >= step_m:
            kept.append(point)
    if len(kept) > 1 or np.any(track_m[-1] != kept[0]):
        if np.hypot(*(track_m[-1] - kept[-1])) > step_m / 2 or len(kept) == 1:
            kept.append(track_m[-1])
        else:
            kept[-1] = track_m[-1]
    return np.array(kept)


def shift_left(line_m: Array, offset_m: float) -> Array:
    """The line (M, 2) moved by ``offset_m`` to its left, square to its direction at each point."""
    if len(line_m) < 2 or offset_m == 0.0:
        return line_m
    direction = np.gradient(line_m, axis=0)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    moved: Array = line_m + offset_m * np.column_stack([-direction[:, 1], direction[:, 0]])
    return moved


def _array_points(path: Path, key: str | None) -> list[Landmark]:
    arrays = load_arrays(path, MAX_FILE_BYTES)
    names = ", ".join(sorted(arrays))
    if key is not None and key not in arrays:
        raise InputError(f"{path} holds no array {key!r}", f"it holds: {names}")
    fitting = [name for name, array in arrays.items() if array.ndim == 2 and array.shape[1] in (2, 3)]
    if key is None and len(fitting) != 1:
        raise InputError(
            f"{path} holds {len(fitting)} arrays of points, not one", f"name one with --key: {names}"
        )
    array = arrays[key if key is not None else fitting[0]]
    if array.ndim != 2 or array.shape[1] not in (2, 3) or array.dtype.kind not in "fiu":
        raise InputError(f"{path}: array {key!r} of shape {array.shape} is not (N, 2) or (N, 3) numbers")
    table = array.astype(float)
    if not np.isfinite(table).all() or not len(table):
        raise InputError(f"{path}: a coordinate is not finite, or there is none")
    return [
        Landmark(str(k), (float(row[0]), float(row[1]), float(row[2:].sum()))) for k, row in enumerate(table)
    ]


def _bytes(path: Path) -> bytes:
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise InputError(f"{path} is larger than 256 MiB", "is this a map?")
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from error
