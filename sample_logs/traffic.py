"""Moving traffic: oncoming vehicles, one that drives ahead of the bus now and then, and pedestrians."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from scpf.sample_logs.ground import ground_height_m
from scpf.sample_logs.mesh import Floats
from scpf.sample_logs.scene import placement
from scpf.sample_logs.vehicles import Vehicle
from scpf.sample_logs.world import World

LANE_MIDDLE_M = 1.85
SHOWN_M = 260.0
"""Nothing further from the bus is returned."""
ONCOMING, ONCOMING_SPACING_M, ONCOMING_SPEED_M_S = 26, 58.0, 8.5
"""One speed for all, so that none drives through another."""
BEHIND_M = 400.0
LEAD_PERIOD_S, LEAD_SHARE, LEAD_RAMP_S = 90.0, 0.6, 30.0
"""In this share of the periods a vehicle is caught up with, followed and lost again."""
LEAD_FAR_M = 240.0
PEDESTRIANS_PER_KM, WALKING_M_S = 24.0, 1.3
BRAKE_LIGHT, TAIL_LIGHT, DARK = 0.9, 0.28, 0.02


class MovingObject(NamedTuple):
    """One moving object at one moment, as Scene.with_instances takes it."""

    prototype: int
    T_map_local: Floats
    """(3, 4)."""
    tint: tuple[float, float, float]
    parameters: tuple[float, ...]
    """Of vehicles: unused, unused, brightness of tail lights, of headlights."""


class _Mover(NamedTuple):
    start_m: float
    speed_m_s: float
    offset_m: float
    kind: int
    tint: tuple[float, float, float]


class Traffic:
    """The traffic of one seed on one world; the same moment always shows the same."""

    def __init__(self, seed: int, world: World, lights_on: bool = False) -> None:
        self._seed, self._world, self._lights_on = seed, world, lights_on
        rng = np.random.default_rng([seed, 5])
        kinds = [Vehicle.SEDAN] * 3 + [Vehicle.HATCHBACK] * 2 + [Vehicle.VAN, Vehicle.PICKUP, Vehicle.BUS]
        self._oncoming = [
            _Mover(
                (k + float(rng.uniform(-0.35, 0.35))) * ONCOMING_SPACING_M,
                -ONCOMING_SPEED_M_S,
                LANE_MIDDLE_M + float(np.clip(rng.normal(0, 0.12), -0.3, 0.3)),
                int(rng.choice(kinds)),
                world.car_colours[int(rng.integers(len(world.car_colours)))],
            )
            for k in range(ONCOMING)
        ]
        length_m = world.centre_line.length_m
        self._walkers = [
            _Mover(
                float(rng.uniform(0, length_m)),
                WALKING_M_S * float(rng.choice([-1, 1])) * float(rng.uniform(0.7, 1.15)),
                float(rng.choice([-1, 1])) * float(rng.uniform(5.9, 6.9)),
                int(rng.integers(len(world.pedestrian_prototypes))),
                _cloth(rng),
            )
            for _ in range(int(length_m / 1000 * PEDESTRIANS_PER_KM))
        ]

    def at(self, time_s: float, bus_s_m: float) -> list[MovingObject]:
        """All that moves within SHOWN_M of the bus at bus_s_m along the centre line, time_s after the start."""
        return [
            *self._oncoming_at(time_s, bus_s_m),
            *self._lead_at(time_s, bus_s_m),
            *self._walkers_at(time_s, bus_s_m),
        ]

    def _oncoming_at(self, time_s: float, bus_s_m: float) -> list[MovingObject]:
        round_m = ONCOMING * ONCOMING_SPACING_M
        found = []
        for car in self._oncoming:
            ahead_m = (car.start_m + car.speed_m_s * time_s - bus_s_m + BEHIND_M) % round_m - BEHIND_M
            if abs(ahead_m) < SHOWN_M and self._is_on_the_line(bus_s_m + ahead_m):
                found.append(self._car(bus_s_m + ahead_m, car.offset_m, car.kind, car.tint, False, math.pi))
        return found

    def _lead_at(self, time_s: float, bus_s_m: float) -> list[MovingObject]:
        period = math.floor(time_s / LEAD_PERIOD_S)
        rng = np.random.default_rng([self._seed, 7, period + 1_000_000])
        if rng.uniform() > LEAD_SHARE:
            return []
        nearest_m, phase = float(rng.uniform(16, 42)), float(rng.uniform(0, 2 * np.pi))
        kind = int(rng.choice([Vehicle.SEDAN, Vehicle.HATCHBACK, Vehicle.HATCHBACK, Vehicle.PICKUP]))
        tint = self._world.car_colours[int(rng.integers(len(self._world.car_colours)))]
        since_s = time_s - period * LEAD_PERIOD_S
        edge = min(since_s, LEAD_PERIOD_S - since_s) / LEAD_RAMP_S
        near = min(edge, 1.0) ** 2 * (3 - 2 * min(edge, 1.0))
        swing = 0.2 * time_s + phase
        ahead_m = nearest_m + (LEAD_FAR_M - nearest_m) * (1 - near) + 3.0 * (1 + math.sin(swing))
        if not self._is_on_the_line(bus_s_m + ahead_m):
            return []
        return [self._car(bus_s_m + ahead_m, -LANE_MIDDLE_M, kind, tint, math.cos(swing) < -0.3, 0.0)]

    def _walkers_at(self, time_s: float, bus_s_m: float) -> list[MovingObject]:
        length_m, found = self._world.centre_line.length_m, []
        for walker in self._walkers:
            s_m = (walker.start_m + walker.speed_m_s * time_s) % length_m
            ahead_m = s_m - bus_s_m
            if self._world.centre_line.closed:
                ahead_m = (ahead_m + length_m / 2) % length_m - length_m / 2
            if abs(ahead_m) < SHOWN_M:
                turn = 0.0 if walker.speed_m_s > 0 else math.pi
                prototype = self._world.pedestrian_prototypes[walker.kind]
                pose = self._pose(s_m, walker.offset_m, turn)
                found.append(MovingObject(prototype, pose, walker.tint, ()))
        return found

    def _is_on_the_line(self, s_m: float) -> bool:
        line = self._world.centre_line
        return line.closed or 0.0 <= s_m <= line.length_m

    def _car(
        self,
        s_m: float,
        offset_m: float,
        kind: int,
        tint: tuple[float, float, float],
        brakes: bool,
        turn_rad: float,
    ) -> MovingObject:
        rear = BRAKE_LIGHT if brakes else TAIL_LIGHT if self._lights_on else DARK
        front = 1.0 if self._lights_on else 0.25
        pose = self._pose(s_m, offset_m, turn_rad)
        return MovingObject(self._world.car_prototypes[kind], pose, tint, (0.0, 0.0, rear, front))

    def _pose(self, s_m: float, offset_m: float, turn_rad: float) -> Floats:
        position, tangent, _ = self._world.centre_line.at(s_m, offset_m)
        raised = np.array([position[0], position[1], position[2] + ground_height_m(offset_m)])
        return placement(raised, math.atan2(tangent[1], tangent[0]) + turn_rad)


def _cloth(rng: np.random.Generator) -> tuple[float, float, float]:
    red, green, blue = rng.uniform(0.03, 0.45, 3)
    return float(red), float(green), float(blue)
