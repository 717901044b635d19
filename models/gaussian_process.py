"""A Gaussian process with a Matérn 3/2 kernel: one expert for the distance of a landmark.

scikit-learn finds the hyperparameters; the prediction is ours, from the stored Cholesky factor: eqs. (1)
and (2) of the paper with K + σ_ε² I (the paper prints σ_ε).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.distance_kernels import posterior
from scpf.models.errors import InputError
from scpf.models.warp import Warp, targets

Array = NDArray[np.float64]

MIN_SAMPLES: Final = 8
"""Fewer samples do not determine a length scale a feature."""

RANGE_SLACK: Final = 0.05
"""An input may lie this share of the training span outside it and still counts as in range."""

_ROOT3: Final = float(np.sqrt(3.0))


@dataclass(frozen=True, eq=False)
class Hyperparameters:
    """``signal_m2``: variance of the function. ``length_scales`` (D,), in standard deviations of each input.

    ``noise_m2``: variance σ_ε² of the noise.
    """

    signal_m2: float
    length_scales: Array
    noise_m2: float


@dataclass(frozen=True, eq=False)
class GaussianProcess:
    """A fitted process with N training samples of D inputs.

    ``centre`` and ``scale`` (D,) standardise inputs; ``inputs`` (N, D) are standardised and divided by the
    length scales; ``offset_m`` is the mean training distance; ``factor`` (N, N) is the lower Cholesky
    factor of K + σ_ε² I, ``weights`` (N,) = (K + σ_ε² I)⁻¹ (y − offset). ``lowest`` and ``highest`` (D,)
    bound the training inputs, in their own units. With a ``warp``, y are its targets instead of distances.
    """

    hyperparameters: Hyperparameters
    centre: Array
    scale: Array
    inputs: Array
    offset_m: float
    factor: Array
    weights: Array
    lowest: Array
    highest: Array
    warp: Warp | None = None

    def predict(self, features: Array) -> tuple[Array, Array, Array]:
        """Mean (M,) in m, predictive variance and function variance (M,) in m², of inputs (M, D).

        Mean: eq. (1). Function variance: eq. (2). The predictive variance adds σ_ε²: a label, and thus a
        measured distance, has the noise too.
        """
        mean, variance, function, _ = self.answer(features)
        return mean, variance, function

    def answer(self, features: Array) -> Array:
        """What ``predict`` gives, as rows (4, M), and in the last whether an input is in range: 1, else 0.

        In range is what lies within the box of the training inputs, 5 % of its span wider.
        """
        points = np.ascontiguousarray(features, dtype=np.float64)
        found = posterior(points, *self._known)
        if self.warp is not None:
            found[0], found[1:3] = self.warp.distances(found[0], found[1:3])
        return found

    @cached_property
    def _known(self) -> tuple[Array, Array, Array, Array, Array, Array, float, float, float]:
        """What every prediction needs; units: what an input is divided by, in its own unit."""
        found, slack = self.hyperparameters, RANGE_SLACK * (self.highest - self.lowest)
        units, bounds = (
            self.scale * found.length_scales,
            np.array([self.lowest - slack, self.highest + slack]),
        )
        learnt = (self.inputs, self.factor, self.weights, bounds)
        return self.centre, units, *learnt, found.signal_m2, found.noise_m2, self.offset_m


def matern32(left: Array, right: Array) -> Array:
    """Matérn ν = 3/2 correlations (N, M) of points (N, D) and (M, D) that are in units of the length
    scales.
    """
    difference = left[:, None, :] - right[None, :, :]
    distance = _ROOT3 * np.sqrt(np.einsum("nmd,nmd->nm", difference, difference))
    correlation: Array = (1.0 + distance) * np.exp(-distance)
    return correlation


def condition(
    features: Array, distances_m: Array, hyperparameters: Hyperparameters, warp: Warp | None = None
) -> GaussianProcess:
    """The process with given hyperparameters, conditioned on features (N, D) and distances (N,).

    Raises InputError below 8 samples, or where a value is not finite.
    """
    from scipy.linalg import cho_solve, cholesky

    _check(features, distances_m)
    centre, scale = _standard(features)
    inputs = (features - centre) / (scale * hyperparameters.length_scales)
    learnt = targets(distances_m, warp)
    offset = float(learnt.mean())
    covariance = hyperparameters.signal_m2 * matern32(inputs, inputs)
    covariance[np.diag_indices(len(inputs))] += hyperparameters.noise_m2
    factor = np.ascontiguousarray(cholesky(covariance, lower=True, check_finite=False))
    weights = cho_solve((factor, True), learnt - offset, check_finite=False)
    bounds = features.min(0), features.max(0)
    return GaussianProcess(hyperparameters, centre, scale, inputs, offset, factor, weights, *bounds, warp)


def log_likelihood(process: GaussianProcess, distances_m: Array) -> float:
    """Logarithm of the marginal likelihood of the distances (N,) that ``process`` was conditioned on."""
    warp = process.warp
    fit = 0.5 * float((targets(distances_m, warp) - process.offset_m) @ process.weights)
    volume = float(np.log(np.diag(process.factor)).sum()) + 0.5 * len(distances_m) * math.log(2.0 * math.pi)
    return (0.0 if warp is None else warp.log_slope(distances_m)) - fit - volume


def optimise(
    features: Array,
    distances_m: Array,
    *,
    restarts: int = 0,
    seed: int = 0,
    start: Hyperparameters | None = None,
) -> Hyperparameters:
    """Hyperparameters of maximum marginal likelihood for features (N, D) and distances (N,) in m.

    ``restarts``: further starts, drawn with ``seed``. ``start``: where the first one begins. Raises
    InputError as ``condition`` does.
    """
    import warnings

    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel
    from threadpoolctl import threadpool_limits

    _check(features, distances_m)
    centre, scale = _standard(features)
    first = start or Hyperparameters(100.0, np.full(features.shape[1], 3.0), 0.3)
    # The noise has a floor of (3 cm)²: it keeps K + σ_ε² I well conditioned, and no map is better than that.
    # A length scale of 1000 standard deviations switches a feature off.
    kernel = ConstantKernel(first.signal_m2, (1e-1, 1e6)) * Matern(
        first.length_scales, (1e-2, 1e3), nu=1.5
    ) + WhiteKernel(first.noise_m2, (1e-3, 1e2))
    regressor = GaussianProcessRegressor(
        kernel, alpha=1e-10, n_restarts_optimizer=restarts, random_state=seed
    )
    # Matrices of a few hundred rows: several BLAS threads wait for each other longer than they compute.
    with threadpool_limits(1, "blas"), warnings.catch_warnings():
        # "close to the bound" is what an unused feature looks like, and no fault.
        warnings.simplefilter("ignore", ConvergenceWarning)
        regressor.fit((features - centre) / scale, distances_m - distances_m.mean())
    product, white = regressor.kernel_.k1, regressor.kernel_.k2
    lengths = np.atleast_1d(np.asarray(product.k2.length_scale, dtype=np.float64))
    return Hyperparameters(float(product.k1.constant_value), lengths, float(white.noise_level))


def _standard(features: Array) -> tuple[Array, Array]:
    """Mean and standard deviation (D,) of features (N, D); a constant feature keeps its unit."""
    deviation = features.std(axis=0)
    return features.mean(axis=0), np.where(deviation > 1e-9, deviation, 1.0)


def _check(features: Array, distances_m: Array) -> None:
    if len(features) < MIN_SAMPLES:
        raise InputError(
            f"{len(features)} samples for a Gaussian process; it needs {MIN_SAMPLES}",
            "train with more frames, or on a longer drive",
        )
    if not (np.isfinite(features).all() and np.isfinite(distances_m).all()):
        raise InputError("a training sample has a feature or a distance that is not a finite number")
