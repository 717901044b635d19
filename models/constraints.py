"""Soft constraints: C(x) ≤ γ with a random slack γ ≥ 0.

A constraint adds log Pr(γ ≥ C(x)), the slack's survival function, to a particle's log-weight. Anything with
``violation(states)`` and ``log_probability(states)`` is one. States (N, D) begin [x, y, vx, vy]: ``map``
metres and metres a second. Equation numbers are those of Barbosa, Bhatt, Khajepour and Hashemi.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from scpf.models.road_map import RoadSegment

Array = NDArray[np.float64]

SQRT2: Final = float(np.sqrt(2.0))


class Constraint(Protocol):
    """A soft constraint on states (N, D)."""

    @property
    def name(self) -> str:
        """What displays and results call it."""
        ...

    def violation(self, states: Array) -> Array:
        """C(x) (N,), in the constraint's own unit; negative where there is room to spare."""
        ...

    def log_probability(self, states: Array) -> Array:
        """log Pr(γ ≥ C(x)) (N,), 0 where C(x) ≤ 0."""
        ...


def exponential_log_survival(violation: Array, mean: float) -> Array:
    """log Pr(γ ≥ C) of an exponential slack, eq. (6): −C/μ for C > 0, else 0."""
    log_survival: Array = -np.maximum(violation, 0.0) / mean
    return log_survival


def half_normal_log_survival(violation: Array, deviation: float) -> Array:
    """log Pr(γ ≥ C) of a half-normal slack, eq. (7): log erfc(C/(√2 σ)) for C > 0, else 0.

    Written as log(erfcx(u)) − u², which neither underflows nor loses digits far out in the tail.
    """
    from scipy.special import erfcx

    u = np.maximum(violation, 0.0) / (SQRT2 * deviation)
    log_survival: Array = np.log(erfcx(u)) - u * u
    return log_survival


@dataclass(frozen=True, eq=False)
class RoadConstraint:
    """Keep to the road: C = |offset from the centre line's cubic| − half width (m); exponential slack."""

    segment: RoadSegment
    half_width_m: float = 4.0
    slack_mean_m: float = 0.25
    name: str = "road"

    def violation(self, states: Array) -> Array:
        """Distance beyond the road's edge (m)."""
        beyond: Array = np.abs(self.segment.offset_m(states[:, :2])) - self.half_width_m
        return beyond

    def log_probability(self, states: Array) -> Array:
        """log Pr(γ ≥ C), γ exponential with ``slack_mean_m``."""
        return exponential_log_survival(self.violation(states), self.slack_mean_m)


@dataclass(frozen=True)
class SpeedConstraint:
    """Keep to the speed limit: C = √(vx² + vy²) − limit (m/s); exponential slack."""

    limit_mps: float = 12.0
    slack_mean_mps: float = 1.0
    name: str = "speed"

    def violation(self, states: Array) -> Array:
        """Speed above the limit (m/s)."""
        above: Array = np.hypot(states[:, 2], states[:, 3]) - self.limit_mps
        return above

    def log_probability(self, states: Array) -> Array:
        """log Pr(γ ≥ C), γ exponential with ``slack_mean_mps``."""
        return exponential_log_survival(self.violation(states), self.slack_mean_mps)


@dataclass(frozen=True, eq=False)
class LandmarkConstraint:
    """Stay at the predicted distance from a landmark: C = | ‖p − p_l‖ − μ* | (m); half-normal slack.

    ``variance_m2`` is the distance's predictive variance plus the landmark's own position variance.
    """

    landmark_id: str
    position_m: Array
    distance_m: float
    variance_m2: float

    @property
    def name(self) -> str:
        """``landmark ID``."""
        return f"landmark {self.landmark_id}"

    def violation(self, states: Array) -> Array:
        """Distance from the circle of radius ``distance_m`` about the landmark (m)."""
        east, north = (states[:, :2] - self.position_m).T
        off: Array = np.abs(np.hypot(east, north) - self.distance_m)
        return off

    def log_probability(self, states: Array) -> Array:
        """log Pr(γ ≥ C), γ half-normal with ``variance_m2``."""
        return half_normal_log_survival(self.violation(states), float(np.sqrt(self.variance_m2)))


def log_probability(constraints: Sequence[Constraint], states: Array) -> Array:
    """Joint log-probability (N,) of independent constraints."""
    total = np.zeros(len(states))
    for constraint in constraints:
        total += constraint.log_probability(states)
    return total


def total_violation(constraints: Sequence[Constraint], states: Array) -> Array:
    """The paper's constraint surface: Σ max(C, 0) (N,).

    Positive parts only: room to spare in one constraint does not pay for the violation of another.
    """
    total = np.zeros(len(states))
    for constraint in constraints:
        total += np.maximum(constraint.violation(states), 0.0)
    return total
