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

EXPERTS: Final = ("close", "far")
"""The gate's components, in this order."""

GATE_FEATURES: Final = (*BOX, "thickness")
"""What the gate looks at."""


@dataclass(frozen=True, eq=False)
class Gate:
    """Gaussian mixture, diagonal, on (box width / height, thickness px): component 0 is close, 1 is far.

    ``shares`` (2,), ``means`` (2, 2), ``variances`` (2, 2): a row a component.
    """

    shares: Array
    means: Array
    variances: Array

    def experts(self, features: Features) -> Indices:
        """Index into ``EXPERTS`` (N,) of the component with the highest posterior.

        With one addition: an instance thinner than far poles are on average is far, one thicker than close
        poles are on average is close. Without it the broader component also takes the other's outliers (a
        half hidden pole at 50 m has an odd shape), and they ruin its expert.
        """
        inputs = gate_inputs(features)
        chosen = most_probable(inputs, self.shares, self.means, self.variances)
        thickness, (close_px, far_px) = inputs[:, 1], self.means[:, 1]
        chosen[thickness > close_px] = 0
        chosen[thickness < far_px] = 1
        return chosen


def gate_inputs(features: Features) -> Array:
    """What the gate looks at (N, 2): box width / height, and thickness (px)."""
    x1, x2, y1, y2, thickness = features.columns(GATE_FEATURES).T
    inputs = np.empty((len(features), 2))
    inputs[:, 0] = (x2 - x1) / np.maximum(y2 - y1, 1.0)
    inputs[:, 1] = thickness
    return inputs


def fit_gate(features: Features, seed: int) -> Gate:
    """The Gaussian mixture of N ≥ 2 instances; the component with the larger mean thickness becomes
    "close".
    """
    from sklearn.mixture import GaussianMixture

    mixture = GaussianMixture(
        2, covariance_type="diag", reg_covar=1e-8, max_iter=1000, n_init=3, random_state=seed
    )
    mixture.fit(gate_inputs(features))
    order = np.argsort(-mixture.means_[:, 1])
    return Gate(mixture.weights_[order], mixture.means_[order], mixture.covariances_[order])
