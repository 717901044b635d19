"""The road map that one makes of a foreign map: one centre line, and the landmarks near it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.landmark_choice import choose
from scpf.ingest.line_graph import Polyline
from scpf.ingest.line_joining import JoinedLine, join, nearest_on
from scpf.ingest.map_source import MapSource, SourcePoint, printable
from scpf.ingest.maps import LINE_STEP_M, decimate, shift_left
from scpf.models.errors import InputError, MissingError, UsageError
from scpf.models.geodesy import Origin, enu_from_geodetic
from scpf.models.road_map import Landmark, RoadMap

Array = NDArray[np.float64]

NEAR_M: Final = 15.0
FAR_FROM_ORIGIN_M: Final = 20_000.0
"""Further from its origin, a flat map is off by more than a decimetre along the ground."""


@dataclass
class MapReport:
    """What a road map was made of. ``left_out`` counts by reason what could not be used: a loss.

    ``kept``, ``far``, ``other_class`` count landmarks by class: in the map; further than ``within_m`` from the
    road; of classes that were not asked for. ``not_selected`` were left out by id.
    """

    within_m: float = NEAR_M
    line: JoinedLine | None = None
    origin_from: str = ""
    kept: Counter[str] = field(default_factory=Counter)
    far: Counter[str] = field(default_factory=Counter)
    other_class: Counter[str] = field(default_factory=Counter)
    not_selected: int = 0
    left_out: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)

    @property
    def lossless(self) -> bool:
        """Whether the map holds all that was asked for."""
        return not self.left_out and not (self.line is not None and self.line.off)


def build(
    source: MapSource,
    *,
    road: str | None = None,
    within_m: float = NEAR_M,
    classes: Collection[str] | None = None,
    origin: Origin | None = None,
    half_width_m: float | None = None,
    landmark_variance_m2: float | None = None,
    max_gap_m: float = 30.0,
    select: Collection[str] = (),
    exclude: Collection[str] = (),
    attribution: str = "",
    track_m: Array | None = None,
    road_offset_m: float = 0.0,
) -> tuple[RoadMap, MapReport]:
    """The road map of a source and the report of how it came about.

    The centre line is the source's lines joined into one (``max_gap_m``: see ``join``), or lies ``road_offset_m``
    to the left of ``track_m`` (M, 2), driven in ``map`` metres at ``origin``. Landmarks of ``classes`` (None:
    those the source takes) are kept within ``within_m`` of the road: of the line, its branches and its other
    carriageway, or of the track; all of them where there is neither.

    The origin, where neither the call nor the source gives one, is the vertex halfway along the line, at the median
    height of the landmarks that state one, else 0. ``landmark_variance_m2`` holds for landmarks that state none.

    Raises InputError where no landmark is left, MissingError for a ``road`` that the source does not have,
    UsageError where it has several and none was named.
    """
    report = MapReport(within_m=within_m, left_out=source.left_out.copy(), notes=list(source.notes))
    if road is not None and track_m is None and not source.lines:
        raise MissingError(f"{source.path} has no road named {road!r}", _names_hint(source, road))
    if road is None and track_m is None and len(source.names) > (1 if source.lines else 0):
        raise UsageError(
            f"{source.path} has {len(source.names)} named roads: give --road", _names_hint(source, "")
        )
    choice = choose(source, classes, select, exclude)
    points, names = choice.points, choice.ids
    report.other_class, report.not_selected = choice.other_class, choice.not_selected
    report.notes += choice.notes
    centre_line, roads = np.zeros((0, 2)), list[Array]()
    if track_m is not None:
        if source.lines:
            report.notes.append(
                f"{len(source.lines)} lines of the source not used: the trajectory gives the road"
            )
        roads = [track_m]
        centre_line = shift_left(decimate(track_m, LINE_STEP_M), road_offset_m)
    else:
        origin, report.line = _centre_line(source, points, origin, max_gap_m, report)
        if report.line is not None:
            centre_line, roads = report.line.points_m, [report.line.points_m, *report.line.beside_m]
    positions = _metres(
        source, np.array([(point.x, point.y) for point in points]).reshape(-1, 2), points, origin
    )
    landmarks = []
    near = _near(roads, positions[:, :2], within_m) if roads else np.ones(len(points), dtype=bool)
    for keep, name, point, position in zip(near, names, points, positions, strict=True):
        (report.kept if keep else report.far)[point.landmark_class] += 1
        if keep:
            variance = point.variance_m2 if point.variance_m2 is not None else landmark_variance_m2 or 0.0
            east, north, up = (float(value) for value in position)
            landmarks.append(Landmark(name, (east, north, up), point.landmark_class, variance))
    if not landmarks and (source.points or not roads):
        raise InputError(f"{source.path}: no landmark is left for the map", _why_none(report))
    if origin is not None and len(centre_line):
        away = float(np.hypot(*centre_line.T).max())
        if away > FAR_FROM_ORIGIN_M:
            report.notes.append(
                f"the road goes {away / 1000:.0f} km from the origin: cut it to the drive's area"
            )
    half_width = half_width_m or source.half_width_m or 4.0
    whose = "; ".join(dict.fromkeys(filter(None, (source.attribution, attribution))))
    return RoadMap(tuple(landmarks), centre_line, half_width, origin, whose), report


def _why_none(report: MapReport) -> str:
    """Where the landmarks went, for the hint of an error."""
    counts = {
        f"further than {report.within_m:g} m from the road": report.far.total(),
        "of other classes ("
        + ", ".join(map(printable, sorted(report.other_class)[:5]))
        + ")": report.other_class.total(),
        "not selected": report.not_selected,
        "not usable": report.left_out.total(),
    }
    return ", ".join(f"{count} {why}" for why, count in counts.items() if count) or "it holds none"


def _names_hint(source: MapSource, road: str | None) -> str:
    """The roads of a source, those first that look like the one asked for."""
    import difflib

    common = [name for name, _ in source.names.most_common(2000)]
    close = difflib.get_close_matches(road, common, 3, 0.6) if road else []
    shown = [printable(name) for name in dict.fromkeys([*close, *common])][:5]
    return f"its roads: {', '.join(shown)}" if shown else "it names no road"


def _centre_line(
    source: MapSource,
    points: list[SourcePoint],
    origin: Origin | None,
    max_gap_m: float,
    report: MapReport,
) -> tuple[Origin | None, JoinedLine | None]:
    """The origin of the map and its centre line, where the source has lines."""
    heights = [point.z_m for point in points if point.z_m is not None]
    height = float(np.median(heights)) if heights and source.georeferenced else 0.0
    places = {
        node: place for line in source.lines for node, place in zip(line.nodes, line.points, strict=True)
    }
    report.origin_from = (
        "given" if origin is not None else "of the source" if source.origin is not None else ""
    )
    origin = origin or source.origin
    if not source.georeferenced:
        origin = None
    elif origin is None:
        if not places and not points:
            return None, None
        middle = np.median(list(places.values()) or [(point.x, point.y) for point in points], axis=0)
        origin = Origin(float(middle[1]), float(middle[0]), height)
        report.origin_from = "the median of the landmarks"
        if places:  # joined once in a frame at hand, to know the line; then again in the frame at its middle
            first = _joined(source, origin, max_gap_m)
            along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(first.points_m, axis=0).T))])
            half = first.nodes[int(np.argmin(np.abs(along - along[-1] / 2)))]
            longitude, latitude = (float(value) for value in places[half])
            origin = Origin(latitude, longitude, height)
            report.origin_from = "the vertex halfway along the centre line"
    return origin, _joined(source, origin, max_gap_m) if places else None


def _joined(source: MapSource, origin: Origin | None, max_gap_m: float) -> JoinedLine:
    lines = [
        Polyline(line.id, line.nodes, _metres(source, line.points, None, origin)[:, :2], line.oneway)
        for line in source.lines
    ]
    try:
        return join(lines, max_gap_m)
    except InputError as error:
        raise InputError(f"{source.path}: {error.message}", error.hint) from error


def _metres(
    source: MapSource, places: Array, points: list[SourcePoint] | None, origin: Origin | None
) -> Array:
    """Positions (N, 3) in ``map`` of places (N, 2); without a height, in the plane of the origin."""
    heights = np.array([np.nan if point.z_m is None else point.z_m for point in points or ()], dtype=float)
    if points is None:
        heights = np.full(len(places), np.nan)
    if not source.georeferenced or origin is None:
        return np.column_stack([places, np.nan_to_num(heights)])
    known = np.where(np.isnan(heights), origin.height_m, heights)
    positions = enu_from_geodetic(places[:, 1], places[:, 0], known, origin)
    positions[np.isnan(heights), 2] = 0.0
    return positions


def _near(roads: list[Array], positions_m: Array, within_m: float) -> NDArray[np.bool_]:
    """Which of the positions (N, 2) lie within a distance of one of the lines."""
    near = np.zeros(len(positions_m), dtype=bool)
    for line_m in roads:
        if len(line_m) == 1:
            line_m = np.repeat(line_m, 2, axis=0)
        low, high = line_m.min(axis=0) - within_m, line_m.max(axis=0) + within_m
        at = np.flatnonzero(~near & ((positions_m >= low) & (positions_m <= high)).all(axis=1))
        near[at] = nearest_on(line_m, positions_m[at])[0] <= within_m
    return near
