"""The simulated world: everything that stands along a stretch of road, made from one seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scpf.models.errors import InputError
from scpf.sample_logs.centre_line import CentreLine
from scpf.sample_logs.ground import add_ground
from scpf.sample_logs.lamp_placement import LightPole
from scpf.sample_logs.pole_looks import RING_ROAD_LOOK, PoleLook
from scpf.sample_logs.scene import Scene, SceneBuilder
from scpf.sample_logs.street_furniture import pedestrian
from scpf.sample_logs.textures import Textures, make_textures
from scpf.sample_logs.vehicles import COLOURS, Vehicle, vehicle
from scpf.sample_logs.world_buildings import add_buildings
from scpf.sample_logs.world_furniture import add_furniture, add_light_poles
from scpf.sample_logs.world_plants import add_plants
from scpf.sample_logs.world_site import Site

BEHIND_M, AHEAD_M = 120.0, 260.0
"""Built before the start of the route and beyond its end, so that its pictures show no end of the world."""
PEDESTRIANS = 4


@dataclass(frozen=True)
class World:
    """The scene, its textures, the landmarks, and the prototypes of what moves."""

    centre_line: CentreLine
    scene: Scene
    textures: Textures
    poles: tuple[LightPole, ...]
    """All poles of the centre line; those beyond the built stretch are not in the scene."""
    car_prototypes: tuple[int, ...]
    """In the order of Vehicle."""
    car_colours: tuple[tuple[float, float, float], ...]
    pedestrian_prototypes: tuple[int, ...]


def build_world(
    centre_line: CentreLine,
    poles: Sequence[LightPole],
    *,
    seed: int,
    route_m: tuple[float, float],
    season: float = 0.0,
    look: PoleLook = RING_ROAD_LOOK,
) -> World:
    """Build the stretch route_m (start, stop) of the centre line, metres along it; stop may pass the end
    of a closed one.

    ``season`` is the share of broad-leaved trees in autumn colours, ``look`` the make of the poles. Raises
    InputError for an empty route.
    """
    start_m, stop_m = _stretch(centre_line, route_m)
    standing = [pole for pole in poles if _is_within(centre_line, pole.s_m, start_m, stop_m)]
    scene = SceneBuilder()
    site = Site(scene, centre_line, standing, start_m, stop_m, np.random.default_rng([seed, 3]))
    add_ground(scene, centre_line, start_m, stop_m)
    add_light_poles(site, look)
    cars = tuple(scene.add_prototype(vehicle(kind)) for kind in Vehicle)
    walkers = tuple(scene.add_prototype(pedestrian(site.rng)) for _ in range(PEDESTRIANS))
    add_buildings(site, cars)
    add_furniture(site)
    add_plants(site, season)
    return World(centre_line, scene.build(), make_textures(seed), tuple(poles), cars, COLOURS, walkers)


def _stretch(centre_line: CentreLine, route_m: tuple[float, float]) -> tuple[float, float]:
    start_m, stop_m = route_m
    if not start_m < stop_m:
        raise InputError(f"the route from {start_m} m to {stop_m} m is empty", "give a stop after the start")
    start_m, stop_m = start_m - BEHIND_M, stop_m + AHEAD_M
    if centre_line.closed:
        return start_m, min(stop_m, start_m + centre_line.length_m)
    return max(start_m, 0.0), min(stop_m, centre_line.length_m)


def _is_within(centre_line: CentreLine, s_m: float, start_m: float, stop_m: float) -> bool:
    along_m = s_m - start_m
    if centre_line.closed:
        along_m %= centre_line.length_m
    return 0.0 <= along_m <= stop_m - start_m
