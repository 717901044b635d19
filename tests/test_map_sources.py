"""Foreign maps by format, the road map made of them, and thousands of broken files."""

from __future__ import annotations

import json
import re
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from map_files import LAMP, ORIGIN, ROAD, a_ring_with_lamps, lon_lat, osm

from scpf.ingest.map_build import build
from scpf.ingest.map_source import MapSource
from scpf.ingest.map_sources import read_source
from scpf.models.errors import InputError, MissingError, ScpfError, UsageError
from scpf.models.geodesy import Origin
from scpf.models.road_map import from_geojson, to_geojson


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def collection(*features: tuple[str, Any, dict[str, Any]], **members: Any) -> str:
    """A GeoJSON FeatureCollection of (geometry type, coordinates, properties)."""
    found = [
        {"type": "Feature", "geometry": {"type": kind, "coordinates": coordinates}, "properties": properties}
        for kind, coordinates, properties in features
    ]
    return json.dumps({"type": "FeatureCollection", **members, "features": found})


LINE = lon_lat([(0.0, 0.0), (100.0, 0.0), (200.0, 10.0)]).tolist()
POLES = lon_lat([(50.0, 6.0), (90.0, -8.0), (90.0, 60.0)]).tolist()
KML = (
    '<kml xmlns="http://www.opengis.net/kml/2.2"><Document>'
    + "".join(f"<Placemark><Point><coordinates>{x},{y},3</coordinates></Point></Placemark>" for x, y in POLES)
    + f"<Placemark><name>Road</name><LineString><coordinates>{' '.join(f'{x},{y}' for x, y in LINE)}"
    + "</coordinates></LineString></Placemark></Document></kml>"
)
CSV = "name;Lat;Lng;Class\n" + "".join(f"p{k};{y};{x};\n" for k, (x, y) in enumerate(POLES)) + "p9;;;tree\n"


def test_an_osm_ring_becomes_a_map(tmp_path: Path) -> None:
    source = read_source(write(tmp_path, "ring.osm", a_ring_with_lamps()), "Ring Road")
    road_map, report = build(source, road="Ring Road", origin=ORIGIN)
    assert report.line is not None
    assert report.line.closed
    assert report.line.off == {"branch": (pytest.approx(40.0, abs=0.1), ("way 13",))}
    # the lamp at (135, 8) stands by the branch, not by the ring
    assert [mark.id for mark in road_map.landmarks] == ["60", "62"]
    np.testing.assert_allclose(road_map.positions_m, [[105.0, 5.0], [135.0, 8.0]], atol=0.02)
    np.testing.assert_allclose(np.hypot(*road_map.centre_line_m.T), 100.0, atol=0.02)
    assert road_map.attribution == "© OpenStreetMap contributors, ODbL 1.0"
    assert (report.kept, report.other_class) == ({"light_pole": 2}, {"tree": 1})
    assert not report.lossless
    trees, _ = build(source, road="Ring Road", classes={"tree"}, landmark_variance_m2=4.0)
    assert [(m.id, m.landmark_class, m.variance_m2) for m in trees.landmarks] == [("63", "tree", 4.0)]


def test_the_default_origin_lies_halfway_along_the_road(tmp_path: Path) -> None:
    source = read_source(write(tmp_path, "line.geojson", collection(("LineString", LINE, {}))))
    road_map, report = build(source)
    assert report.origin_from == "the vertex halfway along the centre line"
    np.testing.assert_allclose(road_map.centre_line_m, [[-100, 0], [0, 0], [100, 10]], atol=0.02)
    assert road_map.origin == Origin(LINE[1][1], LINE[1][0], 0.0)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("map.kml", KML),
        ("map.geojson", collection(("MultiPoint", POLES, {}), ("LineString", LINE, {"name": "Road"}))),
        ("map.xml", KML),
        ("map.json", collection(
            *(("Point", place, {"highway": "street_lamp", "@id": f"node/{k}"}) for k, place in enumerate(POLES)),
            ("MultiLineString", [LINE[:2], LINE[1:]], {"name": "Road"}),
        )),
    ],
)  # fmt: skip
def test_every_format_gives_the_same_map(tmp_path: Path, name: str, text: str) -> None:
    road_map, report = build(read_source(write(tmp_path, name, text), "road"), road="road", origin=ORIGIN)
    np.testing.assert_allclose(road_map.positions_m, [[50.0, 6.0], [90.0, -8.0]], atol=0.02)
    np.testing.assert_allclose(road_map.centre_line_m, [[0, 0], [100, 0], [200, 10]], atol=0.02)
    assert len({mark.id for mark in road_map.landmarks}) == 2
    assert (report.far, report.lossless) == ({"light_pole": 1}, True)
    assert ("OpenStreetMap" in road_map.attribution) == ("node/" in text)
    back = from_geojson(json.loads(json.dumps(to_geojson(road_map))))
    np.testing.assert_allclose(back.positions_m, road_map.positions_m, atol=1e-3)


