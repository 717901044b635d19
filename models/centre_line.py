"""Coordinates along and across a road's centre line: progress s (m) and offset d (m, positive to the left).

The line is the map's polyline; its direction runs linearly between the vertices, so that every position near the
road has one foot point: position = p(s) + d·n(s), there and back without a gap at the vertices.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError
from scpf.models.geodesy import wrap_angle

Array = NDArray[np.float64]

STRAIGHT_ON_M: Final = 1e5
"""An open line goes straight on so far beyond either end."""
LEAST_STRETCH: Final = 0.2
"""Nearer than this to the centre of the line's curvature, relative to the radius, coordinates end."""
ROUNDS: Final = 30
CLOSE_ENOUGH_M: Final = 1e-10


class Place(NamedTuple):
    """The line at N progresses: ``points_m`` (N, 2), ``direction_rad`` (N,; unwrapped), ``curvature_pm`` (N,)."""

    points_m: Array
    direction_rad: Array
    curvature_pm: Array

    @property
    def ahead(self) -> Array:
        """Unit vectors (N, 2) along the line."""
        return np.column_stack([np.cos(self.direction_rad), np.sin(self.direction_rad)])

    @property
    def left(self) -> Array:
        """Unit vectors (N, 2) across the line."""
        return np.column_stack([-np.sin(self.direction_rad), np.cos(self.direction_rad)])

    def stretch(self, offset_m: Array) -> Array:
        """Path length (N,) beside the line, at ``offset_m`` (N,), for a metre of progress on it."""
        return np.maximum(1.0 - self.curvature_pm * offset_m, LEAST_STRETCH)


class CentreLine:
    """A centre line (M, 2) in m of the ``map`` frame; closed where its last vertex is the first.

    InputError where it has no two vertices that differ. Progress counts on from lap to lap on a closed line.
    """

    def __init__(self, line_m: Array) -> None:
        line = np.asarray(line_m, dtype=float).reshape(-1, 2)
        if len(line):
            line = line[np.append(True, np.hypot(*np.diff(line, axis=0).T) > 1e-6)]
        if len(line) < 2:
            raise InputError("the centre line has no length", "give a line of at least two vertices")
        self.closed = len(line) > 3 and bool(np.allclose(line[0], line[-1]))
        chord = np.diff(line, axis=0)
        step = np.hypot(*chord.T)
        # The tangent at a vertex: of the two chords, the shorter one knows more about it.
        before, after = (chord[-1:], chord[:1]) if self.closed else (chord[:1], chord[-1:])
        came, goes = np.vstack([before, chord]), np.vstack([chord, after])
        came_m, goes_m = np.hypot(*came.T)[:, None], np.hypot(*goes.T)[:, None]
        tangent = came / came_m * goes_m + goes / goes_m * came_m
        direction = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
        start_m = 0.0
        if not self.closed:
            out = np.column_stack([np.cos(direction), np.sin(direction)]) * STRAIGHT_ON_M
            line = np.vstack([line[0] - out[0], line, line[-1] + out[-1]])
            direction = np.concatenate([direction[:1], direction, direction[-1:]])
            step = np.concatenate([[STRAIGHT_ON_M], step, [STRAIGHT_ON_M]])
            start_m = -STRAIGHT_ON_M
        self._line = line
        self._direction = direction
        self._progress = start_m + np.concatenate([[0.0], np.cumsum(step)])
        self._curvature = np.diff(direction) / step
        self.length_m = float(step.sum()) - (0.0 if self.closed else 2 * STRAIGHT_ON_M)
        self._turned = float(direction[-1] - direction[0]) if self.closed else 0.0

    def at(self, progress_m: Array) -> Place:
        """The line at progresses (N,)."""
        laps = np.floor(progress_m / self.length_m) if self.closed else np.zeros(len(progress_m))
        within = progress_m - laps * self.length_m
        k = np.clip(np.searchsorted(self._progress, within, side="right") - 1, 0, len(self._curvature) - 1)
        beyond = within - self._progress[k]
        share = (beyond / (self._progress[k + 1] - self._progress[k]))[:, None]
        points = self._line[k] + share * (self._line[k + 1] - self._line[k])
        direction = self._direction[k] + beyond * self._curvature[k] + laps * self._turned
        return Place(points, direction, self._curvature[k])

    def project(self, positions_m: Array, near_m: Array) -> tuple[Array, Array, Place]:
        """Progress (N,) and offset (N,) of positions (N, 2), and the line there.

        ``near_m`` (N,) is the progress to start from: where a road passes itself, it says which stretch is meant.
        """
        progress = np.asarray(near_m, dtype=float).copy()
        for _ in range(ROUNDS):
            place = self.at(progress)
            off = positions_m - place.points_m
            offset = (off * place.left).sum(1)
            step = (off * place.ahead).sum(1) / place.stretch(offset)
            progress += step
            if np.abs(step).max(initial=0.0) < CLOSE_ENOUGH_M:
                break
        place = self.at(progress)
        offset = ((positions_m - place.points_m) * place.left).sum(1)
        return progress, offset, place

    def nearest(self, position_m: Array) -> float:
        """The progress of the vertex nearest to a position (2,): where to start a projection from."""
        inner = slice(None) if self.closed else slice(1, -1)
        off = self._line[inner] - position_m
        return float(self._progress[inner][np.argmin((off**2).sum(1))])

    def heading_near(self, heading_rad: Array, place: Place) -> Array:
        """The line's direction (N,), or the opposite one, whichever is closer to ``heading_rad`` (N,); unwrapped."""
        off = np.asarray(heading_rad) - place.direction_rad
        against = np.abs(wrap_angle(off)) > np.pi / 2
        turns = np.round((off - np.pi * against) / (2 * np.pi))
        heading: Array = place.direction_rad + np.pi * against + 2 * np.pi * turns
        return heading
