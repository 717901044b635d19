"""The paper's plots of one replay: errors over time, the trajectory on the map, poles a frame, a frame's surface.

matplotlib comes with the extra ``figures``. Nothing is drawn on a screen.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError
from scpf.replay.recorded_run import RecordedRun
from scpf.replay.step import Surface

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

ESTIMATE, BASELINE, REFERENCE, GPS, POLES = "#d55e00", "#999999", "#0072b2", "#cccccc", "#009e73"
"""Told apart with any colour vision."""
MARGIN_M: Final = 25.0
DEEPEST: Final = -40.0
"""Log-probabilities below are drawn as this: what is impossible has no shape worth showing."""


def errors_over_time(figure: Figure, run: RecordedRun) -> None:
    """Position error of the filter and of the plain one; longitudinal and lateral error with the filter's ±2σ."""
    top, below = figure.subplots(2, 1, sharex=True)
    seconds = run.times_s
    top.plot(seconds, run.baseline_error_m, color=BASELINE, label="plain PF", linewidth=1)
    top.plot(seconds, run.errors_m[:, 0], color=ESTIMATE, label=run.settings.preset, linewidth=1.4)
    top.set(ylabel="position error, m", ylim=(0, None))
    top.legend(loc="upper right", frameon=False)
    spread = 2.0 * np.sqrt((run.deviations_m**2).mean(axis=1))
    below.fill_between(
        seconds, -spread, spread, color=ESTIMATE, alpha=0.12, linewidth=0, label="±2σ of an axis"
    )
    below.plot(seconds, run.errors_m[:, 1], color=ESTIMATE, linewidth=1.2, label="longitudinal")
    below.plot(seconds, run.errors_m[:, 2], color=REFERENCE, linewidth=1.2, label="lateral")
    below.axhline(0.0, color="black", linewidth=0.6)
    below.set(xlabel="time, s", ylabel="error, m")
    below.legend(loc="upper right", frameon=False, ncols=3)


