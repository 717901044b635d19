"""Positions as NavSatFix (latitude and longitude) and as poses in ``map``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.messages import make, to_header
from scpf.models.geodesy import Origin, enu_from_geodetic, geodetic_from_enu

Array = NDArray[np.float64]


def to_fix(stamp_ns: int, position_m: Array, variance_m2: Array | None, origin: Origin, frame: str) -> Any:
    """sensor_msgs/NavSatFix of a position (3,) in ``map``; ``variance_m2`` (3,) east, north, up."""
    latitude, longitude, height = geodetic_from_enu(position_m, origin)
    known = variance_m2 is not None
    return make(
        "sensor_msgs/msg/NavSatFix",
        header=to_header(stamp_ns, frame),
        status=make("sensor_msgs/msg/NavSatStatus", status=0, service=1),
        latitude=float(latitude[0]),
        longitude=float(longitude[0]),
        altitude=float(height[0]),
        position_covariance=np.diag(variance_m2).ravel() if variance_m2 is not None else np.zeros(9),
        position_covariance_type=2 if known else 0,
    )


def from_fix(fix: Any, origin: Origin) -> Array:
    """Position (3,) in ``map`` of a NavSatFix; an altitude that is not a number counts as the origin's."""
    height = fix.altitude if np.isfinite(fix.altitude) else origin.height_m
    latitude, longitude, up = (
        np.array([value], dtype=float) for value in (fix.latitude, fix.longitude, height)
    )
    position: Array = enu_from_geodetic(latitude, longitude, up, origin)[0]
    return position


def from_gps_fix(fix: Any, origin: Origin) -> tuple[float, float, float] | None:
    """East, north (m in ``map``) and variance (m², NaN where unknown) of a NavSatFix; None where it has no fix."""
    if fix.status.status < 0 or not np.isfinite([fix.latitude, fix.longitude]).all():
        return None
    if abs(fix.latitude) > 90.0 or abs(fix.longitude) > 360.0:
        raise ValueError(f"latitude {fix.latitude}, longitude {fix.longitude}")
    east, north, _ = (float(value) for value in from_fix(fix, origin))
    covariance = fix.position_covariance
    known = fix.position_covariance_type > 0
    return east, north, float(covariance[0] + covariance[4]) / 2 if known else float("nan")


def from_gps_pose(message: Any) -> tuple[float, float, float]:
    """East, north (m in ``map``) and variance (m², NaN where unknown) of a PoseWithCovarianceStamped."""
    at, covariance = message.pose.pose.position, message.pose.covariance
    if not np.isfinite([at.x, at.y]).all():
        raise ValueError("a position that is not finite")
    return float(at.x), float(at.y), float(covariance[0] + covariance[7]) / 2 or float("nan")
