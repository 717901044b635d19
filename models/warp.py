"""Distances learnt on another scale: the powers of Box and Cox (J. R. Stat. Soc. B 26, 1964).

What a mask shows of a landmark is about proportional to 1/distance, and measured to about a pixel at any distance. So
the errors of a predicted distance grow with it, where a Gaussian process has one noise variance for all. On the scale
of some power of the distance they are alike; which one, the likelihood says (warped Gaussian processes: Snelson,
Rasmussen and Ghahramani, NIPS 2003, section 3).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

POWERS: Final = (1.0, 0.5, 0.0, -0.5, -1.0)
"""Those that are tried: from the distance itself over its logarithm (0) to its inverse."""

RANGE_M: Final = (1.0, 500.0)
"""What is extrapolated to less or more counts as so much."""


@dataclass(frozen=True)
class Warp:
    """y = s + s ((d/s)^p − 1) / p, or s + s ln(d/s) where the power p is 0.

    ``scale_m``: s, at which y is the distance d and changes as it does.
    """

    power: float
    scale_m: float

    @classmethod
    def of(cls, power: float, distances_m: Array) -> Warp:
        """With the geometric mean of ``distances_m`` (N,) as its scale."""
        return cls(power, float(np.exp(np.log(distances_m).mean())))

    def targets(self, distances_m: Array) -> Array:
        """What is learnt (N,) in place of distances (N,); it grows with them, in m."""
        share = distances_m / self.scale_m
        warped: Array = np.log(share) if self.power == 0.0 else (share**self.power - 1.0) / self.power
        return self.scale_m * (1.0 + warped)

    def distances(self, means: Array, variances: Array) -> tuple[Array, Array]:
        """Means (N,), m, and variances (K, N), m², of the distances of targets with these; to first order."""
        least, most = self._range
        share = np.minimum(np.maximum(means, least), most) / self.scale_m - 1.0
        share = np.exp(share) if self.power == 0.0 else (1.0 + self.power * share) ** (1.0 / self.power)
        return self.scale_m * share, variances * share ** (2.0 - 2.0 * self.power)

    @cached_property
    def _range(self) -> tuple[float, float]:
        """The targets of `RANGE_M`."""
        least, most = self.targets(np.array(RANGE_M)).tolist()
        return least, most

    def log_slope(self, distances_m: Array) -> float:
        """Logarithm of the slopes' product: what the likelihood of the targets lacks to that of the distances."""
        return float((self.power - 1.0) * np.log(distances_m / self.scale_m).sum())


def targets(distances_m: Array, warp: Warp | None) -> Array:
    """What is learnt (N,) of distances (N,): themselves without a warp."""
    return distances_m if warp is None else warp.targets(distances_m)
