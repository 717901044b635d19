"""Small foreign maps, made in the tests: places in metres about one origin, written as OSM, KML, GeoJSON, CSV."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from scpf.models.geodesy import Origin, geodetic_from_enu

ORIGIN = Origin(43.47, -80.54, 0.0)
Places = Mapping[int, tuple[float, float]]


def lon_lat(places_m: Sequence[tuple[float, float]]) -> NDArray[np.float64]:
    """Longitude and latitude (N, 2), with OpenStreetMap's seven digits, of East and North (m) about ORIGIN."""
    enu = np.column_stack([np.array(places_m, dtype=float).reshape(-1, 2), np.zeros(len(places_m))])
    latitude, longitude, _ = geodetic_from_enu(enu, ORIGIN)
    return np.round(np.column_stack([longitude, latitude]), 7)


def osm(
    nodes: Places,
    ways: Mapping[int, tuple[Sequence[int], Mapping[str, str]]],
    tags: Mapping[int, Mapping[str, str]],
) -> str:
    """OSM XML of nodes (m), ways (references, tags) and the nodes' tags."""

    def tag_lines(found: Mapping[str, str]) -> str:
        return "".join(f'<tag k="{key}" v="{value}"/>' for key, value in found.items())

    lines = ['<?xml version="1.0" encoding="UTF-8"?>', '<osm version="0.6">']
    for (node, _), (longitude, latitude) in zip(nodes.items(), lon_lat(list(nodes.values())), strict=True):
        lines.append(
            f'<node id="{node}" lat="{latitude:.7f}" lon="{longitude:.7f}">{tag_lines(tags.get(node, {}))}</node>'
        )
    for way, (references, found) in ways.items():
        nds = "".join(f'<nd ref="{reference}"/>' for reference in references)
        lines.append(f'<way id="{way}">{nds}{tag_lines(found)}</way>')
    return "\n".join([*lines, "</osm>", ""])


LAMP = {"highway": "street_lamp"}
ROAD = {"highway": "residential", "name": "Ring Road"}


def ring(count: int = 24, radius_m: float = 100.0) -> dict[int, tuple[float, float]]:
    """Nodes 1 … count on a circle, counter-clockwise from the East."""
    angles = 2 * np.pi * np.arange(count) / count
    return {k + 1: (float(radius_m * np.cos(a)), float(radius_m * np.sin(a))) for k, a in enumerate(angles)}


def a_ring_with_lamps() -> str:
    """A ring of 24 nodes in three ways, one drawn the other way, a branch, and landmarks near and far."""
    nodes = ring()
    nodes |= {50: (140.0, 0.0), 60: (105.0, 5.0), 61: (0.0, 0.0), 62: (135.0, 8.0), 63: (-104.0, 0.0)}
    ways = {
        10: ([*range(1, 11)], ROAD),
        11: ([*range(16, 9, -1)], ROAD),
        12: ([*range(16, 25), 1], ROAD),
        13: ([1, 50], ROAD),
        14: ([50, 61], {"highway": "footway", "name": "Short Cut"}),
    }
    tags = {60: LAMP, 61: {"power": "pole"}, 62: LAMP, 63: {"natural": "tree"}, 5: {"highway": "stop"}}
    return osm(nodes, ways, tags | {61: LAMP})
