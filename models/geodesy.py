"""Geodetic and local coordinates, and every change of angle convention, in one place.

Applanix: heading clockwise from true North, attitude of a body x forward, y right, z down in North-East-Down.
Drive log: ``map`` is East-North-Up, ``body`` x forward, y left, z up, yaw counter-clockwise from East. Map grids such
as UTM, and their North, are in ``grids``.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

R_ENU_NED: Final = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
R_FLU_FRD: Final = np.diag([1.0, -1.0, -1.0])


class Origin(NamedTuple):
    """The origin of a local frame: WGS 84 degrees, ellipsoid height in metres."""

    latitude_deg: float
    longitude_deg: float
    height_m: float


@lru_cache(maxsize=8)
def _tangent_plane(origin: Origin) -> Any:
    from pyproj import Transformer

    latitude, longitude, height = (float(value) for value in origin)
    place = f"+lat_0={latitude!r} +lon_0={longitude!r} +h_0={height!r}"
    return Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
        f"+step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 {place}"
    )


def enu_from_geodetic(latitude_deg: Array, longitude_deg: Array, height_m: Array, origin: Origin) -> Array:
    """Local East-North-Up (N, 3) in m, tangent at ``origin``, of WGS 84 positions (N,)."""
    columns = _tangent_plane(origin).transform(longitude_deg, latitude_deg, height_m)
    return np.column_stack([np.asarray(column, dtype=float) for column in columns])


def geodetic_from_enu(positions_m: Array, origin: Origin) -> tuple[Array, Array, Array]:
    """Latitude and longitude (deg), ellipsoid height (m), each (N,), of East-North-Up positions (N, 3)."""
    columns = np.asarray(positions_m, dtype=float).reshape(-1, 3).T
    longitude, latitude, height = _tangent_plane(origin).transform(*columns, direction="INVERSE")
    return np.asarray(latitude), np.asarray(longitude), np.asarray(height)


def ecef_from_enu(latitude_deg: Array, longitude_deg: Array) -> Array:
    """Rotations (N, 3, 3) of local East-North-Up into earth-centred, earth-fixed axes."""
    lat, lon = np.radians(latitude_deg), np.radians(longitude_deg)
    zero = np.zeros_like(lat)
    east = [-np.sin(lon), np.cos(lon), zero]
    north = [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)]
    up = [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)]
    return np.stack([np.stack(axis, axis=-1) for axis in (east, north, up)], axis=-1)


def yaw_from_heading(heading_rad: Array) -> Array:
    """Yaw, counter-clockwise from East, of a heading clockwise from true North (rad), in (−π, π]."""
    return wrap_angle(np.pi / 2 - np.asarray(heading_rad))


def wrap_angle(angle_rad: Array) -> Array:
    """The same angle in (−π, π]."""
    wrapped: Array = np.pi - np.mod(np.pi - np.asarray(angle_rad, dtype=float), 2 * np.pi)
    return wrapped


def rotation_from_ned(R_ned_frd: Array) -> Array:
    """``R_map_body`` (…, 3, 3) of an attitude ``R_ned_frd`` (North-East-Down ← forward-right-down)."""
    rotation: Array = R_ENU_NED @ R_ned_frd @ R_FLU_FRD
    return rotation
