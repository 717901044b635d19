"""The road map: landmarks, the road's centre line, and its GeoJSON form.

Positions are in the ``map`` frame: local East-North-Up metres at ``origin``. A map without an origin (a dataset
that is not georeferenced) keeps metres in its GeoJSON too and says so in the member ``scpf``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError
from scpf.models.geodesy import Origin, enu_from_geodetic, geodetic_from_enu

Array = NDArray[np.float64]

GEOJSON_VERSION: Final = 1
SEGMENT_HALF_LENGTH_M: Final = 30.0


@dataclass(frozen=True)
class Landmark:
    """A mapped object: ``position_m`` (east, north, up of its foot) in ``map``, ``variance_m2`` of each axis."""

    id: str
    position_m: tuple[float, float, float]
    landmark_class: str = "light_pole"
    variance_m2: float = 0.0


@dataclass(frozen=True, eq=False)
class RoadSegment:
    """A stretch of the centre line as the paper's cubic: y(x) = Σ b_k x^k, or with x and y exchanged.

    ``centre_m`` (2,) is subtracted first, so that the powers stay small; ``coefficients`` are b0 … b3.
    """

    centre_m: Array
    coefficients: Array
    swapped: bool

    def offset_m(self, positions_m: Array) -> Array:
        """Signed offsets (N,) of positions (N, 2): along y from the curve y(x), along x where swapped."""
        local = positions_m - self.centre_m
        along, across = (local[:, 1], local[:, 0]) if self.swapped else (local[:, 0], local[:, 1])
        b0, b1, b2, b3 = self.coefficients
        offset: Array = across - (b0 + along * (b1 + along * (b2 + along * b3)))
        return offset


@dataclass(frozen=True, eq=False)
class RoadMap:
    """Landmarks, centre line (M, 2) in m, half width of the road, and the origin of the ``map`` frame."""

    landmarks: tuple[Landmark, ...]
    centre_line_m: Array
    half_width_m: float = 4.0
    origin: Origin | None = None
    attribution: str = ""
    _segments: dict[int, RoadSegment] = field(default_factory=dict, repr=False)

    @property
    def positions_m(self) -> Array:
        """Horizontal landmark positions (L, 2)."""
        return np.array([mark.position_m[:2] for mark in self.landmarks], dtype=float).reshape(-1, 2)

    def landmark(self, landmark_id: str) -> Landmark | None:
        """The landmark of that id; None where the map has none."""
        return next((mark for mark in self.landmarks if mark.id == landmark_id), None)

    def segment_near(self, position_m: Array) -> RoadSegment | None:
        """The cubic of the landmark nearest to ``position_m`` (2,), as in the paper; None without a road.

        Where the map has a centre line and no landmark, the line's own nearest point takes the pole's place.
        """
        if len(self.centre_line_m) < 4:
            return None
        anchors = self.positions_m if self.landmarks else self.centre_line_m
        index = int(np.argmin(np.hypot(*(anchors - position_m).T)))
        if index not in self._segments:
            self._segments[index] = fit_segment(self.centre_line_m, anchors[index])
        return self._segments[index]

    def direction_near(self, position_m: Array, velocity_mps: Array) -> float | None:
        """Direction of travel (rad, counter-clockwise from East) of the road nearest to ``position_m`` (2,).

        Of the road's two senses, the one closer to ``velocity_mps`` (2,); None without a centre line.
        """
        if len(self.centre_line_m) < 2:
            return None
        middles = 0.5 * (self.centre_line_m[1:] + self.centre_line_m[:-1])
        nearest = int(np.argmin(((middles - position_m) ** 2).sum(1)))
        tangent = self.centre_line_m[nearest + 1] - self.centre_line_m[nearest]
        if tangent @ velocity_mps < 0.0:
            tangent = -tangent
        return float(np.arctan2(tangent[1], tangent[0]))


def fit_segment(centre_line_m: Array, anchor_m: Array) -> RoadSegment:
    """The least-squares cubic of the centre line within 30 m along it of its point nearest to ``anchor_m`` (2,).

    The line is resampled by length first, so that vertices that crowd in a bend do not outweigh the rest.
    """
    closed = bool(np.allclose(centre_line_m[0], centre_line_m[-1]))
    steps = np.hypot(*np.diff(centre_line_m, axis=0).T)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    nearest = _nearest_length(centre_line_m, length, anchor_m)
    at = nearest + np.linspace(-SEGMENT_HALF_LENGTH_M, SEGMENT_HALF_LENGTH_M, 61)
    at = at % length[-1] if closed else at[(at >= 0.0) & (at <= length[-1])]
    points = np.column_stack([np.interp(at, length, centre_line_m[:, k]) for k in (0, 1)])
    centre = points.mean(axis=0)
    spread = np.ptp(points, axis=0)
    swapped = bool(spread[1] > spread[0])
    along, across = (points - centre).T[::-1] if swapped else (points - centre).T
    return RoadSegment(centre, np.polyfit(along, across, 3)[::-1].copy(), swapped)


def _nearest_length(line_m: Array, length: Array, point_m: Array) -> float:
    """Length along the polyline (M, 2) of its point nearest to ``point_m`` (2,)."""
    start, step = line_m[:-1], np.diff(line_m, axis=0)
    squared = np.maximum((step**2).sum(1), 1e-12)
    share = np.clip(((point_m - start) * step).sum(1) / squared, 0.0, 1.0)
    foot = start + share[:, None] * step
    best = int(np.argmin(((foot - point_m) ** 2).sum(1)))
    return float(length[best] + share[best] * np.sqrt(squared[best]))


def to_geojson(road_map: RoadMap) -> dict[str, Any]:
    """The map as a GeoJSON FeatureCollection: a Point a landmark, one LineString for the centre line."""

    def coordinates(points_m: Array) -> list[list[float]]:
        if road_map.origin is None:
            return [[round(float(v), 4) for v in point] for point in points_m]
        up = points_m if points_m.shape[1] == 3 else np.column_stack([points_m, np.zeros(len(points_m))])
        latitude, longitude, height = geodetic_from_enu(up, road_map.origin)
        rows = np.column_stack([longitude, latitude, height])[:, : points_m.shape[1]]
        return [
            [round(float(x), 9), round(float(y), 9), *(round(float(z), 4) for z in rest)]
            for x, y, *rest in rows
        ]

    features: list[dict[str, Any]] = []
    if len(road_map.centre_line_m):
        line = {"type": "LineString", "coordinates": coordinates(road_map.centre_line_m)}
        properties = {"kind": "centre_line", "half_width_m": road_map.half_width_m}
        features.append({"type": "Feature", "geometry": line, "properties": properties})
    for mark in road_map.landmarks:
        point = {"type": "Point", "coordinates": coordinates(np.array([mark.position_m]))[0]}
        properties = {
            "kind": "landmark",
            "id": mark.id,
            "class": mark.landmark_class,
            "variance_m2": mark.variance_m2,
        }
        features.append({"type": "Feature", "geometry": point, "properties": properties})
    frame = "map_m" if road_map.origin is None else "wgs84"
    member: dict[str, Any] = {"version": GEOJSON_VERSION, "coordinates": frame}
    if road_map.origin is not None:
        member["origin"] = list(road_map.origin)
    if road_map.attribution:
        member["attribution"] = road_map.attribution
    return {"type": "FeatureCollection", "scpf": member, "features": features}


def from_geojson(document: Any, name: str = "map") -> RoadMap:
    """The road map of a GeoJSON FeatureCollection; ``name`` is what errors call it.

    Without the member ``scpf``, coordinates are longitude and latitude (RFC 7946) and the first position
    becomes the origin. Raises InputError naming the feature that cannot be read.
    """
    if not isinstance(document, dict) or document.get("type") != "FeatureCollection":
        raise InputError(f"{name}: not a GeoJSON FeatureCollection")
    member = document.get("scpf", {})
    if member.get("version", GEOJSON_VERSION) > GEOJSON_VERSION:
        raise InputError(f"{name}: map version {member['version']} is newer than this scpf", "update scpf")
    features = document.get("features")
    if not isinstance(features, list):
        raise InputError(f"{name}: no list of features")
    parsed = [_feature(feature, f"{name}: feature {k}") for k, feature in enumerate(features)]
    origin = None
    if member.get("coordinates", "wgs84") == "wgs84" and parsed:
        longitude, latitude, height = (float(value) for value in np.nan_to_num(parsed[0][1][0]))
        origin = (
            Origin(*map(float, member["origin"]))
            if "origin" in member
            else Origin(latitude, longitude, height)
        )

    landmarks: list[Landmark] = []
    centre_line, half_width = np.zeros((0, 2)), 4.0
    for properties, coordinates in parsed:
        # A position without a height lies in the plane of the origin, not at the ellipsoid.
        coordinates = np.where(np.isnan(coordinates), 0.0 if origin is None else origin.height_m, coordinates)
        longitude_deg, latitude_deg, height_m = coordinates.T
        points = coordinates
        if origin is not None:
            points = enu_from_geodetic(latitude_deg, longitude_deg, height_m, origin)
        if len(points) > 1 or properties.get("kind") == "centre_line":
            centre_line, half_width = points[:, :2].copy(), float(properties.get("half_width_m", 4.0))
        else:
            east, north, up = (float(v) for v in points[0])
            landmarks.append(
                Landmark(
                    str(properties.get("id", len(landmarks) + 1)),
                    (east, north, up),
                    str(properties.get("class", "light_pole")),
                    float(properties.get("variance_m2", 0.0)),
                )
            )
    names = [mark.id for mark in landmarks]
    if len(set(names)) < len(names):
        twice = next(n for n in names if names.count(n) > 1)
        raise InputError(f"{name}: two landmarks have the id {twice!r}", "give every landmark its own id")
    return RoadMap(tuple(landmarks), centre_line, half_width, origin, str(member.get("attribution", "")))


def _feature(feature: Any, place: str) -> tuple[dict[str, Any], Array]:
    """Properties and coordinates (N, 3) of a Point or LineString feature; NaN where it states no height."""
    try:
        geometry = feature["geometry"]
        rows = {"Point": [geometry["coordinates"]], "LineString": geometry["coordinates"]}[geometry["type"]]
        values = [[float(value) for value in row[:3]] for row in rows]
        finite = all(np.isfinite(value) for row in values for value in row)
        coordinates = np.array([row + [np.nan] * (3 - len(row)) for row in values]).reshape(-1, 3)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{place}: not a Point or LineString ({error!r})") from error
    if not finite or not len(coordinates) or np.isnan(coordinates[:, :2]).any():
        raise InputError(f"{place}: coordinates are not finite numbers")
    return dict(feature.get("properties") or {}), coordinates
