"""Eastings and northings: transverse Mercator grids (UTM among them) into degrees, and their North into true North."""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import UsageError

Array = NDArray[np.float64]


class Grid(NamedTuple):
    """A transverse Mercator grid on WGS 84: degrees, metres."""

    central_meridian_deg: float
    origin_latitude_deg: float = 0.0
    scale: float = 0.9996
    false_easting_m: float = 500_000.0
    false_northing_m: float = 0.0


def utm(zone: str) -> Grid:
    """The grid of a UTM zone such as ``17N`` or ``33S``. Raises UsageError for what is none."""
    found = re.fullmatch(r"(\d{1,2})([NS])", zone.strip().upper())
    if found is None or not 1 <= int(found[1]) <= 60:
        raise UsageError(f"{zone!r} is not a UTM zone", "a zone is 1 … 60 with N or S, such as 17N")
    south = 10_000_000.0 if found[2] == "S" else 0.0
    return Grid(6.0 * int(found[1]) - 183.0, false_northing_m=south)


def to_geodetic(grid: Grid, easting_m: Array, northing_m: Array) -> tuple[Array, Array, Array]:
    """Latitude, longitude (deg) and convergence (rad), each (N,); NaN where the grid does not reach.

    Convergence: by how much grid North lies clockwise (east) of true North; true heading = grid heading + it.
    """
    projection = _projection(grid)
    longitude, latitude = (
        np.asarray(v, dtype=float) for v in projection(easting_m, northing_m, inverse=True)
    )
    outside = ~(np.isfinite(longitude) & np.isfinite(latitude))
    latitude, longitude = np.where(outside, np.nan, latitude), np.where(outside, np.nan, longitude)
    # On the sphere, and within 0.001° of the ellipsoid's up to 4° from the central meridian.
    offset = np.radians(longitude - grid.central_meridian_deg)
    convergence = np.arctan(np.tan(offset) * np.sin(np.radians(latitude)))
    return latitude, longitude, convergence


def from_geodetic(grid: Grid, latitude_deg: Array, longitude_deg: Array) -> tuple[Array, Array]:
    """Easting and northing (m), each (N,), of WGS 84 degrees; inf where the grid does not reach."""
    easting, northing = _projection(grid)(longitude_deg, latitude_deg)
    return np.asarray(easting, dtype=float), np.asarray(northing, dtype=float)


def _projection(grid: Grid) -> Any:
    from pyproj import Proj

    return Proj(
        proj="tmerc",
        ellps="WGS84",
        lat_0=grid.origin_latitude_deg,
        lon_0=grid.central_meridian_deg,
        k_0=grid.scale,
        x_0=grid.false_easting_m,
        y_0=grid.false_northing_m,
    )


def from_grid_north(velocity_mps: Array, convergence_rad: Array) -> Array:
    """Velocities (N, 3) in true East-North-Up of those along a grid's East and North."""
    cos, sin = np.cos(convergence_rad), np.sin(convergence_rad)
    east, north = velocity_mps[:, 0], velocity_mps[:, 1]
    return np.column_stack([cos * east + sin * north, cos * north - sin * east, velocity_mps[:, 2]])
