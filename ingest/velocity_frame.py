"""In which frame are the velocities of a file? Their positions tell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

WGS84_A_M: Final = 6_378_137.0
WGS84_E2: Final = 6.694_379_990_14e-3
MAX_PAIRS: Final = 10_000
MIN_SPEED_MPS: Final = 0.5
"""Slower than this, noise decides."""
TOLERANCE: Final = 0.02
"""Share of the speed by which right velocities may miss the differences of positions (processing smooths both)."""


def velocity_from_positions(
    stamps_ns: Stamps, latitude_deg: Array, longitude_deg: Array, height_m: Array
) -> Array:
    """Mean velocity (M, 3), East-North-Up in m/s, from position 2k to 2k+1 of (2M,), for steps of metres."""
    seconds = np.diff(stamps_ns)[::2] * 1e-9
    lat = np.radians(latitude_deg[::2])
    curvature = 1.0 - WGS84_E2 * np.sin(lat) ** 2
    meridian = WGS84_A_M * (1.0 - WGS84_E2) / curvature**1.5
    normal = WGS84_A_M / np.sqrt(curvature)
    d_lat, d_lon = np.radians(np.diff(latitude_deg)[::2]), np.radians(np.diff(longitude_deg)[::2])
    height = height_m[::2]
    d_east, d_north = d_lon * (normal + height) * np.cos(lat), d_lat * (meridian + height)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # two rows of one time: not finite
        velocities: Array = np.column_stack([d_east, d_north, np.diff(height_m)[::2]]) / seconds[:, None]
    return velocities


def misfits(
    stamps_ns: Stamps, positions: tuple[Array, Array, Array], candidates: Mapping[str, Array]
) -> tuple[dict[str, float], float]:
    """RMS difference (m/s) of each candidate's velocities (2M, 3) from the positions', and the RMS speed.

    Rows 2k and 2k+1 are neighbours in time. NaN where no pair of neighbours is left.
    """
    derived = velocity_from_positions(stamps_ns, *positions)
    usable = np.isfinite(derived).all(axis=1) & (np.diff(stamps_ns)[::2] > 0)
    if not usable.any():
        return dict.fromkeys(candidates, np.nan), np.nan
    derived = derived[usable]

    def rms(difference: Array) -> float:
        # Damaged numbers may be as large as a float can be; then the sum is infinite, and so says the answer.
        with np.errstate(over="ignore", invalid="ignore"):
            return float(np.sqrt(np.median(np.sum(difference**2, axis=1))))

    means = {name: 0.5 * (velocity[::2] + velocity[1::2])[usable] for name, velocity in candidates.items()}
    return {name: rms(mean - derived) for name, mean in means.items()}, rms(derived)


def sample_pairs(count: int) -> NDArray[np.int64]:
    """Rows 2k, 2k+1 (neighbours), at most ``MAX_PAIRS`` pairs spread over ``count`` rows."""
    starts = np.unique(np.linspace(0, count - 2, min(count - 1, MAX_PAIRS)).astype(np.int64))
    return np.column_stack([starts, starts + 1]).ravel()


def agrees(misfit_mps: float, speed_mps: float) -> bool:
    """Whether velocities fit the positions: within 2 % of the speed, or 5 cm/s."""
    return bool(misfit_mps <= max(TOLERANCE * speed_mps, 0.05))
