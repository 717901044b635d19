"""The constraint surface: what the constraints say of every place about the estimate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scpf.models.constraint_surface import surfaces
from scpf.models.constraints import Constraint
from scpf.replay.settings import SurfaceSettings
from scpf.replay.step import Surface

Array = NDArray[np.float64]


def constraint_surface(constraints: Sequence[Constraint], mean: Array, grid: SurfaceSettings) -> Surface:
    """The constraints' values on a grid about the estimate ``mean`` (D,), at its velocity.

    The paper's surface is the sum of the violations; the joint log-probability is its probabilistic twin.
    """
    # Cells lie on multiples of their size, so that the surface does not shimmer from frame to frame.
    corner_m = np.round(mean[:2] / grid.cell_m - (grid.cells - 1) / 2) * grid.cell_m
    steps = np.arange(grid.cells) * grid.cell_m
    return Surface(
        corner_m, grid.cell_m, *surfaces(constraints, mean, corner_m[0] + steps, corner_m[1] + steps)
    )
