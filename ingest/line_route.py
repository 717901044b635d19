"""Which way through the pieces of a road is the road: its ring, or the longest way from end to end."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.line_graph import Chain, RoadGraph, node_path, shortest_paths

Array = NDArray[np.float64]

MIN_RING_WIDTH_M: Final = 30.0
"""Mean width, 2·area/length, of a closed line: that of a dual carriageway is less, and so is a roundabout's."""
OTHER_CARRIAGEWAY_M: Final = 40.0
SAMPLE_M: Final = 20.0
MAX_SAMPLES: Final = 2000
MAX_SCORED: Final = 60
"""Routes that are looked at, the longest first; only a tangle of one-way pieces has more to offer."""


def longest_route(graph: RoadGraph, part: Sequence[Chain]) -> list[Hashable]:
    """The nodes of the longest of all shortest ways between two ends, or of a ring that is no shorter.

    A ring is at least 30 m wide on average. Length that a route runs back beside itself on one-way pieces does not
    count: up one carriageway of a dual road and down the other is not a longer road.
    """
    best_m, best = 0.0, list(part[0].nodes)
    for _, route in _candidates(part, rings=False):
        nodes = node_path(*route)
        length_m = graph.length_m(nodes)
        if length_m <= best_m:
            break  # the candidates come by length, and none scores more than its length
        score_m = length_m - doubled_m(graph, nodes)
        if score_m > best_m:
            best_m, best = score_m, nodes
    for length_m, route in _candidates(part, rings=True):
        if length_m < best_m:
            break
        nodes = node_path(*route)
        wide = _width_m(graph, nodes) >= MIN_RING_WIDTH_M
        if wide and length_m - doubled_m(graph, nodes) >= best_m:
            return nodes
    return best


def _candidates(part: Sequence[Chain], rings: bool) -> list[tuple[float, tuple[Hashable, tuple[Chain, ...]]]]:
    """Length, start and chains of the longest shortest paths, or of the rings: each chain and the way back."""
    found: list[tuple[float, int, Hashable]] = []
    ends = list(dict.fromkeys(node for chain in part for node in (chain.nodes[0], chain.nodes[-1])))
    paths = [
        shortest_paths(part, chain.nodes[-1], without=chain) for chain in part
    ] if rings else [shortest_paths(part, end) for end in ends]  # fmt: skip
    order = {node: k for k, node in enumerate(ends)}
    for k, reached in enumerate(paths):
        if rings:
            back_m = reached.lengths_m.get(part[k].nodes[0])
            if back_m is not None:
                found.append((part[k].length_m + back_m, k, part[k].nodes[0]))
        else:
            found.extend((m, k, node) for node, m in reached.lengths_m.items() if order[node] > k)
    found.sort(key=lambda candidate: (-candidate[0], candidate[1]))
    routes = []
    for length_m, k, node in found[:MAX_SCORED]:
        back = paths[k].to(node)
        start, chains = (node, (part[k], *back)) if rings else (paths[k].start, back)
        routes.append((length_m, (start, chains)))
    return routes


def _width_m(graph: RoadGraph, ring: Sequence[Hashable]) -> float:
    """Mean width of a ring: twice its area over its length."""
    x, y = np.array([graph.places[node] for node in ring[:-1]]).T
    x, y = x - x[0], y - y[0]
    area = 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
    return 2.0 * area / max(graph.length_m(ring), 1e-9)


def doubled_m(graph: RoadGraph, nodes: Sequence[Hashable]) -> float:
    """Length (m) of a line on one-way pieces that run back beside other one-way pieces of it."""
    from scipy.spatial import cKDTree

    owners = [graph.owner(*step)[0] for step in pairwise(nodes)]
    oneway = np.array([line is not None and line.oneway for line in owners])
    if not oneway.any():
        return 0.0
    places = np.array([graph.places[node] for node in nodes])
    steps = np.diff(places, axis=0)
    lengths = np.hypot(*steps.T)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    spacing = max(SAMPLE_M, along[-1] / MAX_SAMPLES)
    at = np.arange(spacing / 2, along[-1], spacing)
    segment = np.clip(np.searchsorted(along, at, side="right") - 1, 0, len(steps) - 1)
    chosen = oneway[segment]
    at, segment = at[chosen], segment[chosen]
    points = np.column_stack([np.interp(at, along, places[:, k]) for k in (0, 1)])
    heading = steps[segment] / np.maximum(lengths[segment], 1e-9)[:, None]
    pairs = cKDTree(points).query_pairs(max(OTHER_CARRIAGEWAY_M, spacing), output_type="ndarray")
    back = (heading[pairs[:, 0]] * heading[pairs[:, 1]]).sum(axis=1) < -np.cos(np.radians(30.0))
    return float(spacing * len(np.unique(pairs[back])))
