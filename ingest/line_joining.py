"""The pieces of one road joined into its centre line, and what became of each piece.

A map file has a road in pieces: ways that meet end to end, slip lanes, the two carriageways of a dual road, both
sides of an unnamed roundabout. A road map has one line.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.line_graph import Polyline, RoadGraph, bridge_gaps, chains_of, components, graph_of
from scpf.ingest.line_route import OTHER_CARRIAGEWAY_M, longest_route
from scpf.models.errors import InputError

Array = NDArray[np.float64]

MAX_CHAINS: Final = 600
MAX_VERTICES: Final = 20_000


@dataclass(frozen=True, eq=False)
class JoinedLine:
    """The centre line (M, 2) in m through ``nodes`` (M), closed or open, and the account of its pieces.

    ``named_m`` is the length of all pieces, each segment once; ``gaps_m`` the gaps that were bridged; ``off`` the
    length and the pieces left off the line by reason: ``branch``, ``other carriageway``, ``apart``. ``beside_m``
    are those pieces (K, 2) that are not apart. ``lines`` counts the pieces that the line is made of,
    ``repeated`` the segments that came twice; ``direction`` says how the line's direction was chosen.
    """

    points_m: Array
    nodes: tuple[Hashable, ...]
    closed: bool
    length_m: float
    named_m: float
    gaps_m: tuple[float, ...]
    off: dict[str, tuple[float, tuple[str, ...]]]
    beside_m: tuple[Array, ...]
    lines: int
    direction: str
    repeated: int


def join(lines: Sequence[Polyline], max_gap_m: float = 30.0) -> JoinedLine:
    """The one line of a road's pieces.

    Of the pieces that hang together, bridging gaps up to ``max_gap_m`` between dead ends that face one another,
    those of the greatest length count; ``longest_route`` chooses the way through them. Vertices are kept as they
    are. Raises InputError where there is no line, for a tangle of more than 600 stretches and for more than
    20,000 vertices.
    """
    graph = graph_of(lines)
    if not graph.drawn:
        raise InputError("the road has no two vertices that differ")
    if len(graph.places) > MAX_VERTICES:
        hint = "cut the file to the area of the drive"
        raise InputError(f"the road has {len(graph.places)} vertices, more than {MAX_VERTICES}", hint)
    bridge_gaps(graph, max_gap_m)
    part = components(chains_of(graph))[0]
    if len(part) > MAX_CHAINS:
        hint = "cut the file to the area of the drive"
        raise InputError(f"the road is a net of {len(part)} stretches, not a line", hint)
    nodes = longest_route(graph, part)
    closed = len(nodes) > 2 and nodes[0] == nodes[-1]
    nodes, direction = _directed(graph, nodes, closed)
    steps = list(pairwise(nodes))
    owners = [graph.owner(*step)[0] for step in steps]
    off = _left_off(graph, nodes, {node for chain in part for node in chain.nodes})
    beside = {name for reason, (_, names) in off.items() if reason != "apart" for name in names}
    return JoinedLine(
        points_m=np.array([graph.places[node] for node in nodes]),
        nodes=tuple(nodes),
        closed=closed,
        length_m=graph.length_m(nodes),
        named_m=sum(graph.length_m(step) for step in graph.drawn),
        gaps_m=tuple(graph.length_m(step) for step, line in zip(steps, owners, strict=True) if line is None),
        off=off,
        beside_m=tuple(line.points_m for line in lines if line.id in beside),
        lines=len({line.id for line in owners if line is not None}),
        direction=direction,
        repeated=graph.repeated,
    )


def _directed(graph: RoadGraph, nodes: list[Hashable], closed: bool) -> tuple[list[Hashable], str]:
    """The line in the direction of its one-way pieces, else of its longest piece, where a ring starts, too."""
    along_m = against_m = 0.0
    drawn_m: dict[str, float] = {}
    senses: dict[str, int] = {}
    for step in pairwise(nodes):
        line, sense = graph.owner(*step)
        if line is None:
            continue
        length_m = graph.length_m(step)
        drawn_m[line.id] = drawn_m.get(line.id, 0.0) + length_m
        senses.setdefault(line.id, sense)
        along_m += length_m * (line.oneway and sense > 0)
        against_m += length_m * (line.oneway and sense < 0)
    longest = max(drawn_m, key=lambda name: drawn_m[name])
    forward, why = senses[longest] > 0, f"as {longest} is drawn"
    if along_m or against_m:
        forward, why = along_m >= against_m, "as its one-way pieces run"
        if min(along_m, against_m) > 1.0:
            why += f", but {min(along_m, against_m):.0f} m of them"
    nodes = nodes if forward else nodes[::-1]
    return (_turned(graph, nodes[:-1], longest) if closed else nodes), why


def _turned(graph: RoadGraph, ring: list[Hashable], longest: str) -> list[Hashable]:
    """A ring (without its last node) turned to start where the piece ``longest`` does, closed again."""
    owners = [graph.owner(one, two)[0] for one, two in zip(ring, [*ring[1:], ring[0]], strict=True)]
    mine = [line is not None and line.id == longest for line in owners]
    start = next((k for k, own in enumerate(mine) if own and not mine[k - 1]), 0)
    return [*ring[start:], *ring[: start + 1]]


def _left_off(
    graph: RoadGraph, nodes: Sequence[Hashable], part: set[Hashable]
) -> dict[str, tuple[float, tuple[str, ...]]]:
    """Length off the line, and the pieces that it belongs to, by reason."""
    line_m = np.array([graph.places[node] for node in nodes])
    used = {frozenset(step) for step in pairwise(nodes)}
    rest: dict[str, tuple[float, Polyline]] = {}
    for step, line in graph.drawn.items():
        if frozenset(step) not in used:
            rest[line.id] = rest.get(line.id, (0.0, line))[0] + graph.length_m(step), line
    found: dict[str, tuple[float, tuple[str, ...]]] = {}
    for name, (length_m, line) in rest.items():
        reason = "apart" if part.isdisjoint(line.nodes) else "branch"
        if line.oneway and _beside(line_m, line.points_m):
            reason = "other carriageway"
        sum_m, names = found.get(reason, (0.0, ()))
        found[reason] = sum_m + length_m, (*names, name)
    return found


def _beside(line_m: Array, piece_m: Array) -> bool:
    """Whether a piece runs along the line, as the other carriageway of a dual road does and a branch does not."""
    distance_m, at_m = nearest_on(line_m, piece_m)
    length_m = float(np.hypot(*np.diff(piece_m, axis=0).T).sum())
    return bool(distance_m.max() <= OTHER_CARRIAGEWAY_M and np.ptp(at_m) >= 0.7 * length_m)


def nearest_on(line_m: Array, points_m: Array) -> tuple[Array, Array]:
    """Distance (N,) of points (N, 2) from a polyline (M, 2), and the length along it of their nearest points."""
    start, step = line_m[:-1], np.diff(line_m, axis=0)
    squared = np.maximum((step**2).sum(1), 1e-12)
    before = np.concatenate([[0.0], np.cumsum(np.sqrt(squared))])
    distance, at = np.empty(len(points_m)), np.empty(len(points_m))
    for k, point in enumerate(points_m):
        share = np.clip(((point - start) * step).sum(1) / squared, 0.0, 1.0)
        square = ((start + share[:, None] * step - point) ** 2).sum(1)
        best = int(np.argmin(square))
        distance[k] = np.sqrt(square[best])
        at[k] = before[best] + share[best] * np.sqrt(squared[best])
    return distance, at
