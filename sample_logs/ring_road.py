"""The road that a simulated drive takes by default: the Ring Road of the University of Waterloo.

``ring_road.geojson`` is © OpenStreetMap contributors, ODbL 1.0, made of an extract of OpenStreetMap by

    scpf map from uw.osm -o ring_road.geojson --road "Ring Road" --origin 43.4729699 -80.548017 300

It also holds the 29 street lamps that are mapped; the simulator places its own. The origin is as high as the campus.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np

from scpf.models.errors import MissingError
from scpf.models.road_map import RoadMap, from_geojson
from scpf.sample_logs.centre_line import CentreLine

PATH = Path(__file__).with_name("ring_road.geojson")


@cache
def default_road_map() -> RoadMap:
    """The Ring Road: centre line, mapped street lamps, origin and attribution."""
    return from_geojson(json.loads(PATH.read_bytes()), PATH.name)


def default_centre_line() -> CentreLine:
    """The Ring Road's centre line, closed, clockwise, some 2.63 km long, in ``map`` of ``default_road_map``."""
    return centre_line_of(default_road_map())


def centre_line_of(road_map: RoadMap) -> CentreLine:
    """The centre line of a road map, closed where its last point is its first. Raises MissingError without one."""
    points = road_map.centre_line_m
    if len(points) < 2:
        raise MissingError(
            "the road map has no centre line to drive along", "make one: scpf map from … --road NAME"
        )
    return CentreLine(points, closed=bool(np.allclose(points[0], points[-1])))
