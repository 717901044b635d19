"""Another localization's pose as one more observation: the paper's use of the filter as an add-on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scpf.models.geodesy import wrap_angle

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PoseFix:
    """A position (2,) in map with its covariance (2, 2), m², and where it is known the heading (rad) with its variance.

    Without ``heading_rad`` it is a `PositionFix` whose axes differ. A heading needs states that have one: [x, y, vx,
    vy, ψ, …].
    """

    position_m: Array
    covariance_m2: Array
    heading_rad: float | None = None
    heading_variance_rad2: float = 1.0

    @property
    def variance_m2(self) -> float:
        """Mean variance of an axis."""
        return float(np.trace(self.covariance_m2)) / 2.0

    def log_likelihood(self, states: Array) -> Array:
        """log p(z | x) (N,) without its constant."""
        off = states[:, :2] - self.position_m
        log_density: Array = -0.5 * (off * np.linalg.solve(self.covariance_m2, off.T).T).sum(axis=1)
        if self.heading_rad is not None:
            turned = wrap_angle(states[:, 4] - self.heading_rad)
            log_density = log_density - 0.5 * turned**2 / self.heading_variance_rad2
        return log_density
