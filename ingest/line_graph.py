"""Roads as a graph: chains of segments between the junctions and dead ends of lines that share vertices."""

from __future__ import annotations

import heapq
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAX_TURN_DEG: Final = 60.0
"""Across a gap, a road goes on within this angle; the two ends of a dual carriageway do not."""


@dataclass(frozen=True, eq=False)
class Polyline:
    """A line in metres: ``points_m`` (N, 2), ``nodes`` (N) that lines share where they meet."""

    id: str
    nodes: tuple[Hashable, ...]
    points_m: Array
    oneway: bool = False


@dataclass(frozen=True)
class Chain:
    """Nodes from one junction or dead end to the next, and the length of the way between."""

    nodes: tuple[Hashable, ...]
    length_m: float


@dataclass
class RoadGraph:
    """``places`` (2,) of each node, ``drawn``: the line that has each segment (u, v), in its direction.

    ``neighbours`` also holds the bridges across gaps, which no line has drawn.
    """

    places: dict[Hashable, Array] = field(default_factory=dict)
    neighbours: dict[Hashable, list[Hashable]] = field(default_factory=dict)
    drawn: dict[tuple[Hashable, Hashable], Polyline] = field(default_factory=dict)
    repeated: int = 0

    def owner(self, one: Hashable, two: Hashable) -> tuple[Polyline | None, int]:
        """The line that has the segment, and 1 where it is drawn this way, −1 where the other; None for a gap."""
        if (line := self.drawn.get((one, two))) is not None:
            return line, 1
        return self.drawn.get((two, one)), -1

    def length_m(self, nodes: Sequence[Hashable]) -> float:
        """Length of the line through these nodes."""
        places = np.array([self.places[node] for node in nodes])
        return float(np.hypot(*np.diff(places, axis=0).T).sum())


def graph_of(lines: Iterable[Polyline]) -> RoadGraph:
    """The graph of some lines. A segment that two lines share counts once; ``repeated`` counts the others."""
    graph = RoadGraph()
    for line in lines:
        for node, place in zip(line.nodes, line.points_m, strict=True):
            graph.places.setdefault(node, place)
            graph.neighbours.setdefault(node, [])
        for one, two in zip(line.nodes, line.nodes[1:], strict=False):
            if one == two:
                continue
            if (one, two) in graph.drawn or (two, one) in graph.drawn:
                graph.repeated += 1
                continue
            graph.drawn[one, two] = line
            graph.neighbours[one].append(two)
            graph.neighbours[two].append(one)
    return graph


def bridge_gaps(graph: RoadGraph, max_gap_m: float) -> None:
    """Join dead ends across gaps up to ``max_gap_m``, shortest first, where the road goes on in its direction."""
    from scipy.spatial import cKDTree

    ends = [node for node, near in graph.neighbours.items() if len(near) == 1]
    if len(ends) < 2 or max_gap_m <= 0.0:
        return
    places = np.array([graph.places[node] for node in ends])
    outward = np.array([_outward(graph, node) for node in ends])
    distances, others = cKDTree(places).query(places, k=min(5, len(ends)))
    candidates = sorted(
        (float(distance), one, int(two))
        for one, row in enumerate(zip(distances, others, strict=True))
        for distance, two in zip(*row, strict=True)
        if one != two and distance <= max_gap_m
    )
    used: set[int] = set()
    for distance, one, two in candidates:
        if used & {one, two} or ends[two] in graph.neighbours[ends[one]]:
            continue
        step = (places[two] - places[one]) / distance if distance > 0.5 else outward[one]
        if min(step @ outward[one], -(step @ outward[two])) < np.cos(np.radians(MAX_TURN_DEG)):
            continue
        used |= {one, two}
        graph.neighbours[ends[one]].append(ends[two])
        graph.neighbours[ends[two]].append(ends[one])


def _outward(graph: RoadGraph, end: Hashable) -> Array:
    """Unit vector (2,) in which the road leaves at a dead end."""
    step: Array = graph.places[end] - graph.places[graph.neighbours[end][0]]
    length = float(np.hypot(*step))
    return step / length if length > 0.0 else np.zeros(2)


def chains_of(graph: RoadGraph) -> list[Chain]:
    """All segments as chains that end at junctions and dead ends; a ring without any is one closed chain."""
    seen: set[frozenset[Hashable]] = set()
    chains = []
    corners = [node for node, near in graph.neighbours.items() if near and len(near) != 2]
    for start in [*corners, *graph.neighbours]:  # corners first: what is left then are rings
        for second in graph.neighbours[start]:
            if frozenset((start, second)) in seen:
                continue
            nodes = [start, second]
            seen.add(frozenset(nodes))
            while len(near := graph.neighbours[nodes[-1]]) == 2 and nodes[-1] != start:
                following = near[1] if near[0] == nodes[-2] else near[0]
                seen.add(frozenset((nodes[-1], following)))
                nodes.append(following)
            chains.append(Chain(tuple(nodes), graph.length_m(nodes)))
    return chains


def components(chains: Sequence[Chain]) -> list[list[Chain]]:
    """Chains that hang together, the greatest length first."""
    group: dict[Hashable, Hashable] = {}

    def root(node: Hashable) -> Hashable:
        while group.setdefault(node, node) != node:
            group[node] = group[group[node]]
            node = group[node]
        return node

    for chain in chains:
        group[root(chain.nodes[0])] = root(chain.nodes[-1])
    parts: dict[Hashable, list[Chain]] = {}
    for chain in chains:
        parts.setdefault(root(chain.nodes[0]), []).append(chain)
    return sorted(parts.values(), key=lambda part: -sum(chain.length_m for chain in part))


@dataclass(frozen=True)
class ShortestPaths:
    """Length of the shortest path from ``start`` to each node that can be reached, and how to get there."""

    start: Hashable
    lengths_m: dict[Hashable, float]
    _before: dict[Hashable, tuple[Chain, Hashable]]

    def to(self, node: Hashable) -> tuple[Chain, ...]:
        """The chains of the shortest path to a node."""
        path: list[Chain] = []
        while node != self.start:
            chain, node = self._before[node]
            path.append(chain)
        return tuple(reversed(path))


def shortest_paths(chains: Sequence[Chain], start: Hashable, without: Chain | None = None) -> ShortestPaths:
    """The shortest paths from ``start`` to every node that chains end at, avoiding one chain (Dijkstra)."""
    leaving: dict[Hashable, list[tuple[Chain, Hashable]]] = {}
    for chain in chains:
        if chain is not without:
            leaving.setdefault(chain.nodes[0], []).append((chain, chain.nodes[-1]))
            leaving.setdefault(chain.nodes[-1], []).append((chain, chain.nodes[0]))
    best: dict[Hashable, float] = {start: 0.0}
    before: dict[Hashable, tuple[Chain, Hashable]] = {}
    queue: list[tuple[float, int, Hashable]] = [(0.0, 0, start)]
    pushed = 0
    while queue:
        length, _, node = heapq.heappop(queue)
        if length > best[node]:
            continue
        for chain, other in leaving.get(node, ()):
            further = length + chain.length_m
            if further < best.get(other, np.inf):
                pushed += 1
                best[other], before[other] = further, (chain, node)
                heapq.heappush(queue, (further, pushed, other))
    return ShortestPaths(start, best, before)


def node_path(start: Hashable, path: Sequence[Chain]) -> list[Hashable]:
    """The nodes along a path of chains from ``start``."""
    nodes = [start]
    for chain in path:
        onward = chain.nodes if chain.nodes[0] == nodes[-1] else chain.nodes[::-1]
        nodes.extend(onward[1:])
    return nodes
