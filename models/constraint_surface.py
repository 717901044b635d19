"""What constraints say of every place on a grid: the paper's surface, and its probabilistic twin."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scpf.models.bearing_constraint import HeadingConstraint
from scpf.models.constraints import (
    Constraint,
    LandmarkConstraint,
    RoadConstraint,
    SpeedConstraint,
    exponential_log_survival,
)
from scpf.models.matched_landmarks import MatchedLandmarks
from scpf.models.weight_kernels import half_normal_in_place

Array = NDArray[np.float64]


def surfaces(
    constraints: Sequence[Constraint], state: Array, east_m: Array, north_m: Array
) -> tuple[Array, Array]:
    """Σ max(C, 0) and Σ log Pr(γ ≥ C), each (R, C), at places ``east_m`` (C,) × ``north_m`` (R,).

    ``state`` (D,) gives velocity and heading; its position does not matter. Positive parts only: room to spare in
    one constraint does not pay for the violation of another. Log-probabilities of landmarks are in single precision.
    """
    shape = (len(north_m), len(east_m))
    states = states_over(state, east_m, north_m)
    total, joint = np.zeros(len(states)), np.zeros(len(states))
    for constraint in constraints:
        violation, log_probability = _both(constraint, states)
        total += np.maximum(violation, 0.0)
        joint += log_probability
    return total.reshape(shape), joint.reshape(shape)


def states_over(state: Array, east_m: Array, north_m: Array) -> Array:
    """``state`` (D,) at every place ``east_m`` (C,) × ``north_m`` (R,), row by row: (R · C, D)."""
    states = np.empty((len(north_m) * len(east_m), len(state)))
    states[:] = state
    states[:, 0], states[:, 1] = np.tile(east_m, len(north_m)), np.repeat(north_m, len(east_m))
    return states


def _both(constraint: Constraint, states: Array) -> tuple[Array, Array]:
    """Violation and log-probability, the shortest way for each kind."""
    if isinstance(constraint, SpeedConstraint | HeadingConstraint):
        # Every place has the same velocity and heading.
        return constraint.violation(states[:1]), constraint.log_probability(states[:1])
    if isinstance(constraint, MatchedLandmarks):
        return constraint.both(states)
    violation = constraint.violation(states)
    if isinstance(constraint, RoadConstraint):
        return violation, exponential_log_survival(violation, constraint.slack_mean_m)
    if isinstance(constraint, LandmarkConstraint):
        log_probability = violation.copy()
        half_normal_in_place(log_probability, float(np.sqrt(constraint.variance_m2)))
        return violation, log_probability
    return violation, constraint.log_probability(states)
