"""The compiled parts of a distance prediction: for a frame's few instances, numpy's calls cost more than the sums."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
F = TypeVar("F", bound=Callable[..., Any])


def _kernel(function: F) -> F:
    # Sums may be reordered, so that they run in vector registers; NaN and infinity keep their meaning.
    return cast(
        F, numba.njit(cache=True, fastmath={"reassoc", "contract", "nsz"}, error_model="numpy")(function)
    )


@_kernel
def posterior(
    points: Array,
    centre: Array,
    units: Array,
    inputs: Array,
    factor: Array,
    weights: Array,
    bounds: Array,
    signal_m2: float,
    noise_m2: float,
    offset_m: float,
) -> Array:
    """At points (M, D), as rows (4, M): mean (m), predictive variance, variance of the function (m²), 1 in range or 0.

    ``centre``, ``units`` (D,) make points comparable with ``inputs`` (N, D), which are in units of the length
    scales; ``factor`` (N, N), ``weights`` (N,), ``offset_m``: as in ``GaussianProcess``; ``bounds`` (2, D): the range.
    Eqs. (1) and (2) of the paper, by forward substitution.
    """
    total, n, d = points.shape[0], inputs.shape[0], inputs.shape[1]
    found = np.empty((4, total))
    cross, point = np.zeros((3, n)), np.empty(d)
    for first in range(0, total, 3):
        together = min(3, total - first)
        for k in range(together):
            inside = 1.0
            for j in range(d):
                point[j] = (points[first + k, j] - centre[j]) / units[j]
                if not bounds[0, j] <= points[first + k, j] <= bounds[1, j]:
                    inside = 0.0
            found[3, first + k] = inside
            mean = offset_m
            for i in range(n):
                squared = 0.0
                for j in range(d):
                    squared += (inputs[i, j] - point[j]) ** 2
                distance = np.sqrt(3.0 * squared)
                cross[k, i] = signal_m2 * (1.0 + distance) * np.exp(-distance)
                mean += weights[i] * cross[k, i]
            found[0, first + k] = mean
        explained = _explained(factor, cross[0], cross[1], cross[2])
        for k in range(together):  # rounding alone could make it negative at a training input
            found[2, first + k] = max(signal_m2 - explained[k], 1e-9)
            found[1, first + k] = found[2, first + k] + noise_m2
    return found


@_kernel
def _explained(factor: Array, a: Array, b: Array, c: Array) -> tuple[float, float, float]:
    """|factor⁻¹ a|², and those of b and c (N,), which are overwritten.

    Three at once, since reading the factor is what takes the time: together they cost as much as two alone.
    """
    of_a = of_b = of_c = 0.0
    for i in range(a.size):
        row, in_a, in_b, in_c = factor[i], 0.0, 0.0, 0.0
        for j in range(i):
            in_a += row[j] * a[j]
            in_b += row[j] * b[j]
            in_c += row[j] * c[j]
        a[i], b[i], c[i] = (a[i] - in_a) / row[i], (b[i] - in_b) / row[i], (c[i] - in_c) / row[i]
        of_a += a[i] * a[i]
        of_b += b[i] * b[i]
        of_c += c[i] * c[i]
    return of_a, of_b, of_c


@_kernel
def most_probable(points: Array, shares: Array, means: Array, variances: Array) -> NDArray[np.intp]:
    """The component (M,) of a Gaussian mixture with the highest posterior at points (M, D).

    ``shares`` (K,); ``means``, ``variances`` (K, D).
    """
    chosen = np.zeros(points.shape[0], dtype=np.intp)
    for m in range(points.shape[0]):
        best = -np.inf
        for k in range(shares.size):
            density = np.log(shares[k])
            for j in range(points.shape[1]):
                off = points[m, j] - means[k, j]
                density -= 0.5 * (np.log(variances[k, j]) + off * off / variances[k, j])
            if density > best:
                best, chosen[m] = density, k
    return chosen
