"""The part of a recording that shows each constraint by itself: a grid each, around the vehicle."""

from __future__ import annotations

from typing import Final

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from scpf.replay import shapes
from scpf.replay.recording_rows import RowBatches
from scpf.replay.step import Surface, SurfaceTerm

ENTITY: Final = "world/surface/terms"
LABEL: Final = (225, 225, 225)
DEPTH_M: Final = 0.05
"""The grids lie this far below the ground, so that everything else is drawn over them."""


class TermGrids:
    """Writes the terms of surfaces as grid maps of log Pr(γ ≥ C), from −20 to 0; a frame without one shows none."""

    def __init__(self, rec: rr.RecordingStream, rows: RowBatches) -> None:
        self._rec, self._rows = rec, rows
        self._sizes: dict[str, tuple[int, int, float]] = {}
        self._labelled: set[str] = set()

    def log(self, surface: Surface) -> None:
        """The terms of one surface."""
        corner_m = np.asarray(surface.corner_m) - surface.cell_m / 2
        top_left_m = corner_m + np.array([0.0, surface.violation.shape[0] * surface.cell_m])
        for name in sorted(self._sizes.keys() | surface.terms.keys()):
            term = surface.terms.get(name)
            data: list[bytes] = []
            corner: list[tuple[float, ...]] = []
            if term is not None:
                self._style(name, surface, term)
                # A grid map is placed by its lower left corner, and its first row is the top one.
                data, corner = [_shown(term)[::-1].tobytes()], [(*corner_m, -DEPTH_M)]
            self._rows.add(f"{ENTITY}/{name}", rr.GridMap.columns, data=data, translation=corner)
            if name in self._labelled:
                labels = [term.label] if term is not None else []
                at = shapes.on_ground(np.tile(top_left_m, (len(labels), 1)))
                self._rows.add(f"{ENTITY}/{name}/label", rr.Points3D.columns, positions=at, labels=labels)

    def _style(self, name: str, surface: Surface, term: SurfaceTerm) -> None:
        """Size and colours, when they are new."""
        size = (*surface.violation.shape, surface.cell_m)
        if self._sizes.get(name) == size:
            return
        self._sizes[name] = size
        rows, columns, cell_m = size
        form = rr.components.ImageFormat(width=columns, height=rows, color_model="L", channel_datatype="F16")
        style = rr.GridMap.from_fields(cell_size=cell_m, colormap="Viridis", opacity=0.6, format=form)
        self._rec.log(f"{ENTITY}/{name}", style, static=True)
        if not term.label:
            return
        self._labelled.add(name)
        label = rr.Points3D.from_fields(radii=rr.Radius.ui_points(0), colors=LABEL, show_labels=True)
        self._rec.log(f"{ENTITY}/{name}/label", label, static=True)


def _shown(term: SurfaceTerm) -> NDArray[np.float16]:
    """The values (R, C) within what the colours can tell apart.

    The viewer would show a grid of zeros in the darkest colour, as if the constraint were broken everywhere: it is put
    a thousandth below, and has the middle one, as every grid that is the same everywhere.
    """
    values = np.nan_to_num(term.log_probability, nan=shapes.LOG_PROBABILITY_FLOOR)
    shown = np.clip(values, shapes.LOG_PROBABILITY_FLOOR, 0.0).astype(np.float16)
    return shown if shown.any() else shown - np.float16(1e-3)
