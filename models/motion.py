"""Motion models: how a state moves on in an interval, noise included."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class MotionModel(Protocol):
    """Anything that moves states (N, D) on by ``dt_s`` seconds."""

    def propagate(self, states: Array, dt_s: float, rng: np.random.Generator) -> Array:
        """The states (N, D) ``dt_s`` later, each with its own draw of the process noise."""
        ...


@dataclass(frozen=True)
class ConstantVelocity:
    """Nearly constant velocity in the plane, states [x, y, vx, vy].

    White acceleration of spectral density ``q_m2ps3`` a axis, discretised exactly: a step's noise has the
    covariance q·[T³/3 T²/2; T²/2 T] of (position, velocity).
    """

    q_m2ps3: float

    def covariance(self, dt_s: float) -> Array:
        """Covariance (2, 2) of an axis' (position, velocity) noise over ``dt_s``."""
        t = dt_s
        return self.q_m2ps3 * np.array([[t**3 / 3, t**2 / 2], [t**2 / 2, t]])

    def propagate(self, states: Array, dt_s: float, rng: np.random.Generator) -> Array:
        """The states (N, 4) ``dt_s`` later."""
        moved = states.copy()
        moved[:, :2] += dt_s * states[:, 2:4]
        if dt_s > 0.0 and self.q_m2ps3 > 0.0:
            # The Cholesky factor of T³/3, T²/2, T in closed form: it exists for every T, however small.
            root = np.sqrt(self.q_m2ps3 * dt_s)
            first, second = rng.standard_normal((2, len(states), 2))
            moved[:, :2] += root * dt_s / np.sqrt(3.0) * first
            moved[:, 2:4] += root * (np.sqrt(3.0) / 2.0 * first + 0.5 * second)
        return moved
