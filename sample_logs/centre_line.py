"""The line along which a simulated bus drives: a smooth curve through a road map's points, measured by arc length."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree

from scpf.models.errors import InputError

Array = NDArray[np.float64]

SPACING_M: Final = 1.0
SMOOTHING_M: Final = 5.0
"""Standard deviation of the smoothing along the line: mapped roads are polygons, driven ones are not."""
SHORTEST_M: Final = 30.0


class CentreLine:
    """A smooth centre line in map, ``length_m`` long; a ``closed`` one goes round, and takes any length.

    On an open line, positions before its start and past its end lie on its tangents there.
    """

    def __init__(self, points_m: ArrayLike, closed: bool = False) -> None:
        """``points_m`` (N, 2): the line's points in order; a closed line's last point need not repeat its first."""
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
        if not np.isfinite(points).all():
            raise InputError("a centre line with a point that is no number")
        points = points[np.r_[True, np.hypot(*np.diff(points, axis=0).T) > 1e-6]]
        if closed and len(points) > 1 and np.hypot(*(points[0] - points[-1])) > 1e-6:
            points = np.vstack([points, points[:1]])
        along = _lengths(points)
        if along[-1] < SHORTEST_M:
            hint = f"a drive needs at least {SHORTEST_M:.0f} m of road"
            raise InputError(f"a centre line of {along[-1]:.1f} m", hint)
        self.closed = closed
        grid = np.linspace(0.0, along[-1], round(along[-1] / SPACING_M) + 1)
        even = np.column_stack([np.interp(grid, along, points[:, k]) for k in (0, 1)])
        smooth = _smoothed(even, closed)
        lengths = _lengths(smooth)
        ends = "periodic" if closed else "natural"
        for _ in range(2):  # chords are shorter than the curve between them: measure along the curve
            curve = CubicSpline(lengths, smooth, bc_type=ends)
            fine = np.linspace(0.0, lengths[-1], 8 * len(lengths) + 1)
            lengths = np.interp(lengths, fine, _lengths(curve(fine)))
        self._curve = CubicSpline(lengths, smooth, bc_type=ends)
        self.length_m = float(lengths[-1])
        self._fine_m = np.linspace(0.0, self.length_m, 4 * len(lengths) + 1)
        self._tree = cKDTree(self._curve(self._fine_m))

    def at(self, s_m: ArrayLike, offset_m: ArrayLike = 0.0) -> tuple[Array, Array, Array]:
        """The point ``offset_m`` to the left of the line at ``s_m`` along it.

        Position (..., 3) on the plane z = 0, and the line's unit tangent (..., 2) and unit normal (..., 2), which
        points to the left; (...) is the shape of ``s_m`` and ``offset_m`` together.
        """
        s, offset = np.broadcast_arrays(np.asarray(s_m, np.float64), np.asarray(offset_m, np.float64))
        on_line, beyond = self._on_line(s)
        tangent = self._curve(on_line, 1)
        tangent = tangent / np.linalg.norm(tangent, axis=-1, keepdims=True)
        normal = np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1)
        flat = self._curve(on_line) + beyond[..., None] * tangent + offset[..., None] * normal
        position = np.concatenate([flat, np.zeros((*s.shape, 1))], axis=-1)
        return position, tangent, normal

    def curvature_per_m(self, s_m: ArrayLike) -> Array:
        """Curvature (...) in 1/m at ``s_m`` along the line, positive to the left."""
        on_line, beyond = self._on_line(np.asarray(s_m, np.float64))
        first, second = self._curve(on_line, 1), self._curve(on_line, 2)
        cross = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
        curvature: Array = np.where(beyond == 0.0, cross / np.linalg.norm(first, axis=-1) ** 3, 0.0)
        return curvature

    def project(self, points_m: ArrayLike) -> tuple[Array, Array]:
        """Lengths along the line (N,) and offsets to the left of it (N,) of points (N, 2), to a few millimetres."""
        points = np.asarray(points_m, np.float64).reshape(-1, 2)
        s = self._fine_m[self._tree.query(points)[1]]
        for _ in range(3):  # Newton's steps along the tangent
            position, tangent, normal = self.at(s)
            off = points - position[:, :2]
            s = s + np.einsum("ij,ij->i", off, tangent)
        position, _, normal = self.at(s)
        offset: Array = np.einsum("ij,ij->i", points - position[:, :2], normal)
        return (s % self.length_m if self.closed else s), offset

    def distance_m(self, points_m: ArrayLike) -> Array:
        """Distances (N,) of points (N, 2) from the line; an open one is taken to go on straight."""
        distance: Array = np.abs(self.project(points_m)[1])
        return distance

    def _on_line(self, s_m: Array) -> tuple[Array, Array]:
        """Where on the curve ``s_m`` lies, and how far beyond an open line's end."""
        if self.closed:
            return s_m % self.length_m, np.zeros_like(s_m)
        on_line = np.clip(s_m, 0.0, self.length_m)
        return on_line, s_m - on_line


def _lengths(points_m: Array) -> Array:
    """Length along the polygon (N,) up to each of its points (N, 2)."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points_m, axis=0).T))])


def _smoothed(points_m: Array, closed: bool) -> Array:
    """Evenly spaced points (N, 2) smoothed along the line; an open line's ends stay where they are."""
    sigma = SMOOTHING_M / SPACING_M
    if closed:
        ring: Array = gaussian_filter1d(points_m[:-1], sigma, axis=0, mode="wrap")
        return np.vstack([ring, ring[:1]])
    straight = np.linspace(points_m[0], points_m[-1], len(points_m))
    # Odd reflection about the ends: the deviation from the chord is 0 there, before and after.
    off = points_m - straight
    padded = np.vstack([-off[:0:-1], off, -off[-2::-1]])
    smooth: Array = gaussian_filter1d(padded, sigma, axis=0)[len(off) - 1 : 2 * len(off) - 1]
    return straight + smooth
