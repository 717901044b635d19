"""The particle filter, compiled and batched: many Monte Carlo runs step by step in one array.

The same algorithm as ``particle_filter.py`` in float32: states (D, R, N) of R runs with N particles each. A term
is a small object that adds a constraint's log-probability through one compiled kernel; a motion is one that moves
the particles. A run's numbers depend on its own seed alone, not on the batch that it runs in.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from scpf.models.compiled import Array32
from scpf.models.filter_kernels import conclude, fill_normals

Array = NDArray[np.float64]
INITIAL_STEP = 0xABCD1234


class Term(Protocol):
    """Anything that adds log-probabilities to ``log_weights`` (R, N) of ``states`` (D, R, N)."""

    def add_to(self, log_weights: Array32, states: Array32) -> None:
        """Add in place."""
        ...


class Motion(Protocol):
    """Anything that moves ``states`` (D, R, N) on by ``dt_s``, with normal numbers (4, R, N)."""

    def move(self, states: Array32, normals: Array32, dt_s: float) -> None:
        """Move in place."""
        ...


class BatchBelief(NamedTuple):
    """What R filters believe: ``mean`` (R, D), position ``covariance`` (R, 3: xx, xy, yy), ``ess`` (R,).

    ``peak`` (R,) is the largest log-likelihood of a particle since the last resampling.
    """

    mean: Array
    covariance: Array
    ess: Array
    peak: Array


class BatchFilter:
    """R independent filters in lock-step, resampled at every step or where ESS/N falls below a share."""

    def __init__(
        self, motion: Motion, seeds: Sequence[int], particles: int = 500, resample_below: float = 1.0
    ) -> None:
        self.motion = motion
        self.particles = particles
        self.resample_below = resample_below
        words = [np.random.SeedSequence(seed).generate_state(1, np.uint32)[0] for seed in seeds]
        self._keys = np.array(words, dtype=np.uint32)
        runs = len(words)
        self._normals = np.empty((4, runs, particles), np.float32)
        self._log_weights = np.zeros((runs, particles), np.float32)
        self._weights = np.zeros((runs, particles), np.float32)
        self._chosen = np.zeros(particles + 1, np.int64)
        self.states: Array32 = np.zeros((0, runs, particles), np.float32)
        self._spare = self.states
        self._step = 0

    def initialise(self, means: Array, deviations: Array) -> None:
        """Draw the first particles around ``means`` (R, D) with ``deviations`` (D,)."""
        runs, size = means.shape
        self.states = np.empty((size, runs, self.particles), np.float32)
        self._spare = np.empty_like(self.states)
        for first in range(0, size, 4):
            fill_normals(self._normals, self._keys, np.uint32(INITIAL_STEP + first))
            for d in range(first, min(first + 4, size)):
                self.states[d] = means[:, d, None] + deviations[d] * self._normals[d - first]
        self._log_weights[:] = 0.0
        self._step = 0

    def predict(self, dt_s: float) -> None:
        """Move every run's particles on by ``dt_s``."""
        self._step += 1
        fill_normals(self._normals, self._keys, np.uint32(self._step))
        self.motion.move(self.states, self._normals, dt_s)

    def update(self, terms: Sequence[Term]) -> BatchBelief:
        """Weigh the particles by the terms, summarise, resample."""
        size, runs, _ = self.states.shape
        for term in terms:
            term.add_to(self._log_weights, self.states)
        mean, covariance = np.empty((runs, size)), np.empty((runs, 3))
        ess, peak = np.empty(runs), np.empty(runs)
        random = (self._chosen, self._keys, np.uint32(self._step))
        arrays = (self._log_weights, self._weights, self.states, self._spare)
        if conclude(*arrays, *random, self.resample_below, mean, covariance, ess, peak):
            self.states, self._spare = self._spare, self.states
        return BatchBelief(mean, covariance, ess, peak)