def test_csv_in_degrees(tmp_path: Path) -> None:
    source = read_source(write(tmp_path, "poles.csv", CSV))
    assert source.left_out == {"row without a place": 1}
    road_map, report = build(source, origin=ORIGIN, attribution="© the city")
    np.testing.assert_allclose(road_map.positions_m, [[50.0, 6.0], [90.0, -8.0], [90.0, 60.0]], atol=0.02)
    assert [mark.id for mark in road_map.landmarks] == ["p0", "p1", "p2"]
    assert (road_map.attribution, len(road_map.centre_line_m), report.lossless) == ("© the city", 0, False)
    with pytest.raises(InputError, match=r"poles\.csv:3: .*not on the globe"):
        read_source(write(tmp_path, "poles.csv", "id,lat,lon\n1,43,-80\n2,-80,430\n"))
    with pytest.raises(InputError, match="no pair of coordinates"):
        read_source(write(tmp_path, "poles.csv", "id;x;y\n1;2;3\n"))


def test_csv_in_metres(tmp_path: Path) -> None:
    source = read_source(write(tmp_path, "poles.csv", "id,x,y,z\na,1,2,3\n"))
    road_map, _ = build(source)
    assert road_map.origin is None
    assert road_map.landmarks[0].position_m == (1.0, 2.0, 3.0)
    with pytest.raises(InputError, match="cannot be read as CSV"):
        read_source(write(tmp_path, "poles.csv", 'id,x,y\n"' + "a" * 200_000))


@pytest.mark.parametrize("origin", [None, Origin(43.47, -80.54, 330.0)])
def test_a_map_of_scpf_can_be_cut_anew(tmp_path: Path, origin: Origin | None) -> None:
    places = {"a": [0.0, 5.0, 1.5], "b": [80.0, 40.0, 0.0]}
    member = {"version": 1, "coordinates": "map_m", "attribution": "© someone"}
    features = [("LineString", [[0, 0], [50, 0], [100, 0]], {"kind": "centre_line", "half_width_m": 3.0})]
    features += [
        ("Point", place, {"kind": "landmark", "id": name, "class": "tree", "variance_m2": 0.25})
        for name, place in places.items()
    ]
    text = collection(*features, scpf=member)
    if origin is not None:
        metres = from_geojson(json.loads(text))
        text = json.dumps(
            to_geojson(type(metres)(metres.landmarks, metres.centre_line_m, 3.0, origin, "© someone"))
        )
    road_map, _ = build(read_source(write(tmp_path, "map.geojson", text)))
    assert (road_map.origin, road_map.half_width_m, road_map.attribution) == (origin, 3.0, "© someone")
    (mark,) = road_map.landmarks
    assert (mark.id, mark.landmark_class, mark.variance_m2) == ("a", "tree", 0.25)
    np.testing.assert_allclose(mark.position_m, (0.0, 5.0, 1.5), atol=1e-3)


def test_a_trajectory_may_give_the_road(tmp_path: Path) -> None:
    source = read_source(write(tmp_path, "ring.osm", a_ring_with_lamps()))
    track = np.column_stack([np.linspace(90.0, 150.0, 61), np.full(61, 2.0)])
    road_map, report = build(source, origin=ORIGIN, track_m=track, road_offset_m=1.75, within_m=10.0)
    np.testing.assert_allclose(road_map.centre_line_m[:, 1], 3.75)
    assert [mark.id for mark in road_map.landmarks] == ["60", "62"]
    assert report.line is None


