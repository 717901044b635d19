"""The ground plan while a world is being built: what stands where, and what is still free."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from scpf.sample_logs.centre_line import CentreLine
from scpf.sample_logs.ground import ground_height_m
from scpf.sample_logs.lamp_placement import LightPole
from scpf.sample_logs.mesh import Floats
from scpf.sample_logs.scene import SceneBuilder


@dataclass
class Site:
    """The stretch start_m to stop_m of a centre line that is being built over, in map_local."""

    scene: SceneBuilder
    centre_line: CentreLine
    poles: Sequence[LightPole]
    start_m: float
    stop_m: float
    rng: np.random.Generator
    _circles: list[tuple[float, float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        places = [pole.position_m[:2] for pole in self.poles] or [np.full(2, 1e9)]
        self._pole_places = np.array(places)

    def at(self, s_m: float, offset_m: float) -> tuple[Floats, float]:
        """The point (3,) on the ground at s_m and offset_m, and the heading of the road there, rad."""
        position, tangent, _ = self.centre_line.at(s_m, offset_m)
        raised = np.array([position[0], position[1], position[2] + ground_height_m(offset_m)])
        return raised, math.atan2(tangent[1], tangent[0])

    def grounded(self, place_m: Floats) -> Floats:
        """The point (3,) on the ground at place_m (2,)."""
        return np.array([place_m[0], place_m[1], ground_height_m(self.road_distance_m(place_m))])

    def occupy(self, place_m: Floats, radius_m: float) -> None:
        """Keep other things out of a circle about place_m."""
        self._circles.append((float(place_m[0]), float(place_m[1]), radius_m))

    def is_free(self, place_m: Floats, radius_m: float) -> bool:
        """Whether a circle about place_m touches nothing that was kept."""
        return all(
            math.hypot(place_m[0] - x, place_m[1] - y) > radius_m + radius for x, y, radius in self._circles
        )

    def road_distance_m(self, places_m: Floats) -> float:
        """Smallest distance of any of places_m ((2,) or (n, 2)) to the centre line."""
        return float(np.min(self.centre_line.distance_m(np.atleast_2d(places_m)[:, :2])))

    def pole_distance_m(self, place_m: Floats) -> float:
        """Distance of place_m to the nearest light pole."""
        return float(np.min(np.hypot(*(self._pole_places - place_m[:2]).T)))

    def random_s_m(self) -> float:
        """Somewhere along the stretch."""
        return float(self.rng.uniform(self.start_m, self.stop_m))

    def random_side(self) -> float:
        """-1 right or 1 left."""
        return float(self.rng.choice([-1.0, 1.0]))
