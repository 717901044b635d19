"""A survey on the estimation protocol: one drive with reference poses, and what it makes of a map that is off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scpf.models.survey import Survey, SurveySettings, survey
from scpf.models.survey_fit import Sights
from scpf.replay.protocol import FRAMES, Case, Scenario, make_scenario

Array = NDArray[np.float64]


def sights_of(scenario: Scenario) -> Sights:
    """Every detection of the scenario as a sighting from its true pose."""
    rows = [
        (time_s, *place, seen.distance_m, seen.variance_m2, heading + seen.bearing_rad)
        for time_s, place, heading, frame in zip(
            scenario.times_s.tolist(),
            scenario.drive.positions_m.tolist(),
            scenario.drive.headings_rad.tolist(),
            scenario.detections,
            strict=True,
        )
        for seen in frame
    ]
    values = np.array(rows).reshape(-1, 6)
    places = values[:, 1:3]
    classes = np.full(len(values), "light_pole")
    return Sights(values[:, 0], places, values[:, 3], values[:, 4], places, values[:, 5], classes)


def true_positions_m(case: Case, seed: int) -> Array:
    """Where the poles (L, 2) of a scenario really stand."""
    return make_scenario(replace(case, map_error_m=(0.0, 0.0)), seed, 2).road_map.positions_m


def survey_drive(
    case: Case, seed: int, frames: int = FRAMES, settings: SurveySettings | None = None
) -> Survey:
    """The survey of a case's map by its own drive."""
    scenario = make_scenario(case, seed, frames)
    return survey(sights_of(scenario), scenario.road_map, settings)


def drive_again(case: Case, seed: int, surveyed: Survey | None, frames: int = FRAMES) -> Scenario:
    """The next drive past the same poles, on their old map or a ``surveyed`` one."""
    scenario = make_scenario(case, seed, frames, again=1)
    return scenario if surveyed is None else replace(scenario, road_map=surveyed.road_map)