def test_shared_ids_are_told_apart(tmp_path: Path) -> None:
    text = collection(
        *(("Point", place, {"id": name}) for place, name in zip(POLES, ("a", "a", "a#2"), strict=True))
    )
    road_map, report = build(read_source(write(tmp_path, "map.geojson", text)))
    assert [mark.id for mark in road_map.landmarks] == ["a", "a#2", "a#2#2"]
    assert "shared an id" in report.notes[-1]


def test_what_is_asked_for_and_not_there(tmp_path: Path) -> None:
    path = write(tmp_path, "ring.osm", a_ring_with_lamps())
    with pytest.raises(MissingError, match="no road named 'Ringroad'") as missing:
        build(read_source(path, "Ringroad"), road="Ringroad")
    assert "Ring Road" in missing.value.hint
    with pytest.raises(UsageError, match="2 named roads"):
        build(read_source(path))
    source = read_source(path, "Ring Road")
    with pytest.raises(InputError, match="no landmark is left") as none:
        build(source, road="Ring Road", within_m=0.5)
    assert "2 further than 0.5 m" in none.value.hint
    with pytest.raises(InputError, match="no landmark has the id 'x'"):
        build(source, road="Ring Road", select={"x"})
    _, report = build(source, road="Ring Road", classes={"light_pole", "gantry"}, exclude={"60"})
    assert report.notes == ["no landmark of class gantry (found: light_pole, tree)"]
    assert report.not_selected == 1


@pytest.mark.parametrize(
    ("name", "text", "what"),
    [
        ("map.pbf", "", "osmium"), ("map.kmz", "PK", "unzip"), ("map.shp", "", "ogr2ogr"), ("map.abc", "?", "known:"),
        ("map.geojson", "[]", "outermost"), ("map.geojson", "{", "is not JSON"),
        ("map.geojson", "[" * 100_000, "is not JSON"),
        ("map.geojson", collection(("Point", [1, 200], {})), "feature 0.*not on the globe"),
        ("map.geojson", collection(("Point", [1], {})), "feature 0.*no position"),
        ("map.geojson", collection(("Point", [True, 1], {})), "no coordinates"),
        ("map.geojson", collection(("Point", [1, 1, 10**400], {})), "feature 0"),
        ("map.geojson", collection(("Point", [5e5, 5e6], {}), crs={"properties": {"name": "EPSG::25832"}}), "ogr2ogr"),
        ("map.geojson", collection(("Point", [1, 1], {}), scpf={"origin": [1]}), "origin"),
        ("map.geojson", collection(("Polygon", [[[1, 1]]], {})), "1 not usable"),
    ],
)  # fmt: skip
def test_files_that_are_refused(tmp_path: Path, name: str, text: str, what: str) -> None:
    with pytest.raises(InputError) as caught:
        build(read_source(write(tmp_path, name, text)))
    assert re.search(what, f"{caught.value.message} {caught.value.hint}")
    assert name in caught.value.message


def test_the_campus_of_waterloo(shared_data: Path) -> None:
    source = read_source(shared_data / "waterloo" / "uw.osm", "Ring Road")
    road_map, report = build(source, road="Ring Road")
    assert report.line is not None
    assert report.line.closed
    assert report.line.named_m == pytest.approx(2757.0, abs=3.0)  # twelve ways; two of them lead off the ring
    assert report.line.length_m == pytest.approx(2632.5, abs=1.0)
    assert report.line.off == {"branch": (pytest.approx(123.2, abs=0.5), ("way 42685771", "way 42685772"))}
    assert Counter(mark.landmark_class for mark in road_map.landmarks) == {"light_pole": 29}
    assert "OpenStreetMap" in road_map.attribution
    offsets = []
    for position in road_map.positions_m:
        segment = road_map.segment_near(position)
        assert segment is not None
        offsets.append(abs(segment.offset_m(position[None])[0]))
    assert np.median(offsets) < 12.0  # as far beside the road as lamps stand


