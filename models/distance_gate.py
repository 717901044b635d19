"""The gate of the mixture of experts: which of them answers for an instance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.distance_kernels import most_probable
from scpf.models.features import BOX, Features

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

GATE_FEATURES: Final = (*BOX, "thickness")
"""What the gate looks at."""


@dataclass(frozen=True, eq=False)
class Gate:
    """Gaussian mixture, diagonal, on (box width / height, thickness px), from the closest component to the farthest.

    ``shares`` (K,), ``means`` (K, 2), ``variances`` (K, 2): a row a component, K ≥ 2.
    """

    shares: Array
    means: Array
    variances: Array

    def experts(self, features: Features) -> Indices:
        """Index (N,) of the component with the highest posterior.

        With one addition: an instance thinner than the farthest poles are on average is among the farthest,
        one thicker than the closest are on average is among the closest. Without it the broader component
        also takes the other's outliers (a half hidden pole at 50 m has an odd shape), and they ruin its
        expert.
        """
        inputs = gate_inputs(features)
        chosen = most_probable(inputs, self.shares, self.means, self.variances)
        thickness = inputs[:, 1]
        chosen[thickness > self.means[0, 1]] = 0
        chosen[thickness < self.means[-1, 1]] = len(self.shares) - 1
        return chosen


def expert_names(experts: int) -> tuple[str, ...]:
    """Names of so many experts, from the closest to the farthest."""
    if experts == 1:
        return ("single",)
    between = ("middle",) if experts == 3 else tuple(f"middle {k}" for k in range(1, experts - 1))
    return ("close", *between, "far")


def gate_inputs(features: Features) -> Array:
    """What the gate looks at (N, 2): box width / height, and thickness (px)."""
    x1, x2, y1, y2, thickness = features.columns(GATE_FEATURES).T
    inputs = np.empty((len(features), 2))
    inputs[:, 0] = (x2 - x1) / np.maximum(y2 - y1, 1.0)
    inputs[:, 1] = thickness
    return inputs


def fit_gate(features: Features, experts: int, seed: int) -> Gate:
    """The mixture of ``experts`` ≥ 2 components for at least as many instances; thickness orders them."""
    from sklearn.mixture import GaussianMixture

    mixture = GaussianMixture(
        experts, covariance_type="diag", reg_covar=1e-8, max_iter=1000, n_init=3, random_state=seed
    )
    mixture.fit(gate_inputs(features))
    order = np.argsort(-mixture.means_[:, 1])
    return Gate(mixture.weights_[order], mixture.means_[order], mixture.covariances_[order])
