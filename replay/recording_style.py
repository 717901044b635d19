"""The looks of a recording that never change, and the map: logged once, before the first step."""

from __future__ import annotations

from typing import Final, Literal

import rerun as rr

from scpf.models.road_map import RoadMap
from scpf.replay import overlays, shapes

Colour = tuple[int, int, int]
Colormap = Literal["Viridis", "Magma"]

TRUTH: Final[Colour] = (255, 255, 255)
ESTIMATE: Final[Colour] = (70, 230, 255)
BASELINE: Final[Colour] = (255, 150, 40)
GREY: Final[Colour] = (150, 155, 165)
GOLD: Final[Colour] = (230, 200, 90)

SURFACES: Final[dict[str, tuple[str, Colormap, Colour, float]]] = {
    "log_probability": ("peak", "Viridis", (255, 255, 255), 0.5),
    "sum": ("minimum", "Magma", (255, 255, 255), 0.2),
}
"""Of each constraint surface: its marked cell, its colours, the marker's colour, and the opacity."""

SERIES: Final[dict[str, tuple[str, Colour]]] = {
    "error/position/scpf": ("scPF", ESTIMATE),
    "error/position/pf": ("PF, unconstrained", BASELINE),
    "error/heading_frame/longitudinal": ("longitudinal", (120, 220, 120)),
    "error/heading_frame/lateral": ("lateral", (230, 120, 230)),
    "filter/ess": ("ESS", ESTIMATE),
    "filter/log_evidence": ("log evidence", GOLD),
    "surface/peak": ("peak", GOLD),
    "surface/minimum": ("minimum", (150, 130, 255)),
}
"""Name and colour of each number's line."""

_FLAT: Final = rr.components.PointShading.Flat
_HAIR: Final = rr.Radius.ui_points(0.75)
_LINE: Final = rr.Radius.ui_points(1.25)
_DOT: Final = rr.Radius.ui_points(1.5)


TRUE_DISTANCE: Final = rr.SeriesPoints(names="true", colors=TRUTH, marker_sizes=1.0)


def timing_style(stage: str, place: int) -> rr.SeriesLines:
    """The line of a stage, by its place among the stages."""
    colour = overlays.LANDMARK_COLOURS[place % len(overlays.LANDMARK_COLOURS)]
    return rr.SeriesLines(names=stage, colors=colour, widths=1.5)


def log_style(rec: rr.RecordingStream) -> None:
    """Colours, widths and names of everything that the steps fill."""
    _camera_style(rec)
    _world_style(rec)
    for entity, (name, colour) in SERIES.items():
        rec.log(entity, rr.SeriesLines(names=name, colors=colour, widths=1.5), static=True)


def log_map(rec: rr.RecordingStream, road_map: RoadMap, classes: overlays.LandmarkClasses) -> None:
    """The road's edges and centre line, and the landmarks with their names."""
    lines = shapes.road_lines(road_map.centre_line_m, road_map.half_width_m)
    if lines:
        edge, centre = (190, 190, 195), (110, 110, 118)
        rec.log("world/road", rr.LineStrips3D(lines, colors=[edge, centre, edge], radii=_HAIR), static=True)
    ids = [mark.id for mark in road_map.landmarks]
    if ids:
        poles = rr.Points3D(
            shapes.on_ground(road_map.positions_m),
            radii=rr.Radius.ui_points(4),
            class_ids=[classes.class_of(name) for name in ids],
            point_shading=_FLAT,
        )
        names = rr.Points3D(
            shapes.on_ground(road_map.positions_m),
            radii=rr.Radius.ui_points(0),
            labels=ids,
            class_ids=[classes.class_of(name) for name in ids],
            show_labels=True,
        )
        rec.log("world/poles", poles, static=True)
        rec.log("world/poles/names", names, static=True)  # apart: the view of the whole map shows none


def log_surface_style(rec: rr.RecordingStream, rows: int, columns: int, cell_m: float) -> None:
    """Size and colours of the constraint surfaces: half floats, shown under the pointer."""
    form = rr.components.ImageFormat(width=columns, height=rows, color_model="L", channel_datatype="F16")
    for name, (_, colormap, _, opacity) in SURFACES.items():
        style = rr.GridMap.from_fields(cell_size=cell_m, colormap=colormap, opacity=opacity, format=form)
        rec.log(f"world/surface/{name}", style, static=True)


def _camera_style(rec: rr.RecordingStream) -> None:
    colours = (*overlays.LANDMARK_COLOURS, overlays.UNMATCHED_COLOUR)
    classes = [(0, "background", (0, 0, 0, 0)), *((k + 1, "", colour) for k, colour in enumerate(colours))]
    rec.log("/", rr.AnnotationContext(classes), static=True)
    rec.log("camera/image", rr.EncodedImage.from_fields(draw_order=0), static=True)
    # The picture's own transparency is ignored: without an opacity its background hides the image.
    masks = rr.EncodedImage.from_fields(media_type="image/png", draw_order=1, opacity=0.5)
    rec.log("camera/masks", masks, static=True)
    rec.log("camera/outlines", rr.LineStrips2D.from_fields(radii=_LINE, draw_order=2), static=True)
    for entity, shown in (("camera/labels", True), ("camera/labels_on_hover", False)):
        points = rr.Points2D.from_fields(radii=_LINE, draw_order=3, show_labels=shown)
        rec.log(entity, points, static=True)


def _world_style(rec: rr.RecordingStream) -> None:
    rec.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    rec.log("world/rings", rr.LineStrips3D.from_fields(radii=_HAIR), static=True)
    rec.log("world/view", rr.LineStrips3D.from_fields(radii=_HAIR, colors=GREY), static=True)
    gps = rr.Points3D.from_fields(radii=_DOT, colors=GREY, point_shading=_FLAT)
    rec.log("world/gps", gps, static=True)
    rec.log("world/particles", rr.Points3D.from_fields(radii=_DOT, point_shading=_FLAT), static=True)
    for name, (marker, _, colour, _) in SURFACES.items():
        point = rr.Points3D.from_fields(radii=rr.Radius.ui_points(3), colors=colour, point_shading=_FLAT)
        rec.log(f"world/surface/{name}/{marker}", point, static=True)
    for who, colour in (("truth", TRUTH), ("estimate", ESTIMATE), ("baseline", BASELINE)):
        arrow = rr.Arrows3D.from_fields(radii=_LINE, colors=colour)
        rec.log(f"world/{who}/pose", arrow, static=True)
        for line in ("trail", "sigma2"):
            rec.log(
                f"world/{who}/{line}", rr.LineStrips3D.from_fields(radii=_HAIR, colors=colour), static=True
            )
