"""``scpf figures``: a replay's plots as PNG files and one HTML page, for who does not open a viewer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figures(
    results: Path,
    *,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    frame: int | None = None,
    overwrite: bool = False,
) -> int:
    """Draw a replay's results: errors over time, trajectory, poles a frame, and the constraint surface of a frame.

    Leaves NAME_*.png and NAME.html; the page holds all of them and needs nothing beside it.

    Examples:

        scpf figures out/ring_road.results.mcap

        scpf figures out/ring_road.results.mcap -o figures --frame 40

    Parameters
    ----------
    results
        The NAME.results.mcap of a replay.
    output
        Folder for the figures; by default that of the results. Made where it is missing.
    frame
        Index of the frame whose surface is drawn; by default one that matched most poles.
    overwrite
        Replace figures of that name.
    """
    from functools import partial

    import numpy as np

    from scpf.models.errors import InputError, UsageError
    from scpf.replay import run_figures
    from scpf.replay.distance_figures import check_matplotlib
    from scpf.replay.figures_page import page
    from scpf.replay.recorded_run import read_run

    check_matplotlib()
    run = read_run(results)
    row = run_figures.telling_row(run)
    if frame is not None:
        found = np.flatnonzero(run.frames == frame)
        if not len(found):
            hint = f"its frames go from {run.frames.min()} to {run.frames.max()}"
            raise UsageError(f"{results} has no frame {frame}", hint)
        row = int(found[0])
    drawings: dict[str, tuple[str, Callable[[Figure], None]]] = {
        name: (caption, partial(draw, run=run)) for name, (caption, draw) in run_figures.FIGURES.items()
    }
    if row is None:
        del drawings["trajectory"]  # nobody knows where it was
    else:
        for name, (caption, on_frame) in run_figures.SURFACES.items():
            drawings[name] = (f"{caption} of frame {run.frames[row]}", partial(on_frame, run=run, row=row))
    folder = results.parent if output is None else output
    paths = {name: folder / f"{run.name}_{name}.png" for name in drawings}
    paths["page"] = folder / f"{run.name}.html"
    for path in paths.values():
        if path.exists() and not overwrite:
            raise InputError(f"{path} exists", "use --overwrite, or another --output")
    folder.mkdir(parents=True, exist_ok=True)
    pictures = []
    for name, (caption, drawing) in drawings.items():
        png = _png(drawing)
        paths[name].write_bytes(png)
        pictures.append((caption, png))
    paths["page"].write_text(page(run, pictures), encoding="utf-8")
    for path in paths.values():
        print(path)
    return 0


def _png(drawing: Callable[[Figure], None]) -> bytes:
    """What ``drawing`` draws, as PNG."""
    import io

    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 5.4), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    drawing(figure)
    data = io.BytesIO()
    figure.savefig(data, format="png", metadata={"Software": None})  # the same figure is the same bytes
    return data.getvalue()
