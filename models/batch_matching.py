"""``NearestNeighbour.match`` for many Monte Carlo runs at once: every run matches around its own estimate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scpf.models.association import NearestNeighbour
from scpf.models.geodesy import wrap_angle

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


def nearest_landmarks(
    matching: NearestNeighbour,
    positions_m: Array,
    poses_m: Array,
    covariances_m2: Array,
    yaws_rad: Array,
    detections: Array,
    variances_m2: Array | None = None,
) -> Indices:
    """The landmark (M, R) of each detection in each run; −1 where it is left out as doubtful.

    ``positions_m`` (L, 2) is the map; ``poses_m`` (R, 2), ``covariances_m2`` (R, 3: xx, xy, yy) and ``yaws_rad``
    (R,) the estimates; ``detections`` (M, 3) are distance (m), its variance (m²), bearing (rad). ``variances_m2`` (L,)
    are those of the landmarks' places, of each axis; None where they are exact.
    """
    east, north = (positions_m[None] - poses_m[:, None]).transpose(2, 0, 1)
    range_m = np.hypot(east, north)
    c, s = east / np.maximum(range_m, 1e-9), north / np.maximum(range_m, 1e-9)
    xx, xy, yy = covariances_m2[:, :, None].transpose(1, 0, 2)
    own = np.zeros(len(positions_m)) if variances_m2 is None else variances_m2
    along = c * c * xx + 2 * c * s * xy + s * s * yy + own
    across = s * s * xx - 2 * c * s * xy + c * c * yy + own
    bearing = np.arctan2(north, east) - yaws_rad[:, None]
    bearing_variance = matching.bearing_deviation_rad**2 + across / np.maximum(range_m, 1.0) ** 2
    squared = np.empty((len(detections), *range_m.shape))
    for row, (distance_m, variance_m2, bearing_rad) in zip(squared, detections, strict=True):
        row[:] = (range_m - distance_m) ** 2 / (variance_m2 + along)
        row += wrap_angle(bearing - bearing_rad) ** 2 / bearing_variance
    squared[:, range_m > matching.max_distance_m] = np.inf

    best = np.argmin(squared, axis=2)
    two = np.sort(squared, axis=2)[:, :, :2]
    doubtful = two[..., 0] > matching.gate
    if two.shape[2] > 1:
        with np.errstate(invalid="ignore"):  # ∞ − ∞: no landmark near enough, doubtful already
            doubtful |= two[..., 1] - two[..., 0] < matching.rival_gap
    for m in range(len(detections)):
        for k in range(len(detections)):
            if k != m:
                rival = np.take_along_axis(squared[k], best[m][:, None], axis=1)[:, 0]
                with np.errstate(invalid="ignore"):
                    doubtful[m] |= rival - two[m, :, 0] < matching.rival_gap
    return np.where(doubtful, -1, best)
