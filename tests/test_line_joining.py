"""Pieces of a road joined into one line: rings, gaps, branches, carriageways, direction."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from map_files import ring

from scpf.ingest.line_graph import Polyline
from scpf.ingest.line_joining import join, nearest_on
from scpf.models.errors import InputError


def line(name: str, nodes: str, places: dict[str, tuple[float, float]], oneway: bool = False) -> Polyline:
    """A piece through nodes of one letter each."""
    return Polyline(name, tuple(nodes), np.array([places[node] for node in nodes], dtype=float), oneway)


ROW = {name: (50.0 * k, 0.0) for k, name in enumerate("abcdefgh")}


def test_pieces_meet_end_to_end_whatever_their_direction() -> None:
    joined = join([line("1", "cba", ROW), line("2", "cd", ROW), line("3", "hgfed", ROW)])
    assert "".join(map(str, joined.nodes)) == "hgfedcba"  # as the longest is drawn
    assert (joined.length_m, joined.named_m, joined.lines, joined.closed) == (350.0, 350.0, 3, False)
    assert (joined.gaps_m, joined.off, joined.direction) == ((), {}, "as 3 is drawn")


def test_one_way_pieces_give_the_direction() -> None:
    joined = join([line("1", "abcde", ROW), line("2", "gfe", ROW, oneway=True)])
    assert "".join(map(str, joined.nodes)) == "gfedcba"
    assert joined.direction == "as its one-way pieces run"
    both = join([line("1", "abcde", ROW, oneway=True), line("2", "gfe", ROW, oneway=True)])
    assert "".join(map(str, both.nodes)) == "abcdefg"
    assert "but 100 m of them" in both.direction


def test_a_ring_is_closed_and_its_branches_are_named() -> None:
    places = {chr(96 + k): place for k, place in ring().items()} | {"z": (200.0, 0.0), "y": (300.0, 0.0)}
    names = "abcdefghijklmnopqrstuvwx"
    pieces = [line("1", names[:14], places), line("2", names[13:][::-1], places), line("3", "xa", places)]
    joined = join([*pieces, line("4", "azy", places)])
    assert joined.closed
    assert joined.nodes[0] == joined.nodes[-1] == "a"
    assert "".join(map(str, joined.nodes)) == names + "a"
    assert joined.length_m == pytest.approx(24 * 200 * np.sin(np.pi / 24))
    assert joined.off == {"branch": (pytest.approx(200.0), ("4",))}
    assert [len(piece) for piece in joined.beside_m] == [3]


def test_a_turning_loop_at_the_end_of_a_road_is_no_ring() -> None:
    places = {chr(96 + k): (x * 0.4, y * 0.4) for k, (x, y) in ring().items()} | {"z": (900.0, 0.0)}
    joined = join([line("loop", "abcdefghijklmnopqrstuvwxa", places), line("road", "za", places)])
    assert not joined.closed
    assert joined.length_m == 860.0
    assert joined.off == {"branch": (pytest.approx(80 * 24 * np.sin(np.pi / 24)), ("loop",))}


def test_a_gap_is_bridged_where_the_road_goes_on() -> None:
    places = ROW | {"x": (165.0, 5.0), "y": (250.0, 5.0), "u": (165.0, 40.0)}
    joined = join([line("1", "abcd", places), line("2", "xy", places)])
    assert joined.gaps_m == (pytest.approx(np.hypot(15, 5)),)
    assert joined.length_m == pytest.approx(150.0 + np.hypot(15, 5) + 85.0)
    apart = join([line("1", "abcd", places), line("2", "xy", places)], max_gap_m=10.0)
    assert (apart.gaps_m, apart.length_m, apart.off) == ((), 150.0, {"apart": (85.0, ("2",))})
    around_the_corner = join([line("1", "abcd", places), line("2", "xu", places)])
    assert around_the_corner.gaps_m == ()


def test_a_ring_with_a_gap_is_closed() -> None:
    places = {chr(96 + k): place for k, place in ring().items()}
    joined = join([line("1", "abcdefghijklmnopqrstuvwx", places)])  # a and x are 26 m from each other
    assert joined.closed
    assert joined.gaps_m == (pytest.approx(200 * np.sin(np.pi / 24)),)


@pytest.mark.parametrize("joined_at_the_ends", [True, False])
def test_of_a_dual_carriageway_one_side_is_the_line(joined_at_the_ends: bool) -> None:
    places = ROW | {name.upper(): (x, 15.0) for name, (x, _) in ROW.items()}
    pieces = [line("east", "abcdefgh", places, oneway=True), line("west", "HGFEDCBA", places, oneway=True)]
    if joined_at_the_ends:
        places |= {"1": (-60.0, 7.0), "2": (420.0, 7.0)}
        pieces = [
            line("east", "abcdefgh", places, oneway=True), line("west", "hGFEDCBa", places, oneway=True),
            line("before", "1a", places), line("after", "h2", places),
        ]  # fmt: skip
    joined = join(pieces)
    assert not joined.closed
    assert set(joined.off) == {"other carriageway"}
    assert joined.length_m == pytest.approx(350.0 if not joined_at_the_ends else 350.0 + 60.4 + 70.3, abs=0.2)


def test_a_dual_carriageway_joined_at_one_end_is_no_hairpin() -> None:
    places = ROW | {name.upper(): (x, 15.0) for name, (x, _) in ROW.items()} | {"2": (520.0, 7.0)}
    pieces = [
        line("east", "abcdefgh", places, oneway=True), line("west", "hGFEDCBA", places, oneway=True),
        line("after", "h2", places),
    ]  # fmt: skip
    joined = join(pieces)
    assert "".join(map(str, joined.nodes)) in ("abcdefgh2", "2hGFEDCBA")
    assert set(joined.off) == {"other carriageway"}


def test_a_hairpin_that_runs_both_ways_is_a_road() -> None:
    places = ROW | {name.upper(): (x, 15.0) for name, (x, _) in ROW.items()}
    joined = join([line("up", "abcdefgh", places), line("down", "hGFEDCBA", places)])
    assert len(joined.nodes) == 15
    assert joined.off == {}


def test_a_stretch_that_comes_twice_counts_once() -> None:
    joined = join([line("1", "abcd", ROW), line("2", "dcb", ROW)])
    assert (joined.length_m, joined.named_m, joined.repeated) == (150.0, 150.0, 2)


def test_what_is_no_line() -> None:
    with pytest.raises(InputError, match="no two vertices"):
        join([])
    with pytest.raises(InputError, match="no two vertices"):
        join([line("1", "aa", ROW)])
    grid = [(x, y) for x in range(25) for y in range(25)]
    net = [
        Polyline(f"{x},{y}", ((x, y), (x + dx, y + dy)), np.array([[x, y], [x + dx, y + dy]], dtype=float))
        for x, y in grid
        for dx, dy in ((1, 0), (0, 1))
    ]
    with pytest.raises(InputError, match="a net of"):
        join(net)


@pytest.mark.parametrize("seed", range(20))
def test_cutting_turning_and_shuffling_a_line_changes_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(5, 60))
    points = np.cumsum(rng.normal([4.0, 0.0], 2.0, (count, 2)), axis=0)
    cuts = [0, *sorted(rng.choice(np.arange(1, count - 1), 3, replace=False)), count - 1]
    pieces = []
    for k, (start, end) in enumerate(pairwise(cuts)):
        turn = -1 if rng.random() < 0.5 else 1
        nodes = tuple(range(start, end + 1))[::turn]
        pieces.append(Polyline(str(k), nodes, points[list(nodes)]))
    rng.shuffle(pieces)  # type: ignore[arg-type]
    joined = join(pieces)
    assert list(joined.nodes) in (list(range(count)), list(range(count))[::-1])
    np.testing.assert_array_equal(joined.points_m, points[list(joined.nodes)])
    assert joined.length_m == pytest.approx(np.hypot(*np.diff(points, axis=0).T).sum())


def test_nearest_on_a_line() -> None:
    corner = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]])
    distance, at = nearest_on(corner, np.array([[5.0, 2.0], [13.0, -4.0], [9.0, 30.0]]))
    np.testing.assert_allclose(distance, [2.0, 5.0, np.hypot(1.0, 20.0)])
    np.testing.assert_allclose(at, [5.0, 10.0, 20.0])
