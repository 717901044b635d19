"""Polygons into masks and back, in the coordinates of labelme and COCO: (0, 0) is the corner of the first pixel.

A pixel belongs to a polygon that holds its centre, by the even-odd rule. Drawing functions paint the boundary's pixels
as well (``cv2.fillPoly``, Pillow): a pole of four pixels would become one of five, and its distance a fifth too short.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from scpf.models.instances import BoolMask

Points = NDArray[np.float64]

MOST_POINTS = 100_000  # of one polygon
_ROWS_AT_ONCE = 1_000_000  # crossings of edges and rows held in memory


def fill(points_px: Points, width_px: int, height_px: int) -> tuple[BoolMask, tuple[int, int]]:
    """The mask of a polygon (N, 2) within a picture: a crop (h, w) bool and its upper left pixel (x, y).

    ``points_px``: x, y; the last joins the first. Empty (0, 0) where no pixel's centre of the picture lies inside.
    ValueError where points are fewer than 3, more than `MOST_POINTS`, or not finite.
    """
    points = np.asarray(points_px, dtype=np.float64)
    if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < 3:
        raise ValueError("a polygon has three points or more")
    if len(points) > MOST_POINTS:
        raise ValueError(f"a polygon of {len(points)} points, {MOST_POINTS} are the most")
    if not np.isfinite(points).all():
        raise ValueError("a point is not finite")
    # Clipping in x changes no crossing's side of any pixel of the picture; in y, rows are cut below.
    left, top = np.floor(np.clip(points.min(0), 0, (width_px, height_px))).astype(int).tolist()
    right, bottom = np.ceil(np.clip(points.max(0), 0, (width_px, height_px))).astype(int).tolist()
    if right <= left or bottom <= top:
        return np.zeros((0, 0), dtype=bool), (0, 0)
    toggles = np.zeros((bottom - top, right - left + 1), dtype=np.uint8)
    begin, end = points, np.roll(points, -1, axis=0)
    # Rows whose centre line an edge crosses: first to last, half open, so that a shared corner counts once.
    low, high = np.minimum(begin[:, 1], end[:, 1]), np.maximum(begin[:, 1], end[:, 1])
    first = np.clip(np.ceil(low - 0.5), top, bottom).astype(np.int64)
    last = np.clip(np.ceil(high - 0.5), top, bottom).astype(np.int64)
    edges = np.flatnonzero(last > first)
    parts = np.cumsum((last - first)[edges]) // _ROWS_AT_ONCE
    for part in np.split(edges, np.flatnonzero(np.diff(parts)) + 1) if len(edges) else []:
        count = (last - first)[part]
        edge = np.repeat(part, count)
        row = first[edge] + np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
        share = (row + 0.5 - begin[edge, 1]) / (end[edge, 1] - begin[edge, 1])
        x = begin[edge, 0] + share * (end[edge, 0] - begin[edge, 0])
        column = np.clip(np.ceil(x - 0.5), left, right).astype(np.int64)
        np.bitwise_xor.at(toggles, (row - top, column - left), np.uint8(1))
    inside = np.bitwise_xor.accumulate(toggles, axis=1)[:, :-1].astype(bool)
    rows, columns = np.flatnonzero(inside.any(1)), np.flatnonzero(inside.any(0))
    if not len(rows):
        return np.zeros((0, 0), dtype=bool), (0, 0)
    inside = inside[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].copy()
    return inside, (left + int(columns[0]), top + int(rows[0]))


def outlines(mask: BoolMask, offset_px: tuple[int, int] = (0, 0)) -> list[Points]:
    """Polygons (N, 2) along the outer edges of a mask's pixels, one for each part that hangs together by its sides.

    `fill` of each gives back the part exactly. A hole is cut out by a seam of no width from the part's outline.
    ``offset_px``: x, y of the mask's first pixel in the picture.
    """
    loops = _loops(np.pad(mask, 1))
    outer = [loop for loop in loops if _area(loop) > 0]
    holes = sorted((loop for loop in loops if _area(loop) < 0), key=lambda loop: int(loop[:, 0].min()))
    for hole in holes:
        _cut_out(hole, outer)
    shift = np.asarray(offset_px) - 1
    return [(_without_straight(loop) + shift).astype(np.float64) for loop in outer]


def _loops(padded: BoolMask) -> list[NDArray[np.int64]]:
    """Closed chains of corners (x, y) around the pixels, one pixel's side apart, the mask on their right."""
    onward: dict[tuple[int, int], list[tuple[int, int]]] = defaultdict(list)
    down, across = np.diff(padded.astype(np.int8), axis=0), np.diff(padded.astype(np.int8), axis=1)
    for y, x in np.argwhere(down == 1).tolist():  # the upper side of a pixel, walked to the right
        onward[x, y + 1].append((x + 1, y + 1))
    for y, x in np.argwhere(down == -1).tolist():
        onward[x + 1, y + 1].append((x, y + 1))
    for y, x in np.argwhere(across == -1).tolist():  # the right side, walked downwards
        onward[x + 1, y].append((x + 1, y + 1))
    for y, x in np.argwhere(across == 1).tolist():
        onward[x + 1, y + 1].append((x + 1, y))
    loops = []
    while onward:
        start = next(iter(onward))
        chain, here, direction = [start], start, (0, 0)
        while True:
            ways = onward[here]
            # Where two pixels touch at a corner, the turn to the right keeps them two parts.
            right = (here[0] - direction[1], here[1] + direction[0])
            there = ways.pop(ways.index(right) if len(ways) > 1 and right in ways else 0)
            if not ways:
                del onward[here]
            direction = (there[0] - here[0], there[1] - here[1])
            here = there
            if here == start:
                break
            chain.append(here)
        loops.append(np.array(chain, dtype=np.int64))
    return loops


def _area(loop: NDArray[np.int64]) -> int:
    """Twice the signed area; positive around pixels, negative around a hole (y grows downwards)."""
    x, y = loop.T
    return int((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def _cut_out(hole: NDArray[np.int64], outer: list[NDArray[np.int64]]) -> None:
    """Joins a hole to the outline on its left, out to it and back along the same line."""
    hole = np.roll(hole, -int(np.argmin(hole[:, 0])), axis=0)
    x, y = hole[0]
    nearest, joined, at = -1, 0, 0
    for i, loop in enumerate(outer):
        for k in np.flatnonzero((loop[:, 1] == y) & (loop[:, 0] < x)).tolist():
            if loop[k, 0] > nearest:
                nearest, joined, at = int(loop[k, 0]), i, k
    loop = outer[joined]
    outer[joined] = np.concatenate([loop[: at + 1], hole, hole[:1], loop[at:]])


def _without_straight(loop: NDArray[np.int64]) -> NDArray[np.int64]:
    """The loop without the corners at which it does not turn."""
    before, after = loop - np.roll(loop, 1, axis=0), np.roll(loop, -1, axis=0) - loop
    turns = before[:, 0] * after[:, 1] != before[:, 1] * after[:, 0]
    back = (before * after).sum(1) < 0  # the end of a seam
    return np.asarray(loop[turns | back])
