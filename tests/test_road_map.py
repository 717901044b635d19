"""The road map: cubics of the centre line, directions, and GeoJSON both ways."""

from __future__ import annotations

import json

import numpy as np
import pytest

from scpf.models.errors import InputError
from scpf.models.geodesy import Origin
from scpf.models.road_map import Landmark, RoadMap, fit_segment, from_geojson, to_geojson


def ring(radius_m: float = 400.0) -> np.ndarray:
    turn = np.linspace(0, 2 * np.pi, 629)
    return radius_m * np.column_stack([np.cos(turn), np.sin(turn)])


@pytest.mark.parametrize("angle_deg", [0, 30, 44, 46, 90, 135, 200, 315])
def test_a_cubic_follows_the_line_near_its_anchor(angle_deg: float) -> None:
    angle = np.radians(angle_deg)
    anchor = 406.0 * np.array([np.cos(angle), np.sin(angle)])
    segment = fit_segment(ring(), anchor)
    nearby = angle + np.linspace(-0.06, 0.06, 13)
    on_line = 400.0 * np.column_stack([np.cos(nearby), np.sin(nearby)])
    assert np.abs(segment.offset_m(on_line)).max() < 0.02


def test_the_segment_is_that_of_the_nearest_landmark() -> None:
    marks = (Landmark("a", (406.0, 0.0, 0.0)), Landmark("b", (0.0, 406.0, 0.0)))
    road_map = RoadMap(marks, ring())
    near_b = road_map.segment_near(np.array([10.0, 399.0]))
    assert near_b is not None
    assert not near_b.swapped
    assert abs(near_b.centre_m[0]) < 1.0
    assert RoadMap(marks, np.zeros((0, 2))).segment_near(np.zeros(2)) is None


def test_direction_follows_the_sense_of_travel() -> None:
    road_map = RoadMap((), ring())
    there = road_map.direction_near(np.array([400.0, 1.0]), np.array([0.1, 2.0]))
    back = road_map.direction_near(np.array([400.0, 1.0]), np.array([0.1, -2.0]))
    assert there == pytest.approx(np.pi / 2, abs=0.02)
    assert back == pytest.approx(-np.pi / 2, abs=0.02)


@pytest.mark.parametrize("origin", [None, Origin(43.4712, -80.5449, 334.0)])
def test_geojson_round_trip(origin: Origin | None) -> None:
    marks = (
        Landmark("P1", (12.5, -3.25, 0.14), "light_pole", 0.04),
        Landmark("S2", (80.0, 9.0, 0.0), "traffic_sign"),
    )
    before = RoadMap(marks, ring()[:50], 3.7, origin, "© somebody")
    after = from_geojson(json.loads(json.dumps(to_geojson(before))))
    assert [m.id for m in after.landmarks] == ["P1", "S2"]
    assert after.landmarks[1].landmark_class == "traffic_sign"
    assert after.landmarks[0].variance_m2 == 0.04
    np.testing.assert_allclose(
        [m.position_m for m in after.landmarks], [m.position_m for m in marks], atol=2e-3
    )
    np.testing.assert_allclose(after.centre_line_m, before.centre_line_m, atol=0.02)
    assert (after.half_width_m, after.origin, after.attribution) == (3.7, origin, "© somebody")


def test_plain_geojson_gets_an_origin() -> None:
    lamp = {"type": "Feature", "geometry": {"type": "Point", "coordinates": [-80.5, 43.4]}, "properties": {}}
    road_map = from_geojson({"type": "FeatureCollection", "features": [lamp]})
    assert road_map.origin == Origin(43.4, -80.5, 0.0)
    np.testing.assert_allclose(road_map.positions_m, [[0.0, 0.0]], atol=1e-6)


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ([], "FeatureCollection"),
        ({"type": "FeatureCollection", "features": [{"geometry": None}]}, "feature 0"),
        (
            {
                "type": "FeatureCollection",
                "features": [{"geometry": {"type": "Point", "coordinates": ["x", 1]}}],
            },
            "feature 0",
        ),
        ({"type": "FeatureCollection", "scpf": {"version": 99}, "features": []}, "newer"),
        (
            {
                "type": "FeatureCollection",
                "features": [
                    {"geometry": {"type": "Point", "coordinates": [1, 2]}, "properties": {"id": "a"}},
                    {"geometry": {"type": "Point", "coordinates": [1, 3]}, "properties": {"id": "a"}},
                ],
            },
            "'a'",
        ),
    ],
)
def test_broken_maps_are_refused_by_place(document: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        from_geojson(document, "campus.geojson")
