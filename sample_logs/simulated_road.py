"""The road of a simulated drive: its centre line, its poles, and the two maps of it, as surveyed and as it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError
from scpf.models.geodesy import Origin
from scpf.models.road_map import Landmark, RoadMap
from scpf.sample_logs.centre_line import CentreLine
from scpf.sample_logs.lamp_placement import LightPole, place_poles, poles_of_a_map
from scpf.sample_logs.pole_looks import RING_ROAD_LOOK, PoleLook
from scpf.sample_logs.ring_road import centre_line_of, default_road_map

POLE_CLASS: Final = "light_pole"
DEFAULT_POLES, DEFAULT_SPACING_M = 99, 26.6
"""Of the Ring Road; other roads whose map has no poles get some at the same spacing."""
MAPPED_STEP_M: Final = 5.0
ERROR_SPREAD: Final = 1.0 / 3.0
"""A map that is wrong by 1.5 m on average is wrong by 1 to 2 m, as the paper's."""
LARGEST_ERROR_M: Final = 20.0


@dataclass(frozen=True, eq=False)
class SimulatedRoad:
    """Centre line and poles in ``map`` at ``origin``; ``names`` are the poles' ids in map and truth, by number."""

    centre_line: CentreLine
    poles: tuple[LightPole, ...]
    names: dict[int, str]
    origin: Origin
    half_width_m: float
    attribution: str
    mapped_variance_m2: float
    """Of a mapped position, each axis."""

    def mapped(self) -> RoadMap:
        """The road as the map has it: each pole beside where it stands, with the variance of that."""
        places = [[*pole.mapped_position_m, pole.position_m[2]] for pole in self.poles]
        return self._with_poles_at(places, self.mapped_variance_m2)

    def true(self) -> RoadMap:
        """The road as it is."""
        return self._with_poles_at([pole.position_m for pole in self.poles], 0.0)

    def lamps_m(self, look: PoleLook = RING_ROAD_LOOK) -> NDArray[np.float64]:
        """Where the poles' lamps are (N, 3)."""
        s_m, offset_m = np.array([(pole.s_m, pole.offset_m) for pole in self.poles]).reshape(-1, 2).T
        lamps_m, _, _ = self.centre_line.at(s_m, offset_m - np.copysign(look.lamp_inwards_m, offset_m))
        lamps_m[:, 2] = look.lamp_height_m
        return lamps_m

    def _with_poles_at(
        self, places_m: Sequence[Sequence[float] | NDArray[np.float64]], variance_m2: float
    ) -> RoadMap:
        landmarks = []
        for pole, place in zip(self.poles, places_m, strict=True):
            east, north, up = (float(value) for value in place)
            landmarks.append(Landmark(self.names[pole.id], (east, north, up), POLE_CLASS, variance_m2))
        steps = max(round(self.centre_line.length_m / MAPPED_STEP_M), 4)
        along_m = np.linspace(0.0, self.centre_line.length_m, steps + 1)
        line_m = self.centre_line.at(along_m)[0][:, :2]
        return RoadMap(tuple(landmarks), line_m, self.half_width_m, self.origin, self.attribution)


def simulated_road(road_map: RoadMap | None, *, seed: int, map_error_m: float = 1.5) -> SimulatedRoad:
    """The road of a map, or the Ring Road with 99 poles where ``road_map`` is None.

    A map's light poles are those of the simulation; one that has none gets some. ``map_error_m``: the mean distance
    of a pole from its mapped position, a third more or less; 0 for an exact map. A map in metres is laid at the
    Ring Road's origin, as a simulated INS has to say degrees. Raises MissingError for a map without a centre line,
    InputError for one that is too short and for an impossible error.
    """
    if not 0.0 <= map_error_m <= LARGEST_ERROR_M:
        raise InputError(f"a map error of {map_error_m:g} m", f"give 0 to {LARGEST_ERROR_M:g} m")
    known = road_map if road_map is not None else default_road_map()
    line = centre_line_of(known)
    low, high = map_error_m * (1 - ERROR_SPREAD), map_error_m * (1 + ERROR_SPREAD)
    standing = [mark for mark in known.landmarks if mark.landmark_class == POLE_CLASS]
    if road_map is None or not standing:
        count = DEFAULT_POLES if road_map is None else max(round(line.length_m / DEFAULT_SPACING_M), 1)
        poles = place_poles(line, count, seed=seed, mapped_error_m=(low, high))
        names = {pole.id: f"P{pole.id}" for pole in poles}
    else:
        mapped_m = [mark.position_m[:2] for mark in standing]
        poles = poles_of_a_map(line, mapped_m, seed=seed, mapped_error_m=(low, high))
        names = {pole.id: mark.id for pole, mark in zip(poles, standing, strict=True)}
    origin = known.origin or default_road_map().origin
    assert origin is not None
    # Half the mean square of a distance that is uniform from low to high.
    variance_m2 = (low * low + low * high + high * high) / 6.0
    return SimulatedRoad(line, poles, names, origin, known.half_width_m, known.attribution, variance_m2)
