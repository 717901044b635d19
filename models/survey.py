"""Survey: the landmarks of a map moved to where a drive with known poses saw them.

A map drawn by hand or from the air is a metre or two off, for ever, and no filter can tell that from its own error.
A drive with reference poses can: ranges and directions over many frames, matched to the old map, give each
landmark's place anew, and what they miss it by says how good they are. Matched once more to the new places and
weighed by that, they give it for good.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.road_map import Landmark, RoadMap
from scpf.models.survey_errors import Seen, common_bearing, lasting, scales
from scpf.models.survey_fit import FitSettings, Located, Sights, locate
from scpf.models.survey_matching import DOUBTFUL, NO_LANDMARK, Places, match

Array = NDArray[np.float64]

FEW: Final = "too few sightings"
VAGUE: Final = "no better than the map"
LEAST_PLACE_DEVIATION_M: Final = 0.1


@dataclass(frozen=True)
class SurveySettings:
    """``map_deviation_m``: how far the old map may be off, an axis.

    ``mounting_deviation_rad``: how far directions may be off, all of them alike.
    A landmark that fewer than ``fewest`` sightings show, or that they place worse than the old map, keeps its old
    position. ``rival_gap``: a sighting that another landmark, or another sighting of its frame, fits nearly as well
    (by so much in squared deviations) is left out.
    """

    map_deviation_m: float = 1.5
    mounting_deviation_rad: float = float(np.radians(0.5))
    fewest: int = 15
    rival_gap: float = 6.0
    fit: FitSettings = field(default_factory=FitSettings)


@dataclass(frozen=True)
class Surveyed:
    """What the survey made of one landmark.

    ``moved_m``: from its old position. ``deviation_m``: of the new one, an axis. ``sightings`` showed it and count as
    ``effective`` independent ranges; ``rejected`` more disagreed with them. ``reason``: why it keeps its old position,
    "" where it does not; it has then not moved, and its deviation is what the map says.
    """

    id: str
    moved_m: float
    deviation_m: float
    sightings: int
    effective: float
    rejected: int
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Survey:
    """The surveyed map; ``landmarks`` run in parallel with its own.

    ``unmatched`` sightings fit no landmark, ``doubtful`` ones more than one. ``turned_rad``: by how much all directions
    were found to point too far to the left, and ``turned_deviation_rad`` of it; the map is free of it. ``range_scale``
    and ``bearing_scale``: how much larger than stated the deviations were found to be, 1 where they were not;
    ``range_share``, ``bearing_share``: how much of their variances lasts. The map's variances know about all of them.
    """

    road_map: RoadMap
    landmarks: tuple[Surveyed, ...]
    unmatched: int
    doubtful: int
    range_scale: float
    bearing_scale: float
    range_share: float
    bearing_share: float
    turned_rad: float
    turned_deviation_rad: float


def survey(sights: Sights, road_map: RoadMap, settings: SurveySettings | None = None) -> Survey:
    """The map with the landmarks where ``sights`` show them; a landmark's variance is the mean over its two axes."""
    settings = settings or SurveySettings()
    old = road_map.positions_m
    stated = np.sqrt([mark.variance_m2 for mark in road_map.landmarks])
    classes = np.array([mark.landmark_class for mark in road_map.landmarks], dtype=np.str_)
    places = Places(old, np.maximum(stated, settings.map_deviation_m), classes)
    fit = settings.fit

    seen, _, _ = _round(sights, places, settings, fit)
    first, _ = common_bearing(seen, fit, settings.mounting_deviation_rad)
    sights = sights.turned(-first)

    seen, located, _ = _round(sights, places, settings, fit)
    range_scale, bearing_scale = scales(seen)
    fit = lasting(seen, (range_scale, bearing_scale), fit)
    fit = replace(fit, bearing_deviation_rad=bearing_scale * fit.bearing_deviation_rad)
    wider = [(mine.stretched(range_scale), each) for mine, each in seen]
    second, deviation = common_bearing(wider, fit, settings.mounting_deviation_rad)
    fit = replace(fit, common_bearing_rad=deviation)
    sights = sights.stretched(range_scale).turned(-second)

    _, located, matched = _round(sights, _placed(places, located, settings), settings, fit)
    marks, rows = [], []
    for mark, old_m, each in zip(road_map.landmarks, old, located, strict=True):
        new, row = _conclude(mark, old_m, each, settings)
        marks.append(new)
        rows.append(row)
    return Survey(
        replace(road_map, landmarks=tuple(marks), _segments={}),  # segments belong to the old places
        tuple(rows),
        int((matched == NO_LANDMARK).sum()),
        int((matched == DOUBTFUL).sum()),
        range_scale,
        bearing_scale,
        fit.ranges.share,
        fit.bearings.share,
        first + second,
        deviation,
    )


def _round(
    sights: Sights, places: Places, settings: SurveySettings, fit: FitSettings
) -> tuple[list[Seen], list[Located | None], NDArray[np.intp]]:
    """Match the sightings to ``places``, then locate each landmark; None for one that nothing shows."""
    matched = match(sights, places, fit.bearing_deviation_rad, fit.gate, settings.rival_gap)
    seen: list[Seen] = []
    located: list[Located | None] = [None] * len(places.positions_m)
    for k, start_m in enumerate(places.positions_m):
        mine = sights.rows(matched == k)
        if len(mine):
            found = located[k] = locate(mine, start_m, fit)
            seen.append((mine, found))
    return seen, located, matched


def _placed(places: Places, located: Sequence[Located | None], settings: SurveySettings) -> Places:
    """The places after the first round."""
    positions, deviations = places.positions_m.copy(), places.deviations_m.copy()
    for k, each in enumerate(located):
        if each is not None and not _reason(each, settings):
            positions[k] = each.position_m
            deviations[k] = max(_widest_m(each), LEAST_PLACE_DEVIATION_M)
    return replace(places, positions_m=positions, deviations_m=deviations)


def _widest_m(located: Located) -> float:
    """The deviation along the worst direction."""
    if not np.isfinite(located.covariance_m2).all():
        return np.inf
    return float(np.sqrt(np.linalg.eigvalsh(located.covariance_m2)[-1]))


def _reason(located: Located, settings: SurveySettings) -> str:
    if located.kept.sum() < settings.fewest:
        return FEW
    return VAGUE if _widest_m(located) > settings.map_deviation_m else ""


def _conclude(
    mark: Landmark, old_m: Array, located: Located | None, settings: SurveySettings
) -> tuple[Landmark, Surveyed]:
    """The landmark as the new map holds it, and what is said of it."""
    stated_m = float(np.sqrt(mark.variance_m2))
    if located is None:
        return mark, Surveyed(mark.id, 0.0, stated_m, 0, 0.0, 0, FEW)
    used = int(located.kept.sum())
    counts = (used, located.effective, len(located.kept) - used)
    if reason := _reason(located, settings):
        return mark, Surveyed(mark.id, 0.0, stated_m, *counts, reason)
    east, north = (float(value) for value in located.position_m)
    variance = 0.5 * float(np.trace(located.covariance_m2))
    new = replace(mark, position_m=(east, north, mark.position_m[2]), variance_m2=variance)
    moved = float(np.hypot(*(located.position_m - old_m)))
    return new, Surveyed(mark.id, moved, float(np.sqrt(variance)), *counts)
