"""Logistic regression."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

CONVERGED = 1e-9


def logistic(evidence: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights of the columns of ``evidence`` (N, K), the last of which is constant; Newton's steps, a weak prior."""
    weights, prior = np.zeros(evidence.shape[1]), 1e-2
    for _ in range(200):
        p = 1 / (1 + np.exp(-evidence @ weights))
        gradient = evidence.T @ (right - p) - prior * weights
        curvature = (evidence * (p * (1 - p))[:, None]).T @ evidence + prior * np.eye(len(weights))
        step = 0.5 * np.linalg.solve(curvature, gradient)
        weights += step
        if np.abs(step).max() < CONVERGED:
            break
    return weights
