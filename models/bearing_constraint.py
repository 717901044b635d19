"""Beyond the paper: constraints of states that have a heading of their own, [x, y, vx, vy, ψ, …].

Angles are in rad, counter-clockwise; headings from East, bearings from the body's x axis (left positive).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scpf.models.constraints import half_normal_log_survival
from scpf.models.geodesy import wrap_angle
from scpf.models.slack import rayleigh_log_survival

Array = NDArray[np.float64]


def bearing_off(position_m: Array, bearing_rad: float, states: Array, heading_rad: Array | float) -> Array:
    """Angle (rad, N), 0 … π, between where states of that heading see a landmark, and where it was seen."""
    east, north = (position_m - states[:, :2]).T
    off: Array = np.abs(wrap_angle(np.arctan2(north, east) - heading_rad - bearing_rad))
    return off


@dataclass(frozen=True, eq=False)
class BearingConstraint:
    """See a landmark where it was seen: C = |direction to p_l − ψ − β| (rad, wrapped); half-normal slack."""

    landmark_id: str
    position_m: Array
    bearing_rad: float
    deviation_rad: float

    @property
    def name(self) -> str:
        """``landmark bearing ID``."""
        return f"landmark bearing {self.landmark_id}"

    def violation(self, states: Array) -> Array:
        """Angle (rad) between the expected and the observed bearing, 0 … π."""
        return bearing_off(self.position_m, self.bearing_rad, states, states[:, 4])

    def log_probability(self, states: Array) -> Array:
        """log Pr(γ ≥ C), γ half-normal with ``deviation_rad``."""
        return half_normal_log_survival(self.violation(states), self.deviation_rad)


@dataclass(frozen=True, eq=False)
class RoadBearingConstraint:
    """The same for states without a heading: ``heading_rad`` is given, the road's direction at the vehicle.

    ``deviation_rad`` has to cover how far the vehicle turns away from the road.
    """

    landmark_id: str
    position_m: Array
    bearing_rad: float
    heading_rad: float
    deviation_rad: float

    @property
    def name(self) -> str:
        """``landmark bearing ID``."""
        return f"landmark bearing {self.landmark_id}"

    def violation(self, states: Array) -> Array:
        """Angle (rad) between the expected and the observed bearing, 0 … π."""
        return bearing_off(self.position_m, self.bearing_rad, states, self.heading_rad)

    def log_probability(self, states: Array) -> Array:
        """log Pr(γ ≥ C), γ half-normal with ``deviation_rad``."""
        return half_normal_log_survival(self.violation(states), self.deviation_rad)


@dataclass(frozen=True)
class HeadingConstraint:
    """Point along the road: C = |ψ − road's direction| (rad, wrapped); Rayleigh slack.

    Broad: it keeps a heading that no landmark corrects from drifting, and says little about the lane.
    """

    direction_rad: float
    deviation_rad: float = float(np.radians(15.0))
    name: str = "heading"

    def violation(self, states: Array) -> Array:
        """Angle (rad) off the road's direction, 0 … π."""
        off: Array = np.abs(wrap_angle(states[:, 4] - self.direction_rad))
        return off

    def log_probability(self, states: Array) -> Array:
        """log Pr(γ ≥ C), γ Rayleigh with ``deviation_rad``."""
        return rayleigh_log_survival(self.violation(states), self.deviation_rad)
