"""Figures of a distance model as PNG files: predictions, errors by distance, coverage, and Tukey's intervals.

matplotlib comes with the extra ``figures``. Nothing is drawn on a screen.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import MissingError
from scpf.models.whole_files import whole
from scpf.replay.distance_evaluation import BANDS_M, Z_95, Residuals

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

INCHES: Final = (6.4, 4.8)
DPI: Final = 120
LEVELS: Final = np.linspace(0.05, 0.95, 19)
COLOURS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")
"""Told apart with any colour vision; one an expert."""


def figure_paths(folder: Path, landmark_class: str) -> list[Path]:
    """The files that ``draw`` writes; ``drawn`` finds those of any class."""
    name = re.sub(r"\W+", "_", landmark_class)
    kinds = ("predictions", "errors", "coverage", "comparisons")
    return [folder / f"distance_{name}_{kind}.png" for kind in kinds]


def drawn(folder: Path) -> list[Path]:
    """The figures that are in ``folder`` already."""
    return sorted(folder.glob("distance_*_*.png"))


def check_matplotlib() -> None:
    """MissingError where matplotlib is not installed."""
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise MissingError(
            "figures need matplotlib, which is not installed", "pip install 'scpf[figures]'"
        ) from error


def draw(
    folder: Path,
    landmark_class: str,
    names: Sequence[str],
    held_out: Residuals,
    comparisons: Mapping[str, Any],
    about: str,
) -> list[Path]:
    """Write the figures of predictions that were held out by pole, and of ``compare``'s results by split.

    ``names``: the experts; ``about`` goes below each title. Returns the paths. MissingError without matplotlib.
    """
    check_matplotlib()
    folder.mkdir(parents=True, exist_ok=True)
    drawings: list[Callable[[Axes], None]] = [
        lambda axes: _predictions(axes, names, held_out),
        lambda axes: _errors(axes, held_out),
        lambda axes: _coverage(axes, names, held_out),
        lambda axes: _comparisons(axes, comparisons),
    ]
    if not len(held_out.error_m):  # a single pole leaves none to hold out
        drawings[:3] = [_nothing] * 3
    paths = figure_paths(folder, landmark_class)
    for path, drawing in zip(paths, drawings, strict=True):
        _save(path, drawing, about)
    return paths


def _save(path: Path, drawing: Callable[[Axes], None], about: str) -> None:
    """One figure, replacing ``path`` only when it is whole."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=INCHES, dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.grid(alpha=0.3)
    drawing(axes)
    figure.supxlabel(about, fontsize=8, color="0.4")
    # Without the version of matplotlib in it, the same figures give the same file.
    with whole(path) as partial:
        figure.savefig(partial, format="png", metadata={"Software": None})


def _nothing(axes: Axes) -> None:
    axes.set(title="No pole could be held out")


def _predictions(axes: Axes, names: Sequence[str], held_out: Residuals) -> None:
    low, high = float(held_out.distance_m.min()), float(held_out.distance_m.max())
    axes.plot([low, high], [low, high], color="0.3", linewidth=1, label="exact")
    for k, (name, colour) in enumerate(zip(names, COLOURS, strict=False)):
        mine = np.flatnonzero(held_out.expert == k)[:: max(1, int((held_out.expert == k).sum()) // 400)]
        true = held_out.distance_m[mine]
        axes.errorbar(
            true,
            true + held_out.error_m[mine],
            Z_95 * np.sqrt(held_out.variance_m2[mine]),
            fmt=".",
            markersize=3,
            elinewidth=0.4,
            color=colour,
            label=f"{name}, ± 1.96 σ",
        )
    axes.set(title="Distances held out by pole", xlabel="true distance (m)", ylabel="predicted distance (m)")
    axes.legend()


def _errors(axes: Axes, held_out: Residuals) -> None:
    labels: list[str] = []
    errors: list[Array] = []
    deviations: list[float] = []
    for low, high in pairwise(BANDS_M):
        mine = (held_out.distance_m >= low) & (held_out.distance_m < high)
        if mine.any():
            labels.append(f"{low:.0f}–{high:.0f}")
            errors.append(held_out.error_m[mine])
            deviations.append(float(np.sqrt(np.median(held_out.variance_m2[mine]))))
    places = np.arange(1, len(labels) + 1)
    axes.boxplot(
        errors, positions=places, whis=(2.5, 97.5), showfliers=False, medianprops={"color": COLOURS[0]}
    )
    for sign in (-1.0, 1.0):
        axes.plot(
            places,
            sign * Z_95 * np.array(deviations),
            "_",
            markersize=18,
            color=COLOURS[1],
            label="predicted ± 1.96 σ (median)" if sign > 0 else None,
        )
    axes.set_xticks(places, labels)
    axes.set(
        title="Errors by distance: quartiles, and 95 % between the whiskers",
        xlabel="true distance (m)",
        ylabel="prediction − truth (m)",
    )
    axes.legend()


def _coverage(axes: Axes, names: Sequence[str], held_out: Residuals) -> None:
    from scipy.stats import norm

    quantiles = norm.ppf(0.5 + 0.5 * LEVELS)
    axes.plot([0, 1], [0, 1], color="0.3", linewidth=1, label="right")
    kinds = (
        (held_out.variance_m2, "-", "predictive"),
        (held_out.function_variance_m2, ":", "function alone"),
    )
    for k, (name, colour) in enumerate(zip(names, COLOURS, strict=False)):
        mine = held_out.expert == k
        if not mine.any():
            continue
        size = np.abs(held_out.error_m[mine])
        for variance, style, kind in kinds:
            inside = (size[:, None] <= quantiles * np.sqrt(variance[mine])[:, None]).mean(axis=0)
            axes.plot(LEVELS, inside, style, color=colour, label=f"{name}, {kind}")
    axes.set(
        title="Coverage: share of errors inside the predicted interval",
        xlabel="probability of the interval",
        ylabel="share inside",
        xlim=(0, 1),
        ylim=(0, 1),
    )
    axes.legend()


def _comparisons(axes: Axes, comparisons: Mapping[str, Any]) -> None:
    labels: list[str] = []
    for split, colour in (("random", COLOURS[0]), ("by_pole", COLOURS[1])):
        for name, found in comparisons.get(split, {}).items():
            for row in found["pairs"] if found is not None else ():
                reach = [[row["difference_m"] - row["low_m"]], [row["high_m"] - row["difference_m"]]]
                axes.errorbar(row["difference_m"], len(labels), xerr=reach, fmt="o", color=colour, capsize=4)
                first, second = row["pair"]
                labels.append(f"{name}: {first}\n− {second} ({split.replace('_', ' ')})")
    axes.axvline(0.0, color="0.3", linewidth=1)
    axes.set_yticks(range(len(labels)), labels, fontsize=8)
    axes.invert_yaxis()
    axes.set(
        title="Tukey's test: differences of mean absolute error, 95 %",
        xlabel="m; right of 0 the second one is better",
    )
