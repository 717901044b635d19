"""Figures of an evaluation as PNG files: error against GPS noise, error over time, poles in sight.

matplotlib comes with the extra ``figures``. Nothing is drawn on a screen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError
from scpf.models.whole_files import whole
from scpf.replay.distance_figures import COLOURS, DPI, check_matplotlib
from scpf.replay.evaluation import Result, pooled
from scpf.replay.evaluation_plan import Plan
from scpf.replay.evaluation_scenarios import Scenarios
from scpf.replay.evaluation_surface import surface_2d, surface_3d
from scpf.replay.protocol import Scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

WIDTH_INCHES: Final = 7.2
PANEL_INCHES: Final = 2.6
MOST_POINTS: Final = 500
LEAST_M: Final = 0.05
OTHERS_PERCENT: Final = 99.5
"""Axes end here: a single frame of the first moments would flatten all others."""


def figure_paths(folder: Path, plan: Plan) -> list[Path]:
    """The files that ``draw`` writes."""
    kinds = ("error_against_gps", "error_over_time", "surface_2d", "surface_3d")
    return [folder / "poles_in_sight.png"] + [
        folder / f"{kind}_{name}.png" for name in plan.names for kind in kinds
    ]


def draw(folder: Path, plan: Plan, results: Sequence[Result], scenarios: Scenarios) -> list[Path]:
    """Write the figures, replacing those in ``folder``; one of each kind a case or recording. Returns the paths.

    MissingError without matplotlib, InputError where a file cannot be written.
    """
    check_matplotlib()
    drawings: list[Callable[[Figure], None]] = [partial(poles_in_sight, scenarios=scenarios)]
    for name in plan.names:
        mine = [result for result in results if result.case == name]
        first = scenarios[name, 0]
        drawings += [
            partial(error_against_gps, results=mine),
            partial(error_over_time, plan=plan, results=mine, scenario=first),
            partial(surface_2d, scenario=first),
            partial(surface_3d, scenario=first),
        ]
    paths = figure_paths(folder, plan)
    for path, drawing in zip(paths, drawings, strict=True):
        _save(path, drawing)
    return paths


def error_against_gps(figure: Figure, results: Sequence[Result]) -> None:
    """Mean position error of each preset against the deviation of the GPS, with the band of 95 % of the runs."""
    axes = figure.add_subplot()
    rows = pooled(results)
    for preset, colour in zip(_presets(results), COLOURS, strict=False):
        mine = sorted((row for row in rows if row["preset"] == preset), key=lambda row: float(row["sigma_m"]))
        sigma, mean, low, high = (
            np.array([row[key] for row in mine]) for key in ("sigma_m", "mean_m", "run_low_m", "run_high_m")
        )
        axes.fill_between(sigma, low, high, color=colour, alpha=0.15, linewidth=0)
        reach = np.maximum([mean - low, high - mean], 0.0)  # a skewed band may leave its mean outside
        axes.errorbar(sigma, mean, reach, fmt="o-", markersize=4, capsize=3, color=colour, label=preset)
    axes.set(
        title=f"{results[0].case}: mean position error, and 95 % of the runs",
        xlabel="deviation of the GPS (m an axis)",
        ylabel="mean position error (m)",
    )
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)
    axes.legend()


def error_over_time(figure: Figure, plan: Plan, results: Sequence[Result], scenario: Scenario) -> None:
    """Error frame by frame on the first drive, a panel a GPS deviation: mean of the runs and 95 % of them."""
    times_s = block_means(scenario.times_s)
    sigmas = sorted({result.sigma_m for result in results})
    figure.set_figheight(1.2 + PANEL_INCHES * len(sigmas))
    panels = figure.subplots(len(sigmas), 1, sharex=True, squeeze=False)[:, 0]
    for axes, sigma_m in zip(panels, sigmas, strict=True):
        mine = [result for result in results if result.sigma_m == sigma_m and result.drive == 0]
        for result, colour in zip(mine, COLOURS, strict=False):
            trace = result.trace
            mean, low, high = (block_means(values) for values in (trace.mean_m, trace.low_m, trace.high_m))
            axes.fill_between(times_s, low, high, color=colour, alpha=0.15, linewidth=0)
            axes.plot(times_s, mean, color=colour, linewidth=0.9, label=result.preset)
        for start_s, end_s in plan.conditions.gps_outages_s:
            axes.axvspan(start_s, min(end_s, scenario.times_s[-1]), color="0.85", zorder=0)
        top = max(float(np.percentile(result.trace.high_m, OTHERS_PERCENT)) for result in mine)
        axes.set(ylabel="position error (m)", title=f"GPS of {sigma_m:g} m", ylim=(0.0, 1.05 * top))
        if plan.conditions.gps_outages_s or not plan.conditions.gps_after_start:
            # What is lost without GPS is off by a hundred times what is not.
            axes.set(yscale="log", ylim=(LEAST_M, 1.5 * top))
        axes.grid(alpha=0.3)
    figure.legend(*panels[0].get_legend_handles_labels(), ncols=len(COLOURS), loc="outside lower center")
    panels[-1].set_xlabel(
        "time since the first frame (s)" + "; grey: no GPS" * bool(plan.conditions.gps_outages_s)
    )
    figure.suptitle(f"{results[0].case}: mean of the runs, and 95 % of them")


def block_means(values: Array) -> Array:
    """Means of equally long blocks of values (K,), at most ``MOST_POINTS``; an unfinished last block is left out.

    More points than pixels hide each other. Up to that many they stay as they are.
    """
    length = -(-len(values) // MOST_POINTS)
    whole = len(values) // length * length
    means: Array = values[:whole].reshape(-1, length).mean(axis=1)
    return means


def poles_in_sight(figure: Figure, scenarios: Scenarios) -> None:
    """Share of the frames by how many poles were detected, a bar a case or recording."""
    axes = figure.add_subplot()
    counts: dict[str, list[int]] = {}
    for (name, _), scenario in scenarios.items():
        counts.setdefault(name, []).extend(len(frame) for frame in scenario.detections)
    most = max(max(numbers) for numbers in counts.values())
    width = 0.8 / len(counts)
    for k, (name, numbers) in enumerate(counts.items()):
        share = np.bincount(numbers, minlength=most + 1) / len(numbers)
        axes.bar(np.arange(most + 1) + (k - (len(counts) - 1) / 2) * width, 100 * share, width, label=name)
    axes.set_xticks(range(most + 1))
    axes.set(title="Poles detected in a frame", xlabel="poles", ylabel="frames (%)")
    axes.grid(alpha=0.3, axis="y")
    axes.set_axisbelow(True)
    axes.legend()


def _presets(results: Sequence[Result]) -> list[str]:
    return list(dict.fromkeys(result.preset for result in results))


def _save(path: Path, drawing: Callable[[Figure], None]) -> None:
    """One figure, replacing ``path`` only when it is whole."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH_INCHES, 4.6), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    drawing(figure)
    # Without the version of matplotlib in it, the same figures give the same file.
    try:
        with whole(path) as partial:
            figure.savefig(partial, format="png", metadata={"Software": None})
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror})") from error
