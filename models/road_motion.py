"""Road-aligned motion: a vehicle makes progress along the centre line and wanders across it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.centre_line import CentreLine
from scpf.models.motion import ConstantVelocity, decaying_noise, decaying_response, root_2x2

Array = NDArray[np.float64]

SLOW_MPS: Final = 1.0
"""Below this speed a sideways velocity does not turn the heading further off the road's direction."""


@dataclass(frozen=True, eq=False)
class RoadMotion:
    """Nearly constant speed along the road, a sideways velocity that decays; states [x, y, vx, vy, ψ, s, d].

    Position (x, y) and velocity are what counts, so that whatever reads or moves those of other models works here
    too; progress s along ``line`` and offset d to its left (m) follow from them, and heading ψ (rad, not wrapped)
    from the road's direction and the velocity. s also says where on the line to look: a road may pass itself. A
    vehicle may drive against the line: ψ tells.

    White acceleration of density ``q_along_m2ps3`` along the path; the sideways velocity decays with
    ``across_time_s`` under white noise of density ``q_across_m2ps3``. Both noises are discretised exactly; beside
    a bend, the path is longer or shorter than the progress by the curvature in the middle of the step.
    """

    line: CentreLine
    q_along_m2ps3: float = 1.0
    q_across_m2ps3: float = 0.05
    across_time_s: float = 2.0

    def along_covariance(self, dt_s: float) -> Array:
        """Covariance (2, 2) of the noise of (path length, speed) over ``dt_s``."""
        return ConstantVelocity(self.q_along_m2ps3).covariance(dt_s)

    def across_covariance(self, dt_s: float) -> Array:
        """Covariance (2, 2) of the noise of (offset, sideways velocity) over ``dt_s``."""
        return self.q_across_m2ps3 * decaying_noise(self.across_time_s, dt_s)

    def propagate(self, states: Array, dt_s: float, rng: np.random.Generator) -> Array:
        """The states (N, 7) ``dt_s`` later."""
        if dt_s <= 0.0:
            return states.copy()
        draws = rng.standard_normal((2, 2, len(states)))
        length_noise, speed_noise = root_2x2(self.along_covariance(dt_s)) @ draws[0]
        offset_noise, sideways_noise = root_2x2(self.across_covariance(dt_s)) @ draws[1]
        decay, lever_s = decaying_response(self.across_time_s, dt_s)

        progress, offset, place = self.line.project(states[:, :2], states[:, 5])
        speed = (states[:, 2:4] * place.ahead).sum(1)
        sideways = (states[:, 2:4] * place.left).sum(1)
        moved_offset = offset + lever_s * sideways + offset_noise
        length = dt_s * speed + length_noise
        half_way = self.line.at(progress + 0.5 * length / place.stretch(offset))
        moved_progress = progress + length / half_way.stretch(0.5 * (offset + moved_offset))
        speed, sideways = speed + speed_noise, decay * sideways + sideways_noise

        there = self.line.at(moved_progress)
        # The road turns the heading by its own bend alone: which sense the vehicle drives in does not change.
        road_rad = self.line.heading_near(states[:, 4], place) - place.direction_rad + there.direction_rad
        moved = np.empty_like(states)
        moved[:, :2] = there.points_m + moved_offset[:, None] * there.left
        moved[:, 2:4] = speed[:, None] * there.ahead + sideways[:, None] * there.left
        moved[:, 4] = road_rad + np.arctan2(np.sign(speed) * sideways, np.maximum(np.abs(speed), SLOW_MPS))
        moved[:, 5], moved[:, 6] = moved_progress, moved_offset
        return moved

    def state(self, position_m: Array, velocity_mps: Array) -> Array:
        """The state (7,) at a position (2,) of the ``map`` frame with a velocity (2,; m/s).

        A vehicle that stands faces along the line.
        """
        progress, offset, place = self.line.project(
            position_m[None], np.array([self.line.nearest(position_m)])
        )
        along = velocity_mps @ place.ahead[0]
        road_rad = place.direction_rad[0] + (np.pi if along < 0.0 else 0.0)
        return np.concatenate([position_m, velocity_mps, [road_rad, progress[0], offset[0]]])
