"""Other slacks for a soft constraint, and tempering.

The paper's exponential and half-normal slacks are in ``constraints.py``. Each function here is a log survival
function log Pr(γ ≥ C) of a slack scaled by ``scale``, in the constraint's unit; 0 where C ≤ 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scpf.models.constraints import Constraint

Array = NDArray[np.float64]
LogSurvival = Callable[[Array, float], Array]


def rayleigh_log_survival(violation: Array, scale: float) -> Array:
    """Rayleigh slack: −C²/(2 scale²), the shape of a Gaussian density."""
    log_survival: Array = -0.5 * (np.maximum(violation, 0.0) / scale) ** 2
    return log_survival


def half_student_t_log_survival(violation: Array, scale: float, degrees_of_freedom: float = 4.0) -> Array:
    """The absolute value of a Student-t variable: heavy tails, so that one false detection costs little."""
    from scipy.special import betainc, betaln

    nu = degrees_of_freedom
    squared = (np.maximum(violation, 0.0) / scale) ** 2
    share = nu / (nu + squared)
    # The incomplete beta function underflows far out; its leading term there is share^(ν/2) / (ν/2 B(ν/2, 1/2)).
    exact = betainc(nu / 2, 0.5, share)
    far = nu / 2 * np.log(share) - np.log(nu / 2) - betaln(nu / 2, 0.5)
    log_survival: Array = np.where(exact > 1e-200, np.log(np.maximum(exact, 1e-300)), far)
    return log_survival


@dataclass(frozen=True, eq=False)
class Slackened:
    """A constraint with another slack: its violation, ``log_survival`` with ``scale`` in the violation's unit."""

    constraint: Constraint
    scale: float
    log_survival: LogSurvival = half_student_t_log_survival

    @property
    def name(self) -> str:
        """The constraint's own name."""
        return self.constraint.name

    def violation(self, states: Array) -> Array:
        """C(x) (N,) of the constraint."""
        return self.constraint.violation(states)

    def log_probability(self, states: Array) -> Array:
        """log Pr(γ ≥ C) (N,) of the other slack."""
        return self.log_survival(self.constraint.violation(states), self.scale)


@dataclass(frozen=True, eq=False)
class Tempered:
    """A constraint that counts ``exponent`` times: below 1 where its errors last from frame to frame.

    Errors correlated over n frames say the same thing n times; an exponent of about 1/n counts them once.
    """

    constraint: Constraint
    exponent: float

    @property
    def name(self) -> str:
        """The constraint's own name."""
        return self.constraint.name

    def violation(self, states: Array) -> Array:
        """C(x) (N,) of the constraint."""
        return self.constraint.violation(states)

    def log_probability(self, states: Array) -> Array:
        """The constraint's log-probability (N,) times the exponent."""
        return self.exponent * self.constraint.log_probability(states)
