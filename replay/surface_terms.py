"""Each constraint by itself over the grid of the constraint surface: which of them pulls where."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.bearing_constraint import RoadBearingConstraint
from scpf.models.constraint_surface import states_over
from scpf.models.constraints import Constraint, LandmarkConstraint
from scpf.models.matched_landmarks import MatchedLandmarks
from scpf.models.particle_filter import PositionFix
from scpf.replay.settings import Settings
from scpf.replay.step import Surface, SurfaceTerm

Array = NDArray[np.float64]

NEAREST_SHOWN: Final = 3
"""So many landmarks have views of their own; the others are recorded all the same."""
SAYS_NOTHING: Final = 1e9
"""A deviation that leaves range or bearing out."""


def term_names(settings: Settings) -> list[str]:
    """The terms that a replay with these settings can have, the nearest landmarks' alone, in the order of display."""
    wanted, landmarks = settings.constraints, range(1, NEAREST_SHOWN + 1)
    bearings = settings.heading is not None or settings.kalman is not None
    names = {
        "road": wanted.road,
        "speed": wanted.speed,
        "heading": settings.heading is not None,
        "gps": settings.gps.source != "none",
        **{f"range_{k}": wanted.landmarks for k in landmarks},
        **{f"bearing_{k}": wanted.landmarks and bearings for k in landmarks},
    }
    return [name for name, there in names.items() if there]


def surface_terms(
    constraints: Sequence[Constraint], fix: PositionFix | None, mean: Array, surface: Surface
) -> dict[str, SurfaceTerm]:
    """log Pr(γ ≥ C) of each constraint, and the GPS fix's log-likelihood, (R, C) over the cells of ``surface``.

    States are those of the surface: velocity and heading of ``mean`` (D,). ``range_1`` and ``bearing_1`` are the
    nearest landmark's. Where every particle takes its own match, each range and bearing is shown as if it were all
    that was seen.
    """
    rows, columns = surface.violation.shape
    east = surface.corner_m[0] + np.arange(columns) * surface.cell_m
    north = surface.corner_m[1] + np.arange(rows) * surface.cell_m
    states = states_over(mean, east, north)
    terms = {
        name: SurfaceTerm(label, one.log_probability(states).reshape(rows, columns))
        for name, label, one in (*_others(constraints), *_of_landmarks(constraints))
    }
    if fix is not None:
        terms["gps"] = SurfaceTerm("", fix.log_likelihood(states).reshape(rows, columns))
    return terms


def _others(constraints: Sequence[Constraint]) -> Iterator[tuple[str, str, Constraint]]:
    for one in constraints:
        if not isinstance(one, LandmarkConstraint | RoadBearingConstraint | MatchedLandmarks):
            yield one.name, "", one


def _of_landmarks(constraints: Sequence[Constraint]) -> Iterator[tuple[str, str, Constraint]]:
    """Name, label and constraint of every range and bearing, numbered by distance."""
    ranges = sorted(
        (one for one in constraints if isinstance(one, LandmarkConstraint)), key=lambda one: one.distance_m
    )
    numbers = {one.landmark_id: number for number, one in enumerate(ranges, 1)}
    for one in ranges:
        yield f"range_{numbers[one.landmark_id]}", one.landmark_id, one
    for bearing in constraints:
        if isinstance(bearing, RoadBearingConstraint) and bearing.landmark_id in numbers:
            yield f"bearing_{numbers[bearing.landmark_id]}", bearing.landmark_id, bearing
    yield from _of_matched([one for one in constraints if isinstance(one, MatchedLandmarks)])


def _of_matched(classes: Sequence[MatchedLandmarks]) -> Iterator[tuple[str, str, Constraint]]:
    """Range and bearing of every detection, each by itself; of each class of landmarks there is one constraint."""
    seen = [(sighting, matched) for matched in classes for sighting in matched.sightings]
    for number, (sighting, matched) in enumerate(sorted(seen, key=lambda pair: pair[0].distance_m), 1):
        for part, left_out in (("range", "bearing_deviation_rad"), ("bearing", "distance_deviation_m")):
            alone = replace(sighting, **{left_out: SAYS_NOTHING})
            label = f"{sighting.distance_m:.1f} m"
            yield f"{part}_{number}", label, replace(matched, sightings=[alone])
