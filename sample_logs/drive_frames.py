"""The pictures of a simulated drive: what a rendering process builds once, and how it makes the frame of an index."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from scpf.models.camera import Camera
from scpf.models.errors import InputError, UsageError
from scpf.models.road_map import RoadMap
from scpf.sample_logs.basler import FULL_WIDTH_PX, SMALLEST_WIDTH_PX, basler_camera
from scpf.sample_logs.finished_frames import FinishedFrame, encode_jpeg, seen_poles
from scpf.sample_logs.render_jobs import Make
from scpf.sample_logs.renderer import Renderer
from scpf.sample_logs.simulated_road import SimulatedRoad, simulated_road
from scpf.sample_logs.traffic import Traffic
from scpf.sample_logs.vehicle import RATE_HZ, VehicleDrive, simulate_vehicle
from scpf.sample_logs.weather import RANDOM, WEATHERS, Weather, drawn_weather
from scpf.sample_logs.world import build_world


@dataclass(frozen=True)
class DriveSettings:
    """All that a simulated drive depends on, but for its road map. Lengths along the centre line, in metres."""

    start_m: float = 0.0
    duration_s: float = 10.0
    seed: int = 0
    world_seed: int | None = None
    """Of the road's poles, their mapped positions, and all else that stands there; None: as ``seed``."""
    weather: str = RANDOM
    width_px: int = FULL_WIDTH_PX
    quality: int = 85
    """Of the JPEG files, 1 to 100."""
    map_error_m: float = 1.5
    gps_sigma_m: float = 3.0
    stop_at_m: float | None = None
    rate_hz: float = RATE_HZ
    """Pictures a second."""

    def as_dict(self) -> dict[str, Any]:
        """Plain values. A camera of 13 Hz goes without saying: logs from before there were others stay as they are."""
        values = asdict(self)
        if self.rate_hz == RATE_HZ:
            del values["rate_hz"]
        return values


def check(settings: DriveSettings) -> None:
    """Raise UsageError where a value has no meaning, before anything is built."""
    check_pictures(settings.weather, settings.width_px, settings.quality)
    if settings.seed < 0 or (settings.world_seed or 0) < 0:
        raise UsageError("a negative seed")
    numbers = (settings.start_m, settings.duration_s, settings.map_error_m, settings.gps_sigma_m)
    if not all(math.isfinite(number) for number in numbers):
        raise UsageError("a number that is not finite")
    if not 0.1 <= settings.rate_hz <= 100.0:
        raise UsageError(f"{settings.rate_hz:g} pictures a second", "0.1 to 100")
    if not settings.gps_sigma_m > 0.0:
        raise InputError(
            f"a GPS with a standard deviation of {settings.gps_sigma_m} m", "give a positive one"
        )


def check_pictures(weather: str, width_px: int, quality: int) -> None:
    """Raise UsageError for pictures that cannot be made."""
    if weather not in (*WEATHERS, RANDOM):
        raise UsageError(f"no weather {weather!r}", f"known: {', '.join(WEATHERS)}, {RANDOM}")
    if not SMALLEST_WIDTH_PX <= width_px <= FULL_WIDTH_PX or width_px % 4:
        hint = f"a multiple of 4 from {SMALLEST_WIDTH_PX} to {FULL_WIDTH_PX}"
        raise UsageError(f"pictures {width_px} px wide", hint)
    if not 1 <= quality <= 100:
        raise UsageError(f"a JPEG quality of {quality}", "give 1 to 100")


@dataclass(frozen=True, eq=False)
class SimulatedDrive:
    """A drive before any picture: pickled to a process, it calls itself to build what renders its frames."""

    settings: DriveSettings
    road_map: RoadMap | None = None
    """None: the Ring Road."""

    @property
    def world_seed(self) -> int:
        """The seed of what stands along the road."""
        given = self.settings.world_seed
        return self.settings.seed if given is None else given

    @cached_property
    def road(self) -> SimulatedRoad:
        """Centre line and poles."""
        return simulated_road(self.road_map, seed=self.world_seed, map_error_m=self.settings.map_error_m)

    @cached_property
    def vehicle(self) -> VehicleDrive:
        """Where the bus is at each frame."""
        chosen = self.settings
        return simulate_vehicle(
            self.road.centre_line,
            start_m=chosen.start_m,
            duration_s=chosen.duration_s,
            seed=chosen.seed,
            stop_at_m=chosen.stop_at_m,
            rate_hz=chosen.rate_hz,
        )

    @cached_property
    def weather(self) -> Weather:
        """The one that was named, or one drawn."""
        if self.settings.weather == RANDOM:
            return drawn_weather(np.random.default_rng([self.settings.seed, 31]))
        return WEATHERS[self.settings.weather]

    @cached_property
    def camera(self) -> Camera:
        """The camera that takes the pictures."""
        return basler_camera(self.settings.width_px)

    def __call__(self) -> Make:
        """Build world and renderer."""
        road, vehicle, seed = self.road, self.vehicle, self.settings.seed
        s_m = vehicle.frames.s_m
        route_m = float(s_m[0]), max(float(s_m[-1]), float(s_m[0]) + 1.0)
        world = build_world(road.centre_line, road.poles, seed=self.world_seed, route_m=route_m)
        traffic = Traffic(seed, world, lights_on=self.weather.lamps_are_lit)
        renderer = Renderer(
            world.scene, world.textures, self.camera, self.weather, seed=seed, street_lamps_m=road.lamps_m()
        )

        def make(index: int) -> FinishedFrame:
            state, T_map_body = vehicle.frames, vehicle.T_map_body[index]
            seconds = float(vehicle.frame_numbers[index] - 1) / vehicle.rate_hz
            frame = renderer.render(
                T_map_body,
                speed_mps=float(state.speed_mps[index]),
                yaw_rate_radps=float(state.yaw_rate_radps[index]),
                moving=traffic.at(seconds, float(s_m[index])),
                frame_seed=index,
            )
            distance_m = {
                pole.id: float(np.hypot(*(pole.position_m[:2] - T_map_body[:2, 3]))) for pole in road.poles
            }
            poles = seen_poles(frame.instance_ids, road.names, frame.visible_fraction, distance_m)
            jpeg = encode_jpeg(frame.image, self.settings.quality)
            return FinishedFrame(jpeg, self.camera.width_px, self.camera.height_px, poles)

        return make
