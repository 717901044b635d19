"""Which landmark a sighting from a known pose shows: nearest in range and direction, one to one, none in doubt."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.geodesy import wrap_angle
from scpf.models.survey_fit import Sights

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

NO_LANDMARK: Final = -1
DOUBTFUL: Final = -2


@dataclass(frozen=True, eq=False)
class Places:
    """Where L landmarks may stand: ``positions_m`` (L, 2), ``deviations_m`` (L,) an axis, ``landmark_classes`` (L,)."""

    positions_m: Array
    deviations_m: Array
    landmark_classes: NDArray[np.str_]


def match(
    sights: Sights, places: Places, bearing_deviation_rad: float, gate: float, rival_gap: float
) -> Indices:
    """The landmark (N,) of each sighting; ``NO_LANDMARK`` or ``DOUBTFUL`` where there is none.

    ``gate``: largest squared miss of range and direction together, in their deviations and that of the landmark's
    place. A pair is doubtful where another landmark, or another sighting of the frame, is within ``rival_gap`` of it.
    """
    found = np.full(len(sights), NO_LANDMARK, dtype=np.intp)
    if not len(places.positions_m):
        return found
    starts = np.flatnonzero(np.diff(sights.times_s, prepend=-np.inf) > 0.0)
    for frame in np.split(np.arange(len(sights)), starts[1:]):
        found[frame] = _pairs(_squared(sights.rows(frame), places, bearing_deviation_rad), gate, rival_gap)
    return found


def _squared(sights: Sights, places: Places, bearing_deviation_rad: float) -> Array:
    """Squared misses (N, L) of the sightings of a frame."""
    ahead = places.positions_m[None] - sights.ranged_from_m[:, None]
    seen = places.positions_m[None] - sights.seen_from_m[:, None]
    range_m, away_m = np.hypot(ahead[..., 0], ahead[..., 1]), np.hypot(seen[..., 0], seen[..., 1])
    own = places.deviations_m**2
    squared: Array = (range_m - sights.distances_m[:, None]) ** 2 / (sights.variances_m2[:, None] + own)
    off = wrap_angle(np.arctan2(seen[..., 1], seen[..., 0]) - sights.directions_rad[:, None])
    squared += off**2 / (bearing_deviation_rad**2 + own / np.maximum(away_m, 1.0) ** 2)
    squared[sights.landmark_classes[:, None] != places.landmark_classes] = np.inf
    return squared


def _pairs(squared: Array, gate: float, rival_gap: float) -> Indices:
    """The landmark (N,) of each row of squared misses (N, L)."""
    rows = np.arange(len(squared))
    best = np.argmin(squared, axis=1)
    own = squared[rows, best]
    others = squared.copy()
    others[rows, best] = np.inf
    rivals = np.concatenate([others.min(axis=1)[:, None], squared[:, best].T], axis=1)
    rivals[rows, 1 + rows] = np.inf
    fits = own <= gate
    with np.errstate(invalid="ignore"):  # ∞ − ∞: no landmark of this class, none that fits
        clear = rivals.min(axis=1) - own >= rival_gap
    return np.where(fits & clear, best, np.where(fits, DOUBTFUL, NO_LANDMARK))