OSM = osm(
    {k: (10.0 * k, k % 3) for k in range(1, 9)} | {20: (15.0, 4.0), 21: (40.0, -5.0)},
    {1: ([1, 2, 3], ROAD), 2: ([5, 4, 3], ROAD | {"oneway": "yes"}), 3: ([6, 7, 8], ROAD)},
    {20: LAMP, 21: LAMP},
)
GEOJSON = collection(
    ("Point", [*POLES[0], 330.0], {"id": 1, "class": "pole"}), ("MultiPoint", POLES, {"highway": "street_lamp"}),
    ("LineString", LINE, {"name": "Road", "oneway": "-1", "half_width_m": 3}),
    scpf={"version": 1, "origin": [43.47, -80.54, 330.0], "coordinates": "wgs84"},
)  # fmt: skip
WHOLE = {
    "map.osm": OSM,
    "map.kml": KML,
    "map.geojson": GEOJSON,
    "map.csv": CSV,
    "xy.csv": "id,x,y,z,class\na,1,2,3,t\nb,4,5\n",
}
SNIPPETS = (b"<", b">", b"&", b'"', b"\x00", b"\xff\xfe", b"null", b"[]", b"{}", b"1e999", b"-1e-999",
            b"NaN", b",", b" ", b"\n", b"9" * 30, b"<!DOCTYPE x>", b"<![CDATA[", b"]]>", b"&#0;",
            b"true", b"\xc3\xa9", b"'", b";", b"0", b"-")  # fmt: skip


VALUE = re.compile(
    rb'-?\d[\d.]*|(?<==")[^"<>]*(?=")|(?<=[a-z]>)[^<>]+(?=</)|(?<=[,;])[a-z]+|(?<=")\w+(?=")|true|false|null'
)
"""Numbers, attributes, texts and names, not the tags: what is left can still be parsed."""
ODD_VALUES = (b"0", b"-1", b"181", b"90", b"-180", b"1e999", b"NaN", b"inf", b"", b" ", b"null", b"1_0",
              b"[1]", b"9" * 5000, b"6", b"4", b"id", b"lat", b"Point", b"LineString", b"node", b"way", b"nd", b"tag",
              b"wgs84", b"map_m", b"yes",
              b"\xc3\xa9", b"Road", b"coordinates", b"43.4700001")  # fmt: skip


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """The file with a few values exchanged, or bytes changed, cut, doubled or put in."""
    broken = rng.random() < 0.4
    for _ in range(int(rng.integers(1, 5))):
        if not broken:
            tokens = list(VALUE.finditer(data))
            token = tokens[int(rng.integers(len(tokens)))] if tokens else None
            other = tokens[int(rng.integers(len(tokens)))].group() if rng.random() < 0.4 and tokens else None
            new = other if other is not None else ODD_VALUES[int(rng.integers(len(ODD_VALUES)))]
            data = data if token is None else data[: token.start()] + new + data[token.end() :]
            continue
        at, size = int(rng.integers(0, len(data) + 1)), int(rng.integers(1, 40))
        snippet = SNIPPETS[int(rng.integers(len(SNIPPETS)))]
        noise = bytes(rng.integers(0, 256, 2, dtype=np.uint8))
        data = [
            data[:at] + noise + data[at + 2 :],
            data[:at] + snippet + data[at:],
            data[:at] + data[at + size :],
            data[: at + size] + data[at:],
            data[:at] + snippet + data[at + size :],
            data[:at] if rng.random() < 0.2 else data + snippet,
        ][int(rng.integers(6))]
    return data


@pytest.mark.parametrize("name", WHOLE)
def test_broken_files_raise_nothing_but_scpf_errors(tmp_path: Path, name: str) -> None:
    rng = np.random.default_rng(len(name))
    path = tmp_path / name
    outcomes: Counter[str] = Counter()
    began = time.monotonic()
    for _ in range(1000):
        path.write_bytes(mutated(WHOLE[name].encode(), rng))
        try:
            source = read_source(path, None if "csv" in name else "Ring Road" if "osm" in name else "Road")
            assert isinstance(source, MapSource)
            road_map, _ = build(source, origin=None if rng.random() < 0.2 else ORIGIN)
            from_geojson(json.loads(json.dumps(to_geojson(road_map))))
            outcomes["read"] += 1
        except ScpfError as error:
            assert str(path) in error.message
            outcomes[type(error).__name__] += 1
    assert outcomes["read"] > 100, outcomes
    assert outcomes.total() - outcomes["read"] > 100, outcomes
    assert time.monotonic() - began < 15.0
