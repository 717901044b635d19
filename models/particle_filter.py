"""The particle filter: motion, weighting by GPS and soft constraints, resampling.

One filter serves both of the paper's: without constraints it is the PF, with them the soft-constrained PF (scPF).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from scpf.models.constraints import Constraint, log_probability
from scpf.models.motion import MotionModel
from scpf.models.pose_fix import PoseFix

Array = NDArray[np.float64]
State = Literal["initialising", "tracking", "unconstrained", "lost"]

LOST_LOG_LIKELIHOOD: Final = -50.0
"""A best particle less likely than e^−50 under everything observed: no particle is near the truth."""


@dataclass(frozen=True, eq=False)
class PositionFix:
    """A position (2,) in map from a rough GPS, with its variance a axis (m²)."""

    position_m: Array
    variance_m2: float

    def log_likelihood(self, states: Array) -> Array:
        """log p(z | x) (N,) without its constant."""
        squared = ((states[:, :2] - self.position_m) ** 2).sum(axis=1)
        log_density: Array = -0.5 * squared / self.variance_m2
        return log_density


@dataclass(frozen=True, eq=False)
class Belief:
    """Weighted particles and their summary.

    ``states`` (N, D) and ``log_weights`` (N,), normalised, are those before resampling: what a display shows.
    ``mean`` (D,) and ``covariance`` (D, D) are weighted. ``ess``: effective sample size, 1 … N.
    ``log_evidence``: log of the mean likelihood that this step's observations had.
    """

    states: Array
    log_weights: Array
    mean: Array
    covariance: Array
    ess: float
    log_evidence: float
    state: State

    @property
    def weights(self) -> Array:
        """Normalised weights (N,)."""
        weights: Array = np.exp(self.log_weights)
        return weights


@dataclass(frozen=True)
class FilterSettings:
    """Settings of a filter; the defaults are the paper's.

    ``initial_variance``: variances of the first state's [x, y, vx, vy, …] (m², m²/s², …), one a column.
    ``resample_below``: resample where ESS/N falls below it; 1 resamples at every step.
    ``recover_after``: steps in a row that are lost before the particles are drawn anew around the fix, or, without
    one, spread by ``recovery_spread_m``; 0 never recovers, as in the paper.
    """

    particles: int = 500
    initial_variance: tuple[float, ...] = (10.0, 10.0, 2.5, 2.5)
    resample_below: float = 1.0
    recover_after: int = 0
    recovery_spread_m: float = 10.0


class ParticleFilter:
    """Sequential importance resampling: ``predict``, then ``update``, as Algorithm 1 of the paper does it."""

    exponent: Final = 1.0
    """What landmarks count: they are taken at their word."""

    def __init__(self, motion: MotionModel, settings: FilterSettings, rng: np.random.Generator) -> None:
        self.motion = motion
        self.settings = settings
        self._rng = rng
        self._states = np.zeros((0, 4))
        self._log_weights = np.zeros(0)
        self._lost_steps = 0

    def initialise(self, mean: Array) -> Belief:
        """Draw the first particles around ``mean`` (D,)."""
        n = self.settings.particles
        deviation = np.sqrt(np.array(self.settings.initial_variance))
        self._states = mean + self._rng.standard_normal((n, len(mean))) * deviation
        self._log_weights = np.full(n, -np.log(n))
        self._lost_steps = 0
        return _summary(self._states, self._log_weights, 0.0, "initialising")

    def predict(self, dt_s: float) -> Array:
        """Move the particles on by ``dt_s``; returns the predicted mean (D,)."""
        self._states = self.motion.propagate(self._states, dt_s, self._rng)
        predicted: Array = np.exp(self._log_weights) @ self._states
        return predicted

    def update(self, constraints: Sequence[Constraint], fix: PositionFix | PoseFix | None = None) -> Belief:
        """Weight the particles by the fix and the constraints, summarise, resample."""
        log_likelihood = log_probability(constraints, self._states)
        if fix is not None:
            log_likelihood = log_likelihood + fix.log_likelihood(self._states)
        lost = bool(log_likelihood.max(initial=-np.inf) < LOST_LOG_LIKELIHOOD)
        joint = self._log_weights + log_likelihood
        log_evidence = float(np.logaddexp.reduce(joint))
        self._log_weights = joint - log_evidence
        landmarks = any(constraint.name.startswith("landmark") for constraint in constraints)
        state: State = "lost" if lost else "tracking" if landmarks else "unconstrained"
        belief = _summary(self._states, self._log_weights, log_evidence, state)
        if belief.ess <= self.settings.resample_below * self.settings.particles:
            self._resample()
        self._lost_steps = self._lost_steps + 1 if lost else 0
        if 0 < self.settings.recover_after <= self._lost_steps:
            self._recover(fix)
        return belief

    def _recover(self, fix: PositionFix | PoseFix | None) -> None:
        """Spread the particles, so that some come near the truth again; one outlier alone must not do this.

        The next steps' weights decide: the belief that was lost keeps its state, the following say what came of it.
        """
        n = len(self._states)
        spread_m = self.settings.recovery_spread_m if fix is None else float(np.sqrt(fix.variance_m2))
        states = self._states.copy()
        centre_m = states[:, :2] if fix is None else fix.position_m
        states[:, :2] = centre_m + spread_m * self._rng.standard_normal((n, 2))
        deviation = np.sqrt(np.array(self.settings.initial_variance[2:4]))
        states[:, 2:4] += deviation * self._rng.standard_normal((n, 2))
        self._states = states
        self._log_weights = np.full(n, -np.log(n))
        self._lost_steps = 0

    def _resample(self) -> None:
        n = len(self._log_weights)
        chosen = systematic_resample(np.exp(self._log_weights), self._rng.random())
        self._states = self._states[chosen]
        self._log_weights = np.full(n, -np.log(n))


def systematic_resample(weights: Array, offset: float) -> NDArray[np.intp]:
    """Indices (N,) drawn by systematic resampling; ``offset`` in [0, 1) is its one random number."""
    n = len(weights)
    cumulative = np.cumsum(weights)
    pointers = (np.arange(n) + offset) / n * cumulative[-1]
    chosen: NDArray[np.intp] = np.minimum(np.searchsorted(cumulative, pointers, side="right"), n - 1)
    return chosen


def _summary(states: Array, log_weights: Array, log_evidence: float, state: State) -> Belief:
    weights = np.exp(log_weights)
    mean = weights @ states
    off = states - mean
    covariance = (weights[:, None] * off).T @ off
    ess = float(1.0 / (weights**2).sum())
    return Belief(states, log_weights, mean, covariance, ess, log_evidence, state)
