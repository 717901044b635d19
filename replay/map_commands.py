"""``scpf map from``: a road map of OpenStreetMap, GeoJSON, KML, CSV or an array of points."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

if TYPE_CHECKING:
    from scpf.ingest.map_source import MapSource
    from scpf.models.geodesy import Origin
    from scpf.models.trajectory import Trajectory

Several = Parameter(consume_multiple=False)


def map_from(
    source: Path,
    *,
    output: Annotated[Path, Parameter(alias="-o")],
    road: str | None = None,
    within_m: Annotated[float | None, Parameter(alias="--near-m")] = None,
    classes: Annotated[list[str] | None, Parameter(name="--class", consume_multiple=False)] = None,
    origin: tuple[float, float, float] | None = None,
    max_gap_m: float = 30.0,
    half_width_m: float | None = None,
    landmark_sigma_m: float = 0.0,
    log: Path | None = None,
    road_offset_m: float = 0.0,
    rotate_deg: float = 0.0,
    offset_m: tuple[float, float] = (0.0, 0.0),
    select: Annotated[list[str] | None, Several] = None,
    exclude: Annotated[list[str] | None, Several] = None,
    key: str | None = None,
    attribution: str = "",
    overwrite: bool = False,
    format: Literal["text", "json"] = "text",
) -> int:
    """Make a road map of a map of others: landmarks near a road, and the road's centre line.

    OpenStreetMap XML, GeoJSON, KML, CSV with latitude and longitude; CSV (id, x, y) and .npz in metres. Exit code
    3: pieces of the road, or entries of the file, could not be used.

    Examples:

        scpf map from campus.osm -o map.geojson --road "Ring Road"

        scpf map from poles.csv -o map.geojson --log drive.mcap --road-offset-m 1.75

        scpf map from poles.npz -o map.geojson --rotate-deg 1.0 --offset-m -0.5 -0.3 --select 0,2,25 --log kitti.mcap

    Parameters
    ----------
    source
        .osm, .geojson, .kml, .csv, or .npz with an array of N×2.
    output
        The map to write (.geojson).
    road
        Name of the road; its pieces in the source are joined into the centre line.
    within_m
        Keep the landmarks that are this near to the road, or to the trajectory of --log. Default: 15 in a source
        in degrees, else all.
    classes
        Only landmarks of these classes, separated by commas. Default: light_pole of .osm, else all.
    origin
        Latitude and longitude (deg) and height (m) of the map's origin. Default: halfway along the road.
    max_gap_m
        Join pieces of the road across gaps up to this, where it goes on in its direction.
    half_width_m
        Half the width of the road. Default: 4, or what the source states.
    landmark_sigma_m
        Standard deviation an axis of landmarks whose source states none.
    log
        Drive log whose reference trajectory gives the centre line instead.
    road_offset_m
        How far the centre line lies to the left of the trajectory of --log.
    rotate_deg
        Points in metres: turn them about the origin first, counter-clockwise.
    offset_m
        Points in metres: then move them by x and y.
    select
        Only these ids, separated by commas; may be given several times.
    exclude
        Not these ids, likewise.
    key
        The array of an .npz that holds several.
    attribution
        Whose data these are; kept in the map, beside what the source states.
    overwrite
        Replace an existing output.
    format
        Form of the report on stdout.
    """
    from scpf.ingest.map_build import NEAR_M, build
    from scpf.ingest.map_sources import read_source
    from scpf.ingest.maps import write_map
    from scpf.models.errors import InputError, UsageError
    from scpf.models.geodesy import Origin
    from scpf.replay.map_reports import as_dict, print_map

    numbers = (within_m or 0.0, max_gap_m, landmark_sigma_m, half_width_m or 1.0, road_offset_m, rotate_deg)
    if (
        not all(math.isfinite(value) for value in (*numbers, *offset_m, *(origin or ())))
        or min(numbers[:4]) < 0.0
    ):
        raise UsageError(
            "lengths are finite, and all but --road-offset-m are not negative", "scpf map from --help"
        )
    if origin is not None and not (abs(origin[0]) <= 90.0 and abs(origin[1]) <= 180.0):
        raise UsageError(f"--origin {origin[0]:g} {origin[1]:g}: latitude comes first, then longitude")
    if output.exists() and not overwrite:
        raise InputError(f"{output} exists", "choose another name, or give --overwrite")
    trajectory, frame = _driven(log) if log is not None else (None, None)
    found = read_source(source, road, key)
    _check(found, road, log, origin, frame, within_m, moved=bool(rotate_deg or any(offset_m)))
    if not found.georeferenced and not found.lines:
        found = _moved(found, rotate_deg, offset_m)
    near_m = within_m if within_m is not None else NEAR_M if found.georeferenced else math.inf
    road_map, report = build(
        found, road=road, within_m=near_m, classes=None if classes is None else _ids(classes),
        origin=Origin(*origin) if origin is not None else frame if found.georeferenced else None,
        half_width_m=half_width_m, landmark_variance_m2=landmark_sigma_m**2, max_gap_m=max_gap_m,
        select=_ids(select), exclude=_ids(exclude), attribution=attribution,
        track_m=None if trajectory is None else trajectory.positions_m[:, :2], road_offset_m=road_offset_m,
    )  # fmt: skip
    write_map(output, road_map, overwrite=overwrite)
    if format == "json":
        print(json.dumps(as_dict(output, found, road_map, report), indent=1, ensure_ascii=False))
    else:
        print_map(found, road_map, report)
        line = f"centre line of {len(road_map.centre_line_m)} points" if len(road_map.centre_line_m) else ""
        print(
            f"{output}: {len(road_map.landmarks)} of {len(found.points)} points, {line or 'no centre line'}"
        )
    return 0 if report.lossless else 3


def _driven(log: Path) -> tuple[Trajectory, Origin | None]:
    """The reference trajectory of a drive log, and the origin of its ``map`` frame."""
    from scpf.ingest.drive_log import DriveLog
    from scpf.models.errors import MissingError

    with DriveLog(log) as opened:
        trajectory, origin = opened.trajectory(), opened.origin()
    if trajectory is None:
        raise MissingError(f"{log} holds no reference trajectory", "ingest it with --trajectory")
    return trajectory, origin


def _check(
    found: MapSource,
    road: str | None,
    log: Path | None,
    origin: tuple[float, float, float] | None,
    frame: Origin | None,
    within_m: float | None,
    moved: bool,
) -> None:
    """Refuse options that would have no effect, or no meaning, for this kind of source."""
    from scpf.models.errors import MissingError, UsageError

    if log is not None and road is not None:
        raise UsageError("both --road and --log give a centre line", "give one of them")
    if within_m is not None and log is None and not found.lines and (road is None or not found.georeferenced):
        raise UsageError("--within-m needs a road or a trajectory", "give --road or --log as well")
    if found.georeferenced:
        if moved:
            raise UsageError("--rotate-deg and --offset-m are for points in metres, and these are in degrees")
        if log is not None and origin is not None:
            raise UsageError("--origin: the trajectory of --log has its own", "leave one of them out")
        if log is not None and frame is None:
            raise MissingError(
                f"{log} states no origin, and {found.path} is in degrees", "give --road instead"
            )
        return
    if origin is not None:
        raise UsageError("--origin is for maps in degrees, and this one is in metres")
    if moved and found.lines:
        raise UsageError("--rotate-deg and --offset-m are for lists of points, and this map has a road")


def _moved(found: MapSource, rotate_deg: float, offset_m: tuple[float, float]) -> MapSource:
    """The points turned about the origin (counter-clockwise), then moved."""
    from dataclasses import replace

    cosine, sine = math.cos(math.radians(rotate_deg)), math.sin(math.radians(rotate_deg))
    points = [
        replace(p, x=cosine * p.x - sine * p.y + offset_m[0], y=sine * p.x + cosine * p.y + offset_m[1])
        for p in found.points
    ]
    return replace(found, points=points)


def _ids(values: list[str] | None) -> set[str]:
    return {part.strip() for value in values or () for part in value.split(",") if part.strip()}
