"""Parts of one pole that grouping took for instances of their own: one above the other, in one line.

A pole that fills the picture, or that leaves hide in its middle, may show several peaks of the centre map. Poles
stand side by side, so what continues upwards where another part ends is the same pole; and so are two peaks one above
the other with nothing but pole between them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]

MOST_SHARED_HEIGHT = 0.2  # of the shorter part's rows: what stands side by side for longer is two poles
MOST_GAP = 1.0  # rows between two parts, as a share of the rows that the taller one has
END_SHARE = 0.2  # of a part's rows, the least of `LEAST_END_ROWS`: where it is compared with the next
LEAST_END_ROWS = 6
LEAST_TOLERANCE_PX = 4.0
LEAN = 0.06  # px sideways per row of the gap: poles lean, and lenses bend
MOST_WIDTH_RATIO = 2.5
LEAST_RISE = 3.0  # rows per column from one peak to another above it
LEAST_COVERED = 0.95  # share of the way between them that is pole
CRUMB = 0.08  # of the other part's pixels: the width of so few says nothing

Floats = NDArray[np.floating[Any]]


class _Part(NamedTuple):
    """Number of pixels, first and last row, mean width, and (column, width) at either end, in px."""

    pixels: int
    first: int
    last: int
    width: float
    top: tuple[float, float]
    bottom: tuple[float, float]


def join(
    mask: NDArray[np.bool_], peaks_px: Floats, y: Indices, x: Indices, owner: NDArray[np.int16]
) -> NDArray[np.int16]:
    """The owner (N,) of each pixel (y, x) of ``mask`` (H, W) after parts of one pole were given to the first of them.

    ``owner``: a row of ``peaks_px`` (K, 2: x, y), or -1 for nobody's, which stays.
    """
    count = len(peaks_px)
    parts = [_part(y[own], x[own]) if (own := owner == i).any() else None for i in range(count)]
    heirs = np.arange(count, dtype=np.int16)
    for i, part in enumerate(parts):
        for k in range(i):
            other = parts[k]
            if part is None or other is None or heirs[k] == heirs[i]:
                continue
            if _continues(part, other) or (
                (_alike(part.width, other.width) or _crumb(part, other))
                and _pole_between(mask, peaks_px[i], peaks_px[k])
            ):
                first, second = sorted((heirs[k], heirs[i]))
                heirs[heirs == second] = first
    return np.where(owner >= 0, heirs[np.maximum(owner, 0)], owner)


def _pole_between(mask: NDArray[np.bool_], a_px: Floats, b_px: Floats) -> bool:
    """Whether the straight way from one peak up to another lies on pole."""
    (xa, ya), (xb, yb) = a_px, b_px
    if abs(yb - ya) < LEAST_RISE * abs(xb - xa):
        return False
    steps = np.linspace(0.0, 1.0, int(abs(yb - ya)) + 1)
    rows = np.minimum((ya + steps * (yb - ya)).astype(int), mask.shape[0] - 1)
    columns = np.minimum((xa + steps * (xb - xa)).astype(int), mask.shape[1] - 1)
    return bool(mask[rows, columns].mean() >= LEAST_COVERED)


def _part(y: Indices, x: Indices) -> _Part:
    first, last = int(y.min()), int(y.max())
    rows = max(LEAST_END_ROWS, round(END_SHARE * (last + 1 - first)))
    width = len(y) / len(np.unique(y))
    return _Part(
        len(y), first, last, width, _end(y, x, first, first + rows), _end(y, x, last + 1 - rows, last + 1)
    )


def _end(y: Indices, x: Indices, first: int, stop: int) -> tuple[float, float]:
    """Median column, and mean number of pixels in a row, from row ``first`` to ``stop``."""
    within = (y >= first) & (y < stop)
    return float(np.median(x[within])), np.count_nonzero(within) / len(np.unique(y[within]))


def _continues(a: _Part, b: _Part) -> bool:
    upper, lower = (a, b) if a.first + a.last < b.first + b.last else (b, a)
    heights = [part.last + 1 - part.first for part in (upper, lower)]
    gap = lower.first - upper.last - 1
    if -gap > MOST_SHARED_HEIGHT * min(heights) or gap > MOST_GAP * max(heights):
        return False
    (column, width), (next_column, next_width) = upper.bottom, lower.top
    tolerance = max(LEAST_TOLERANCE_PX, width / 2, next_width / 2) + LEAN * max(gap, 0)
    return _alike(width, next_width) and abs(column - next_column) <= tolerance


def _alike(width: float, other: float) -> bool:
    return max(width, other) <= MOST_WIDTH_RATIO * min(width, other)


def _crumb(a: _Part, b: _Part) -> bool:
    return min(a.pixels, b.pixels) <= CRUMB * max(a.pixels, b.pixels)
