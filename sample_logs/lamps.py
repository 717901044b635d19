"""The lamps that light a frame: those of the street about the vehicle, and its own headlights."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.sample_logs.weather import Weather

Floats = NDArray[np.float64]

LAMP_POWER, BEAM_POWER = 50.0, 80.0
WITHIN_M, BEHIND_M = 130.0, 20.0
HEADLIGHTS_M: Final = ((2.6, 0.8, 0.8), (2.6, -0.8, 0.8))
"""In the body's frame."""


def lit_lamps(street_lamps_m: Floats, weather: Weather, T_map_body: Floats) -> Floats:
    """The lamps (L, 7) as Lighting takes them, of street_lamps_m (N, 3); none where the weather needs none."""
    if not weather.lamps_are_lit:
        return np.zeros((0, 7))
    forward = T_map_body[:2, 0] / np.linalg.norm(T_map_body[:2, 0])
    away = street_lamps_m[:, :2] - T_map_body[:2, 3]
    near = (np.hypot(*away.T) < WITHIN_M) & (away @ forward > -BEHIND_M)
    power = weather.lamp_power
    rows = [[*place, LAMP_POWER * power, 0.0, 0.0, 0.0] for place in street_lamps_m[near]]
    for place in HEADLIGHTS_M:
        in_map = T_map_body[:3, :3] @ place + T_map_body[:3, 3]
        rows.append([*in_map, BEAM_POWER * power, 1.0, *forward])
    return np.array(rows)
