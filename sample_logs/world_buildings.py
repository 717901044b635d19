"""Where buildings and parking lots stand along the road."""

from __future__ import annotations

import math

import numpy as np

from scpf.sample_logs.buildings import building
from scpf.sample_logs.lamp_poles import lot_lamp
from scpf.sample_logs.mesh import Floats, rotation_z
from scpf.sample_logs.street_furniture import LOT_DEPTH_M, parking_lot
from scpf.sample_logs.vehicles import COLOURS
from scpf.sample_logs.world_site import Site

LOT_LAMP_ID = 1000
LOT_OFFSET_M, LOT_Z_M = 26.0, -0.30
STALL_M = 2.7
BUILDING_CLEARANCE_M, PARKED_CLEARANCE_M = 17.0, 9.0
"""Smallest distance from the centre line of a building's corner, and of a parked car's middle."""
BRICK, CONCRETE, PANEL = 0, 1, 2
FACADE_TINTS = ((0.28, 0.13, 0.085), (0.36, 0.34, 0.30), (0.22, 0.23, 0.25))
SANDSTONE = (0.36, 0.26, 0.17)


def add_buildings(site: Site, car_prototypes: tuple[int, ...]) -> None:
    """Line both sides with buildings, parking lots and open ground."""
    lamp = site.scene.add_prototype(lot_lamp())
    for side in (-1.0, 1.0):
        s_m = site.start_m
        while s_m < site.stop_m:
            choice, width_m = site.rng.uniform(), float(site.rng.uniform(28, 62))
            if choice < 0.60:
                _building(site, s_m + width_m / 2, side, width_m)
            elif choice < 0.80:
                _lot(site, s_m + width_m / 2, side, width_m, car_prototypes, lamp)
            s_m += width_m + float(site.rng.uniform(4, 22))


def _facing(heading_rad: float, side: float) -> float:
    """Yaw of something whose -y side looks at the road."""
    return heading_rad + (math.pi if side < 0 else 0.0)


def _building(site: Site, s_m: float, side: float, width_m: float) -> None:
    rng = site.rng
    depth_m = float(rng.uniform(16, 26))
    place, heading = site.at(s_m, side * (rng.uniform(24, 46) + depth_m / 2))
    yaw, reach = _facing(heading, side), math.hypot(width_m, depth_m) / 2
    signs = np.array([[1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]])
    corners = place + (signs * [width_m / 2, depth_m / 2, 0]) @ rotation_z(yaw).T
    if not site.is_free(place, reach * 0.8) or site.road_distance_m(corners) < BUILDING_CLEARANCE_M:
        return
    floor_m = float(rng.choice([3.4, 3.8, 4.1]))
    height_m = int(rng.integers(2, 7)) * floor_m + 0.9
    style = int(rng.integers(3))
    tint = np.array(FACADE_TINTS[style]) * rng.uniform(0.8, 1.2)
    if style == BRICK and rng.uniform() < 0.4:
        tint = np.array(SANDSTONE) * rng.uniform(0.85, 1.1)
    bay_m = rng.uniform(1.4, 2.0) if style == PANEL else rng.uniform(2.2, 4.2)
    glass_share = 0.93 if style == PANEL else rng.uniform(0.4, 0.72)
    site.scene.place(
        site.scene.add_prototype(building(rng, width_m, depth_m, height_m), cull_backfaces=True),
        place,
        yaw,
        tint=tint,
        parameters=(style, floor_m, bay_m, glass_share, height_m, rng.uniform()),
    )
    site.occupy(place, reach * 0.85)


def _lot(
    site: Site, s_m: float, side: float, width_m: float, car_prototypes: tuple[int, ...], lamp: int
) -> None:
    rng = site.rng
    edge, heading = site.at(s_m, side * LOT_OFFSET_M)
    edge[2] = LOT_Z_M
    yaw = _facing(heading, side)
    turn = rotation_z(yaw)
    middle = edge + turn @ [0, LOT_DEPTH_M / 2, 0]
    signs = np.array([[1, 0, 0], [-1, 0, 0], [1, 1, 0], [-1, 1, 0]])
    corners = edge + (signs * [width_m / 2, LOT_DEPTH_M, 0]) @ turn.T
    if not site.is_free(middle, width_m * 0.5) or site.road_distance_m(corners) < BUILDING_CLEARANCE_M:
        return
    site.scene.place(site.scene.add_prototype(parking_lot(width_m)), edge, yaw, is_ground=True)
    site.occupy(middle, width_m * 0.5)
    stalls = np.arange(-width_m / 2 + STALL_M / 2, width_m / 2 - 1, STALL_M)
    for y, looks in ((3.0, 1), (14.0, -1)):
        for x in stalls:
            if rng.uniform() < 0.68:
                park(site, car_prototypes, edge + turn @ [x, y, 0], yaw + looks * np.pi / 2)
    for x in (-width_m / 4, width_m / 4):
        site.scene.place(
            lamp,
            edge + turn @ [x, LOT_DEPTH_M / 2, 0],
            yaw + float(rng.uniform(0, 3)),
            tint=(0.06, 0.055, 0.05),
            instance_id=LOT_LAMP_ID,
        )


def park(site: Site, car_prototypes: tuple[int, ...], place: Floats, yaw_rad: float) -> None:
    """Park a car of any kind and colour, never within PARKED_CLEARANCE_M of the centre line."""
    if site.road_distance_m(place) < PARKED_CLEARANCE_M:
        return
    site.scene.place(
        car_prototypes[int(site.rng.choice([0, 0, 1, 1, 2, 3]))],
        place,
        yaw_rad + float(site.rng.normal(0, 0.02)),
        tint=COLOURS[int(site.rng.integers(len(COLOURS)))],
        parameters=(0, 0, 0.02, 0),
    )
