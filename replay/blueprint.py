"""The layout of a recording: camera, distances and state on the left, the map and the tabs on the right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import rerun.blueprint as rrb

FRAMES_A_SECOND: Final = 13.0
TRAIL_FRAMES: Final = 130
PLOT_FRAMES_BEFORE: Final = 130
PLOT_FRAMES_AFTER: Final = 39
EYE_HEIGHT_M: Final = 52.0
TERM_EYE_HEIGHT_M: Final = 42.0
MAP_ASPECT: Final = 1.4
"""Width over height of the map's view, or a little less."""
BACKGROUND: Final = (24, 26, 30)


@dataclass(frozen=True)
class Extent:
    """The part of the map that holds everything: its centre (east, north) and half its height on screen, m."""

    centre_m: tuple[float, float]
    half_height_m: float


def layout(
    image_size_px: tuple[int, int] | None, extent: Extent | None, terms: Sequence[str] = ()
) -> rrb.Blueprint:
    """The layout for a camera of ``image_size_px`` (width, height) and a map of ``extent``, where known.

    Each of ``terms`` has a small map of its own.
    """
    left = rrb.Vertical(_camera(image_size_px), _distances(), _state(), row_shares=[10, 6, 2])
    right = rrb.Vertical(_maps(extent, terms), _tabs(), row_shares=[10, 7])
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[1, 1]),
        rrb.TimePanel(timeline="frame", state="collapsed", fps=FRAMES_A_SECOND),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        auto_layout=False,
        auto_views=False,
    )


def _camera(image_size_px: tuple[int, int] | None) -> rrb.View:
    if image_size_px is None:
        return rrb.Spatial2DView(origin="/camera", name="Camera")
    bounds = rrb.VisualBounds2D(x_range=(0, image_size_px[0]), y_range=(0, image_size_px[1]))
    return rrb.Spatial2DView(origin="/camera", name="Camera", visual_bounds=bounds)


def _window(before: int, after: int = 0) -> rrb.VisibleTimeRange:
    start = rrb.TimeRangeBoundary.cursor_relative(seq=-before)
    return rrb.VisibleTimeRange("frame", start=start, end=rrb.TimeRangeBoundary.cursor_relative(seq=after))


def _plot(origin: str, name: str, *, legend: bool = True) -> rrb.View:
    """A plot of the seconds about the cursor: its axis fits what is looked at, not the drive's worst."""
    start = rrb.TimeRangeBoundary.cursor_relative(seq=-PLOT_FRAMES_BEFORE)
    end = rrb.TimeRangeBoundary.cursor_relative(seq=PLOT_FRAMES_AFTER)
    return rrb.TimeSeriesView(
        origin=origin,
        name=name,
        axis_x=rrb.TimeAxis(view_range=rrb.TimeRange(start=start, end=end)),
        time_ranges=_window(PLOT_FRAMES_BEFORE, PLOT_FRAMES_AFTER),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop, visible=legend),
    )


def _distances() -> rrb.Container:
    return rrb.Tabs(
        _plot("/gpr", "Distances, m (line and band: predicted ± 1σ; dots: true)"),
        _plot("/distance_error", "Predicted − true, m (± 1σ)"),
        active_tab=0,
    )


def _state() -> rrb.View:
    return rrb.StateTimelineView(origin="/filter/state", name="Filter state")


def _maps(extent: Extent | None, terms: Sequence[str]) -> rrb.Container:
    near = rrb.EyeControls3D(position=(0, -0.01, EYE_HEIGHT_M), look_target=(0, 0, 0), eye_up=(0, 1, 0))
    common = ["/world/**", "- /world/surface/**"]
    views: list[rrb.View | rrb.Container] = [
        _map("Map, constraint violation", [*common, "+ /world/surface/sum/**"], near),
        _map("Map, log-probability", [*common, "+ /world/surface/log_probability/**"], near),
    ]
    if extent is not None:
        east, north = extent.centre_m
        height = 2.05 * extent.half_height_m
        far = rrb.EyeControls3D(
            position=(east, north - 0.01, height), look_target=(east, north, 0), eye_up=(0, 1, 0)
        )
        overview = [
            "/world/road",
            "/world/poles",
            "/world/truth/**",
            "/world/estimate/**",
            "/world/baseline/**",
            "/world/gps",
        ]
        views.append(_map("Whole map", overview, far, origin="/world", trail_frames=100_000))
    if terms:
        views.append(_each_constraint(terms))
    return rrb.Tabs(*views, active_tab=0)


def _each_constraint(terms: Sequence[str]) -> rrb.Container:
    """A small map for each constraint, without what would hide it."""
    near = rrb.EyeControls3D(position=(0, -0.01, TERM_EYE_HEIGHT_M), look_target=(0, 0, 0), eye_up=(0, 1, 0))
    around = ["/world/road", "/world/poles", "/world/truth/pose", "/world/estimate/pose"]
    maps = [_map(_term_title(name), [*around, f"/world/surface/terms/{name}/**"], near) for name in terms]
    return rrb.Grid(*maps, grid_columns=3 if len(maps) <= 6 else 4, name="Each constraint")


def _term_title(name: str) -> str:
    """``range_2``: "Range 2"."""
    return "GPS" if name == "gps" else name.replace("_", " ").capitalize()


def _map(
    name: str,
    contents: list[str],
    eye: rrb.EyeControls3D,
    *,
    origin: str = "/world/ego",
    trail_frames: int = TRAIL_FRAMES,
) -> rrb.View:
    trails = ("/world/truth/trail", "/world/estimate/trail", "/world/baseline/trail", "/world/gps")
    return rrb.Spatial3DView(
        origin=origin,
        name=name,
        contents=contents,
        background=BACKGROUND,
        line_grid=False,
        eye_controls=eye,
        overrides={trail: rrb.VisibleTimeRanges([_window(trail_frames)]) for trail in trails},
    )


def _tabs() -> rrb.Container:
    errors = rrb.Vertical(
        _plot("/error/position", "Position error, m"),
        _plot("/error/heading_frame", "Error along (longitudinal) and to the left (lateral), m"),
        name="Errors",
    )
    filter_ = rrb.Vertical(
        _plot("/filter/ess", "Effective sample size", legend=False),
        _plot("/filter/log_evidence", "Log evidence", legend=False),
        name="Filter",
    )
    surfaces = rrb.Vertical(
        _plot("/surface/peak", "Highest log-probability on the surface", legend=False),
        _plot("/surface/minimum", "Lowest sum of violations on the surface", legend=False),
        name="Surfaces",
    )
    return rrb.Tabs(
        errors,
        filter_,
        surfaces,
        _plot("/timing", "Timing, ms"),
        rrb.TextLogView(origin="/log", name="Log"),
        rrb.TextDocumentView(origin="/about", name="About"),
        active_tab=0,
    )
