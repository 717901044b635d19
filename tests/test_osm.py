"""OpenStreetMap XML: landmarks by their tags, the ways of a road, and files that lie."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest
from map_files import LAMP, ORIGIN, ROAD, a_ring_with_lamps, osm

from scpf.ingest.landmark_tags import landmark_class
from scpf.ingest.osm import read_osm
from scpf.models.errors import DamagedError, InputError


def write(folder: Path, text: str) -> Path:
    path = folder / "map.osm"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("tags", "expected"),
    [
        (LAMP, "light_pole"),
        ({**LAMP, "power": "pole"}, "light_pole"),
        ({**LAMP, "support": "wall"}, "lamp"),
        ({"power": "pole"}, "pole"),
        ({"traffic_sign": "CA:ON:Ra-1"}, "traffic_sign"),
        ({"highway": "stop"}, "traffic_sign"),
        ({"highway": "traffic_signals"}, "traffic_light"),
        ({"natural": "tree"}, "tree"),
        ({"highway": "crossing"}, None),
        ({"traffic_sign": ""}, None),
        ({}, None),
    ],
)
def test_the_table_of_tags(tags: dict[str, str], expected: str | None) -> None:
    assert landmark_class(tags) == expected


def test_landmarks_and_the_ways_of_a_road(tmp_path: Path) -> None:
    source = read_osm(write(tmp_path, a_ring_with_lamps()), "ring  ROAD")
    assert Counter(point.landmark_class for point in source.points) == {"light_pole": 2, "tree": 1}
    assert [line.id for line in source.lines] == ["way 10", "way 11", "way 12", "way 13"]
    assert source.lines[1].nodes == (16, 15, 14, 13, 12, 11, 10)
    assert source.attribution == "© OpenStreetMap contributors, ODbL 1.0"
    assert source.names == {"Ring Road": 29, "Short Cut": 2}
    assert source.points[0].id == "60"
    # node 61 is a lamp that a footway runs through: where its pole stands is not known
    assert source.left_out == {"light_pole that is a vertex of a road: it does not stand there": 1}


def test_without_a_road_the_names_are_known(tmp_path: Path) -> None:
    source = read_osm(write(tmp_path, a_ring_with_lamps()))
    assert source.lines == []
    assert set(source.names) == {"Ring Road", "Short Cut"}


def test_ways_may_come_before_their_nodes(tmp_path: Path) -> None:
    lines = a_ring_with_lamps().splitlines()
    ways = [line for line in lines if line.startswith("<way")]
    nodes = [line for line in lines if line.startswith("<node")]
    turned = "\n".join([*lines[:2], *ways, *nodes, "</osm>"])
    one, other = (read_osm(write(tmp_path, text), "Ring Road") for text in (a_ring_with_lamps(), turned))
    assert one.points == other.points
    assert [line.points.tolist() for line in one.lines] == [line.points.tolist() for line in other.lines]


def test_a_road_that_leaves_the_extract_comes_in_pieces(tmp_path: Path) -> None:
    nodes = {1: (0.0, 0.0), 2: (50.0, 0.0), 4: (150.0, 0.0), 5: (200.0, 0.0)}
    source = read_osm(write(tmp_path, osm(nodes, {7: ([1, 2, 3, 4, 5, 6], ROAD)}, {})), "Ring Road")
    assert [line.nodes for line in source.lines] == [(1, 2), (4, 5)]
    assert source.left_out == {"vertex of the road that is not in the file": 2}


@pytest.mark.parametrize(
    ("tags", "oneway", "nodes"),
    [({"oneway": "yes"}, True, (1, 2)), ({"oneway": "-1"}, True, (2, 1)), ({"oneway": "no"}, False, (1, 2)),
     ({"junction": "roundabout"}, True, (1, 2)), ({}, False, (1, 2))],
)  # fmt: skip
def test_one_way_roads(tmp_path: Path, tags: dict[str, str], oneway: bool, nodes: tuple[int, int]) -> None:
    text = osm({1: (0.0, 0.0), 2: (50.0, 0.0)}, {7: ([1, 2], ROAD | tags)}, {})
    (line,) = read_osm(write(tmp_path, text), "Ring Road").lines
    assert (line.oneway, line.nodes) == (oneway, nodes)


def test_what_is_no_road_to_drive_on_is_counted(tmp_path: Path) -> None:
    places = {1: (0.0, 0.0), 2: (50.0, 0.0)}
    ways = {
        7: ([1, 2], ROAD | {"highway": "construction"}),
        8: ([1, 2], ROAD | {"area": "yes"}),
        9: ([1, 2], ROAD),
    }
    source = read_osm(write(tmp_path, osm(places, ways, {})), "Ring Road")
    assert [line.id for line in source.lines] == ["way 9"]
    assert source.left_out.total() == 2


def test_alternative_names_and_references(tmp_path: Path) -> None:
    text = osm({1: (0.0, 0.0), 2: (50.0, 0.0)}, {7: ([1, 2], {"highway": "primary", "ref": "B 1"})}, {})
    assert len(read_osm(write(tmp_path, text), "b 1").lines) == 1


def test_deleted_and_broken_objects(tmp_path: Path) -> None:
    text = """<osm><node id="1" lat="95" lon="0"><tag k="highway" v="street_lamp"/></node>
    <node lat="1" lon="1"/><node id="3" lat="1" lon="1" visible="false"><tag k="highway" v="street_lamp"/></node>
    <node id="9999999999999999999999" lat="1" lon="1"/><node id="5" lat="nan" lon="1"/>
    <node id="4" lat="1" lon="1"><tag k="highway" v="street_lamp"/></node>
    <node id="4" lat="2" lon="2"/></osm>"""
    source = read_osm(write(tmp_path, text))
    assert [point.id for point in source.points] == ["4"]
    assert source.left_out == {"node without a number or a place": 4}
    assert source.notes == ["1 nodes come twice: the first was taken"]


BOMB = (
    '<?xml version="1.0"?><!DOCTYPE osm [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]><osm><tag k="&b;"/></osm>'
)


@pytest.mark.parametrize(
    ("text", "error", "what"),
    [
        (BOMB, InputError, "document type"),
        ('<!DOCTYPE osm SYSTEM "http://localhost/x.dtd"><osm/>', InputError, "document type"),
        ("<osm>" + "<a>" * 1000, InputError, "deeper"),
        ("<kml/>", InputError, "root is <kml>"),
        ("", DamagedError, "no element"),
        ("<osm><node id='1'", DamagedError, "line 1"),
        ("<osm></node></osm>", DamagedError, "mismatched"),
        ('<?xml version="1.0" encoding="utf-99"?><osm/>', DamagedError, "encoding"),
        ("<osm>&a;</osm>", DamagedError, "undefined entity"),
    ],
)
def test_files_that_are_refused(tmp_path: Path, text: str, error: type[Exception], what: str) -> None:
    with pytest.raises(error, match=what) as caught:
        read_osm(write(tmp_path, text))
    assert "map.osm" in str(caught.value)


def test_one_endless_tag_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="more than 8 MiB"):
        read_osm(write(tmp_path, "<osm><tag k='" + "a" * (10 << 20)))


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_osm(tmp_path / "none.osm")


def test_the_campus_of_waterloo(shared_data: Path) -> None:
    source = read_osm(shared_data / "waterloo" / "uw.osm", "Ring Road")
    assert sum(point.landmark_class == "light_pole" for point in source.points) == 221
    assert len(source.lines) == 12
    assert source.left_out == {}
    assert abs(source.points[0].y - ORIGIN.latitude_deg) < 0.02
