"""The soft constraints as terms of the compiled filter: one small object and one kernel each.

A new constraint is a kernel, as in ``weight_kernels.py``, and a class of three lines here. Each class names the numpy
constraint whose log-probability it adds; a test holds them together. They are named tuples since one is built for
every detection of every frame: a frozen dataclass takes four times as long.

``marks`` (L, 3) are the landmarks: x and y (m), and the variance of each (m²), which widens what they say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scpf.models import weight_kernels as kernels
from scpf.models.compiled import Array32
from scpf.models.filter_kernels import move_constant_turn_rate, move_constant_velocity
from scpf.models.matched_kernels import add_matched
from scpf.models.matched_landmarks import Sighting, rows_of
from scpf.models.motion import ConstantTurnRate, ConstantVelocity, root_2x2
from scpf.models.road_map import RoadSegment

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Fix(NamedTuple):
    """``PositionFix``: a fix (R, 2) a run."""

    positions_m: Array
    variance_m2: float

    def add_to(self, log_weights: Array32, states: Array32) -> None:
        """Add log p(z | x)."""
        kernels.add_fix(log_weights, states, self.positions_m, 1.0 / self.variance_m2)


class Road(NamedTuple):
    """``RoadConstraint``: ``cubics`` (S, 7) of ``road_cubics``, ``which`` (R,) is each run's."""

    cubics: Array
    which: Indices
    half_width_m: float = 4.0
    slack_mean_m: float = 0.25

    def add_to(self, log_weights: Array32, states: Array32) -> None:
        """Add log Pr(γ ≥ C)."""
        kernels.add_road(
            log_weights,
            states,
            self.cubics,
            self.which,
            self.half_width_m,
            1.0 / self.slack_mean_m,
        )


class Speed(NamedTuple):
    """``SpeedConstraint``."""

    limit_mps: float = 12.0
    slack_mean_mps: float = 1.0

    def add_to(self, log_weights: Array32, states: Array32) -> None:
        """Add log Pr(γ ≥ C)."""
        kernels.add_speed(log_weights, states, self.limit_mps, 1.0 / self.slack_mean_mps)


class Range(NamedTuple):
    """``LandmarkConstraint``: ``which`` (R,) of the ``marks`` it is in each run, −1 for none.

    ``exponent`` tempers it, in all runs or (R,) in each.
    """

    marks: Array32
    which: Indices
    distance_m: float
    deviation_m: float
    exponent: float | Array = 1.0

    def add_to(self, log_weights: Array32, states: Array32) -> None:
        """Add the tempered log Pr(γ ≥ C)."""
        place, power = (self.marks, self.which), _per_run(self.exponent, states)
        kernels.add_range(log_weights, states, *place, self.distance_m, self.deviation_m, power)


class Bearing(NamedTuple):
    """``BearingConstraint`` of a landmark seen ``distance_m`` away; the rest as in ``Range``."""

    marks: Array32
    which: Indices
    distance_m: float
    bearing_rad: float
    deviation_rad: float
    exponent: float | Array = 1.0

    def add_to(self, log_weights: Array32, states: Array32) -> None:
        """Add the tempered log Pr(γ ≥ C)."""
        place, power = (self.marks, self.which, self.distance_m), _per_run(self.exponent, states)
        kernels.add_bearing(log_weights, states, *place, self.bearing_rad, self.deviation_rad, power)


class Heading(NamedTuple):
    """``HeadingConstraint``: the road's direction (R,) at each run."""

    direction_rad: Array
    deviation_rad: float

    def add_to(self, log_weights: Array32, states: Array32) -> None:
        """Add log Pr(γ ≥ C)."""
        kernels.add_heading(log_weights, states[4], self.direction_rad, self.deviation_rad)


class Matched(NamedTuple):
    """``MatchedLandmarks``: ``candidates`` (R, C) index the ``marks``, −1 after a run's last one."""

    marks: Array32
    candidates: Indices
    sightings: Sequence[Sighting]
    floor: float
    exponent: float | Array

    def add_to(self, log_weights: Array32, states: Array32) -> None:
        """Add the tempered log of floor and best fit of every detection."""
        rows = rows_of(self.sightings)
        if len(rows):
            scratch = np.empty((len(rows), 4, states.shape[2]), np.float32)
            power = _per_run(self.exponent, states)
            add_matched(log_weights, states, self.marks, self.candidates, rows, self.floor, power, scratch)


@dataclass(frozen=True)
class VelocityMotion:
    """``ConstantVelocity``."""

    model: ConstantVelocity

    def move(self, states: Array32, normals: Array32, dt_s: float) -> None:
        """Move in place."""
        move_constant_velocity(states, normals, dt_s, _velocity_root(self.model, dt_s))


@dataclass(frozen=True)
class TurnRateMotion:
    """``ConstantTurnRate``."""

    model: ConstantTurnRate

    def move(self, states: Array32, normals: Array32, dt_s: float) -> None:
        """Move in place."""
        along, turn = _turn_rate_roots(self.model, dt_s)
        move_constant_turn_rate(states, normals, dt_s, along, turn, *self.model.turn_response(dt_s))


def road_cubics(segments: Sequence[RoadSegment]) -> Array:
    """Segments as rows (S, 7): centre x and y, b0 … b3, 1 where swapped."""
    return np.array([[*one.centre_m, *one.coefficients, float(one.swapped)] for one in segments]).reshape(
        -1, 7
    )


# An interval and an exponent come again at every step: what follows from them is worth keeping.
@lru_cache(maxsize=64)
def _velocity_root(model: ConstantVelocity, dt_s: float) -> Array:
    return _triangle(model.covariance(dt_s))


@lru_cache(maxsize=64)
def _turn_rate_roots(model: ConstantTurnRate, dt_s: float) -> tuple[Array, Array]:
    return _triangle(model.along_covariance(dt_s)), _triangle(model.turn_covariance(dt_s))


def _triangle(covariance: Array) -> Array:
    root = root_2x2(covariance)
    return np.array([root[0, 0], root[1, 0], root[1, 1]])


def _per_run(exponent: float | Array, states: Array32) -> Array:
    """An exponent a run (R,)."""
    return exponent if isinstance(exponent, np.ndarray) else _repeated(exponent, states.shape[1])


@lru_cache(maxsize=64)
def _repeated(exponent: float, runs: int) -> Array:
    return np.full(runs, exponent)