def trajectory_on_the_map(figure: Figure, run: RecordedRun) -> None:
    """Road, poles, reference, GPS fixes and both filters' tracks; East to the right, North up."""
    axes = figure.add_subplot()
    shown = np.vstack([run.reference_m, run.estimate_m])
    shown = shown[np.isfinite(shown).all(axis=1)]
    if not len(shown):
        raise InputError(f"{run.name}: nothing says where the vehicle was", "there is no track to draw")
    low, high = shown.min(axis=0) - MARGIN_M, shown.max(axis=0) + MARGIN_M
    if run.road_map is not None:
        line = run.road_map.centre_line_m
        axes.plot(*line.T, color="black", linewidth=0.7, linestyle=(0, (6, 4)), label="centre line")
        axes.plot(*run.road_map.positions_m.T, "o", color=POLES, markersize=5, label="poles")
        for mark in run.road_map.landmarks:
            if (low < mark.position_m[:2]).all() and (mark.position_m[:2] < high).all():
                axes.annotate(mark.id, mark.position_m[:2], (4, 4), textcoords="offset points", fontsize=6)
    axes.plot(*run.gps_m.T, ".", color=GPS, markersize=3, label="GPS", zorder=0)
    axes.plot(*run.baseline_m.T, color=BASELINE, linewidth=1, label="plain PF")
    axes.plot(*run.reference_m.T, color=REFERENCE, linewidth=2.2, label="reference")
    axes.plot(*run.estimate_m.T, color=ESTIMATE, linewidth=1.2, label=run.settings.preset)
    axes.set(xlabel="east, m", ylabel="north, m", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set_aspect("equal", adjustable="box")
    axes.legend(loc="best", frameon=False, fontsize=8)


def poles_a_frame(figure: Figure, run: RecordedRun) -> None:
    """How many frames saw how many poles, and matched how many of them."""
    axes = figure.add_subplot()
    matched = np.array([len(run.matched(row)) for row in range(len(run.frames))])
    most = int(max(run.poles.max(initial=0), matched.max(initial=0)))
    counts = np.arange(most + 1)
    for offset, values, colour, label in (
        (-0.2, run.poles, POLES, "seen"),
        (0.2, matched, REFERENCE, "matched"),
    ):
        share = 100.0 * np.bincount(values, minlength=most + 1) / len(run.frames)
        bars = axes.bar(
            counts + offset, share, 0.4, color=colour, label=f"{label}, {values.mean():.2f} on average"
        )
        axes.bar_label(bars, labels=[f"{each:.0f}" if each else "" for each in share], fontsize=8)
    axes.set(xlabel="poles in a frame", ylabel="frames, %", xticks=counts)
    axes.legend(frameon=False)


def surface_flat(figure: Figure, run: RecordedRun, row: int) -> None:
    """Sum of violations and joint log-probability about the estimate of a frame, as maps."""
    surface = surface_of(run, row)
    for axes, values, title in zip(figure.subplots(1, 2), *_kinds(surface), strict=True):
        image = axes.pcolormesh(*_grid(surface), values, cmap="viridis", shading="nearest", rasterized=True)
        figure.colorbar(image, ax=axes, shrink=0.75)
        axes.set(title=title, xlabel="east, m")
        _mark(axes, run, row)
        axes.set_aspect("equal")
    figure.axes[0].set_ylabel("north, m")


def surface_in_space(figure: Figure, run: RecordedRun, row: int) -> None:
    """The same in three dimensions, as in the paper's figure."""
    surface = surface_of(run, row)
    for k, (values, title) in enumerate(zip(*_kinds(surface), strict=True)):
        axes = figure.add_subplot(1, 2, k + 1, projection="3d")
        axes.plot_surface(*_grid(surface), values, cmap="viridis", linewidth=0, rcount=81, ccount=81)
        axes.set(xlabel="east, m", ylabel="north, m", title=title)
        axes.locator_params(axis="x", nbins=5)
        axes.locator_params(axis="y", nbins=5)


def surface_of(run: RecordedRun, row: int) -> Surface:
    """The surface of a row; InputError where there is none."""
    surface = run.surface(row)
    if surface is None:
        raise InputError(
            f"{run.name}: frame {run.frames[row]} has no estimate", "choose a later one with --frame"
        )
    return surface


def telling_row(run: RecordedRun) -> int | None:
    """The row whose surface tells most: of those that matched most poles, the one in the middle; None without any."""
    matched = np.array(
        [len(run.matched(row)) if run.means[row] is not None else -1 for row in range(len(run.frames))]
    )
    if matched.max(initial=-1) < 0:
        return None
    best = np.flatnonzero(matched == matched.max())
    return int(best[len(best) // 2])


FIGURES: Final[dict[str, tuple[str, Callable[..., None]]]] = {
    "errors": ("Errors over time", errors_over_time),
    "trajectory": ("Trajectory", trajectory_on_the_map),
    "poles": ("Poles a frame", poles_a_frame),
}
SURFACES: Final[dict[str, tuple[str, Callable[..., None]]]] = {
    "surface": ("Constraint surface", surface_flat),
    "surface_3d": ("Constraint surface, in three dimensions", surface_in_space),
}


def _kinds(surface: Surface) -> tuple[tuple[Array, Array], tuple[str, str]]:
    violation = surface.violation - surface.violation.min()
    probability = np.maximum(surface.log_probability - surface.log_probability.max(), DEEPEST)
    return (violation, probability), ("Σ max(C, 0), above its minimum", "Σ log Pr(γ ≥ C), below its maximum")


def _grid(surface: Surface) -> tuple[Array, Array]:
    """East and north (R, C) of the cells, m."""
    rows, columns = surface.violation.shape
    east = surface.corner_m[0] + surface.cell_m * np.arange(columns)
    north = surface.corner_m[1] + surface.cell_m * np.arange(rows)
    grid_east, grid_north = np.meshgrid(east, north)
    return grid_east, grid_north


def _mark(axes: Axes, run: RecordedRun, row: int) -> None:
    """The estimate and the reference of a row."""
    axes.plot(*run.estimate_m[row], "o", color=ESTIMATE, markersize=7, label=run.settings.preset)
    axes.plot(*run.reference_m[row], "x", color="white", markersize=8, markeredgewidth=2, label="reference")
    axes.legend(loc="upper right", fontsize=7)
