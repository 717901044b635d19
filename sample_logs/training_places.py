"""Pictures of a training set: short stretches of road, each with its own poles, weather, season and camera.

A world costs as much as five pictures, so a dozen pictures share one: other spots of the stretch, other traffic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.road_map import RoadMap
from scpf.sample_logs.basler import rotation
from scpf.sample_logs.centre_line import CentreLine
from scpf.sample_logs.drawn_camera import drawn_camera
from scpf.sample_logs.finished_frames import FinishedFrame, encode_jpeg, seen_poles
from scpf.sample_logs.pole_looks import drawn_look
from scpf.sample_logs.render_jobs import Make
from scpf.sample_logs.renderer import Renderer
from scpf.sample_logs.simulated_road import simulated_road
from scpf.sample_logs.speed_profile import MAX_SPEED_MPS
from scpf.sample_logs.traffic import Traffic
from scpf.sample_logs.vehicle_motion import LANE_MIDDLE_M
from scpf.sample_logs.weather import RANDOM, WEATHERS, drawn_weather
from scpf.sample_logs.world import build_world

PICTURES_AT_A_PLACE: Final = 12
STRETCH_M: Final = 120.0
OFF_LANE_M, MOST_OFF_LANE_M = 0.35, 0.9
HEADING_DEG, TILT_DEG = 1.5, 0.6
AUTUMN_SHARE: Final = 0.3
EXPOSURE_S: Final = (0.001, 0.008)
LONGEST_S: Final = 3600.0
"""Traffic is that of a moment within an hour."""


@dataclass(frozen=True)
class SetSettings:
    """All that a training set depends on, but for its road map."""

    count: int
    seed: int = 0
    weather: str = RANDOM
    width_px: int = 1024
    """Of the widest pictures."""
    quality: int = 90
    """Of the JPEG files, 1 to 100."""


class Place:
    """One stretch of road as one camera sees it; ``number`` and seed say which."""

    def __init__(self, settings: SetSettings, road_map: RoadMap | None, number: int) -> None:
        self.number, self._settings = number, settings
        rng = np.random.default_rng([settings.seed, 41, number])
        seed = int(rng.integers(2**31))
        self._seed, self._road = seed, simulated_road(road_map, seed=seed, map_error_m=0.0)
        line = self._road.centre_line
        self._stretch_m = STRETCH_M if line.closed else min(STRETCH_M, line.length_m)
        latest_m = line.length_m if line.closed else line.length_m - self._stretch_m
        self._start_m = float(rng.uniform(0.0, max(latest_m, 1e-9)))
        look = drawn_look(rng)
        drawn = settings.weather == RANDOM
        self._weather = drawn_weather(rng) if drawn else WEATHERS[settings.weather]
        season = float(rng.uniform(0.2, 1.0)) if rng.uniform() < AUTUMN_SHARE else 0.0
        self.camera = drawn_camera(settings.width_px, rng)
        route_m = self._start_m, self._start_m + self._stretch_m
        poles = self._road.poles
        world = build_world(line, poles, seed=seed, route_m=route_m, season=season, look=look)
        self._traffic = Traffic(seed, world, lights_on=self._weather.lamps_are_lit)
        lamps_m = self._road.lamps_m(look)
        self._renderer = Renderer(
            world.scene, world.textures, self.camera, self._weather, seed=seed, street_lamps_m=lamps_m
        )

    def picture(self, index: int) -> FinishedFrame:
        """The picture of an index of the whole set."""
        rng = np.random.default_rng([self._settings.seed, 43, index])
        s_m = self._start_m + float(rng.uniform(0.0, self._stretch_m))
        line, speed_mps = self._road.centre_line, float(rng.uniform(0.0, MAX_SPEED_MPS))
        T_map_body = _somewhere(line, s_m, rng)
        frame = self._renderer.render(
            T_map_body,
            speed_mps=speed_mps,
            yaw_rate_radps=speed_mps * float(line.curvature_per_m(s_m)),
            exposure_s=float(rng.uniform(*EXPOSURE_S)),
            moving=self._traffic.at(float(rng.uniform(0.0, LONGEST_S)), s_m),
            frame_seed=index,
        )
        distance_m = {
            pole.id: float(np.hypot(*(pole.position_m[:2] - T_map_body[:2, 3]))) for pole in self._road.poles
        }
        poles = seen_poles(frame.instance_ids, self._road.names, frame.visible_fraction, distance_m)
        facts = {
            "place": self.number,
            "weather": self._weather.name,
            "focal_px": round(float(self.camera.matrix[0, 0]), 2),
            "camera_height_m": round(float(self.camera.T_body_camera[2, 3]), 3),
        }
        jpeg = encode_jpeg(frame.image, self._settings.quality)
        return FinishedFrame(jpeg, self.camera.width_px, self.camera.height_px, poles, facts)


@dataclass(frozen=True, eq=False)
class TrainingPictures:
    """Pickled to a process, it calls itself to make pictures, and keeps the place of the last one."""

    settings: SetSettings
    road_map: RoadMap | None = None
    """None: the Ring Road, with other poles at every place."""

    def __call__(self) -> Make:
        """What makes the picture of an index."""
        place: Place | None = None

        def make(index: int) -> FinishedFrame:
            nonlocal place
            number = index // PICTURES_AT_A_PLACE
            if place is None or place.number != number:
                place = None  # frees its memory first
                place = Place(self.settings, self.road_map, number)
            return place.picture(index)

        return make


def _somewhere(line: CentreLine, s_m: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """T_map_body (4, 4) of a vehicle in its lane, not quite in the middle, heading and tilted a little aside."""
    off_m = float(np.clip(rng.normal(0.0, OFF_LANE_M), -MOST_OFF_LANE_M, MOST_OFF_LANE_M))
    position, tangent, _ = line.at(s_m, LANE_MIDDLE_M + off_m)
    heading_deg = math.degrees(math.atan2(tangent[1], tangent[0])) + float(rng.normal(0.0, HEADING_DEG))
    pitch_deg, roll_deg = (float(angle) for angle in rng.normal(0.0, TILT_DEG, 2))
    T_map_body = np.eye(4)
    T_map_body[:3, :3] = rotation(2, heading_deg) @ rotation(1, pitch_deg) @ rotation(0, roll_deg)
    T_map_body[:3, 3] = position
    return T_map_body
