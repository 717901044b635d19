"""Compiled loops over the rows of a pole's mask: its thickness, its axis, and its width along the axis.

Rows and columns count from the crop's upper left pixel. A row may hold several runs of pixels (an arm, a lamp,
a hole); the one that counts as the pole is its main run.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]
"""A mask (h, w), row by row: 0 or 1."""

F = TypeVar("F", bound=Callable[..., Any])

WIDTH_HEIGHTS: Final = (0.15, 0.35, 0.65, 0.85)
"""Heights above the base, as shares of the axis, at which the width is measured …"""

WIDTH_REACH: Final = 0.1
"""… each over the rows this share above and below."""

LAMP_ROWS: Final = 0.25
"""The upper share of the mask's rows in which a lamp or its arm is looked for."""

BASE_ROW: Final = 0
LENGTH: Final = 1
SLOPE: Final = 2
LAMP: Final = 3
MEAN_WIDTH: Final = 4
WIDTHS: Final = 5
"""Places in what ``axis`` returns; the widths at ``WIDTH_HEIGHTS`` begin at the last."""


def _kernel(function: F) -> F:
    # Not ``compiled.kernel``: its fast mathematics assumes that no value is NaN.
    return cast(F, numba.njit(cache=True)(function))


@_kernel
def _extent(line: Any) -> tuple[int, int, bool]:
    """First pixel, one past the last, and whether there is a gap between; one past is 0 in an empty row."""
    # Without branches, in 32 bits: the compiler makes vectors of it, five times as fast.
    n = np.int32(line.size)
    first, end, count = n, np.int32(0), np.int32(0)
    for column in range(n):
        pixel = line[column]
        first = min(first, np.int32(column) if pixel else n)
        end = max(end, np.int32(column + 1) if pixel else np.int32(0))
        count += np.int32(pixel)
    return int(first), int(end), bool(count < end - first)


@_kernel
def _main_run(line: Any, column: float) -> tuple[int, int]:
    """First pixel, and one past the last, of the run whose middle is nearest to ``column``; (0, 0) for none."""
    left, right, gap = _extent(line)
    if right == 0:
        return 0, 0
    if not gap:
        return left, right
    best, start = np.inf, -1
    for k in range(line.size + 1):
        here = k < line.size and line[k] != 0
        if here and start < 0:
            start = k
        elif not here and start >= 0:
            off = abs(0.5 * (start + k) - column)
            if off < best:
                best, left, right = off, start, k
            start = -1
    return left, right


@_kernel
def thickness(
    mask: Pixels, first: int, last: int, start: int, end: int
) -> tuple[float, float, float, float, float]:
    """Thickness across the axis (px) and, for ``axis``, horizontal width, a row, its centre, and the slope.

    ``first``, ``last``: rows that the slope (columns a row) is taken from; ``start``, ``end``: those in which
    the width is measured. All NaN where the latter hold no pixel. The method: ``mask_features.thickness_px``.
    """
    rows = np.empty(last - first, dtype=np.float64)
    left, right = np.empty_like(rows), np.empty_like(rows)
    split = np.zeros(rows.size, dtype=np.bool_)
    n = 0
    for row in range(first, min(last, mask.shape[0])):
        one, other, gap = _extent(mask[row])
        if other > 0:
            rows[n], left[n], right[n], split[n] = row, one, other, gap
            n += 1
    rows, left, right, split = rows[:n], left[:n], right[:n], split[:n]
    if split.any():
        centre = 0.5 * (left + right)
        column = np.median(centre if split.all() else centre[~split])
        for k in range(n):
            if split[k]:
                left[k], right[k] = _main_run(mask[int(rows[k])], column)
    central = (rows >= start) & (rows < end)
    if not central.any():
        return np.nan, np.nan, np.nan, np.nan, np.nan
    widths = (right - left)[central]
    middle = np.median(widths)
    alike = widths[np.abs(widths - middle) <= max(1.0, 0.25 * middle)]
    width = alike.mean() if alike.size else middle  # two rows that differ much agree with no median
    centre = 0.5 * (left + right)
    slope, half = 0.0, n // 2
    if half >= 2:
        across = np.median(centre[n - half :]) - np.median(centre[:half])
        slope = across / (np.median(rows[n - half :]) - np.median(rows[:half]))
    return width / np.hypot(1.0, slope), width, np.median(rows), np.median(centre), slope


@_kernel
def axis(mask: Pixels, width: float, row: float, column: float, slope: float) -> Array:
    """The pole's axis, from the line that ``thickness`` found in its middle (never NaN where that is not).

    (9,): one past the axis' last row, its length (px), its slope (columns a row), whether a lamp is there (0 or
    1), the mean thickness over the axis, and that at each of ``WIDTH_HEIGHTS``.

    A row belongs to the axis where the run nearest to it is centred on it, and to the widths where it is also
    about as wide as the pole in its middle: a base plate is the first, not the second, a bent arm is neither.
    """
    found = np.empty(WIDTHS + len(WIDTH_HEIGHTS))
    n = mask.shape[0]
    centres, widths = np.full(n, np.nan), np.full(n, np.nan)
    near = max(2.0, width)
    alike = max(1.5, 0.4 * width)
    top, base, highest, lowest = -1, -1, -1, -1
    total = sum_r = sum_c = sum_rr = sum_rc = 0.0
    for k in range(n):
        expected = column + slope * (k - row)
        left, right = _main_run(mask[k], expected)
        if right == 0:
            continue
        highest = k if highest < 0 else highest
        lowest = k
        middle = 0.5 * (left + right)
        if abs(middle - expected) > near:
            continue
        top = k if top < 0 else top
        base = k
        if abs(right - left - width) > alike:
            continue
        widths[k] = right - left
        centres[k] = middle
        r, c = k - row, middle - column
        total += 1.0
        sum_r += r
        sum_c += c
        sum_rr += r * r
        sum_rc += r * c
    if top < 0:  # no row lies on the line, as in a mask of scattered pixels: all that is known is its extent
        top, base = highest, lowest
    spread = total * sum_rr - sum_r * sum_r
    if spread > 0.0 and total >= 4.0:
        slope, column = (
            (total * sum_rc - sum_r * sum_c) / spread,
            column + (sum_c * sum_rr - sum_r * sum_rc) / spread,
        )
    across = 1.0 / np.hypot(1.0, slope)
    found[BASE_ROW], found[LENGTH], found[SLOPE] = base + 1.0, (base + 1.0 - top) / across, slope
    lamp = False
    for k in range(highest, highest + int(LAMP_ROWS * (lowest + 1 - highest))):
        one, other, _ = _extent(mask[k])
        expected = column + slope * (k - row)
        beyond = max(expected - one, other - expected) - 0.5 * width
        lamp = lamp or (other > 0 and beyond > max(1.5 * width, 3.0))
    found[LAMP] = 1.0 if lamp else 0.0
    measured = ~np.isnan(widths)
    found[MEAN_WIDTH] = across * (widths[measured].mean() if measured.any() else width)
    for j in range(len(WIDTH_HEIGHTS)):
        middle = base + 0.5 - WIDTH_HEIGHTS[j] * (base + 1 - top)
        reach = WIDTH_REACH * (base + 1 - top)
        part = widths[max(int(middle - reach), 0) : int(middle + reach) + 1]
        part = part[~np.isnan(part)]
        found[WIDTHS + j] = across * part.mean() if part.size else found[MEAN_WIDTH]
    return found
