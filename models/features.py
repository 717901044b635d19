"""Features of an instance: the numbers from which its distance is predicted.

The paper uses the box (x1, x2, y1, y2, px) and the pole's thickness in the central part of its box (px,
from the mask). A feature is a function of a frame's instances in the table ``FEATURES``; a new one (lamp
present, base row, …) is one more entry there and can then be named in ``DistanceSettings``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError
from scpf.models.instances import BoolMask, Instance

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

CENTRAL_SHARE: Final = 0.2
"""The share of the box's rows, about its middle, over which the thickness is measured (the paper: "central
part").
"""

TILT_SHARE: Final = 0.5
"""The share of the rows that the tilt is taken from: more than for the thickness, since a slope needs
length.
"""

EDGE_PX: Final = 1.0
"""A box that comes this near to the image's edge is taken to go on beyond it."""

MIN_HEIGHT_PX: Final = 12.0
"""Lower boxes hold too few rows to measure a thickness in."""


@dataclass(frozen=True, eq=False)
class Features:
    """Features of N instances.

    ``names`` (F,) name the columns of ``values`` (N, F), px. ``cut`` (N,): the box touches the image's edge.
    ``too_small`` (N,): too low, or without a measurable thickness; such an instance gets no distance.
    """

    names: tuple[str, ...]
    values: Array
    cut: Flags
    too_small: Flags

    def __len__(self) -> int:
        return len(self.values)

    def columns(self, names: Sequence[str]) -> Array:
        """The named columns (N, len(names)), in the order asked for."""
        return self.values[:, [self.names.index(name) for name in names]]

    def rows(self, which: NDArray[np.intp] | Flags) -> Features:
        """The instances that ``which`` (indices or flags) selects."""
        return Features(self.names, self.values[which], self.cut[which], self.too_small[which])


def thickness_px(instance: Instance) -> float:
    """Thickness of the pole across its axis (px) in the central part of its box; NaN where it has no pixel.

    Each row counts with its main run: the one nearest to the column where most rows have theirs, so that an
    arm or a lamp beside the pole adds nothing. The widths are averaged over the rows that agree with their
    median within a pixel or a quarter: as robust as the median, but it keeps fractions of a pixel, which
    matter for poles three pixels wide. The horizontal width times the cosine of the tilt is the thickness.
    """
    first, last = _middle_rows(instance, TILT_SHARE)
    row, left, right = _main_runs(instance.mask[first:last])
    start, end = _middle_rows(instance, CENTRAL_SHARE)
    central = (row >= start - first) & (row < end - first)
    if not central.any():
        return float("nan")
    widths = (right - left)[central].astype(np.float64)
    middle = float(np.median(widths))
    alike = widths[np.abs(widths - middle) <= max(1.0, 0.25 * middle)]
    width = float(alike.mean()) if len(alike) else middle  # two rows that differ much agree with no median
    centre = np.asarray(0.5 * (left + right), dtype=np.float64)
    return width / float(np.hypot(1.0, _slope(row, centre)))


def _middle_rows(instance: Instance, share: float) -> tuple[int, int]:
    """First row of the mask, and one past the last, within ``share`` of the box's height about its middle."""
    y1, y2 = instance.box_px[1], instance.box_px[3]
    middle, half = 0.5 * (y1 + y2) - instance.offset_px[1], 0.5 * share * (y2 - y1)
    first = max(int(np.floor(middle - half)), 0)
    return first, max(int(np.ceil(middle + half)), first + 1)


def _main_runs(rows: BoolMask) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Row, first column, and one past the last, (R,) of the main run of each row that has any pixel."""
    row = np.flatnonzero(rows.any(axis=1))
    if not len(row):
        return row, row, row
    used = rows[row]
    left, right = used.argmax(axis=1), rows.shape[1] - used[:, ::-1].argmax(axis=1)
    split = np.count_nonzero(used, axis=1) < right - left
    if split.any():
        centre = 0.5 * (left + right)
        column = float(np.median(centre[~split] if not split.all() else centre))
        for k in np.flatnonzero(split):
            padded = np.concatenate(([False], used[k], [False]))
            edges = np.flatnonzero(padded[1:] != padded[:-1])
            starts, ends = edges[::2], edges[1::2]
            nearest = int(np.argmin(np.abs(0.5 * (starts + ends) - column)))
            left[k], right[k] = starts[nearest], ends[nearest]
    return row, left, right


def _slope(row: NDArray[np.intp], centre: Array) -> float:
    """Columns per row by which the pole leans: between the medians of the upper and of the lower rows."""
    half = len(row) // 2
    if half < 2:
        return 0.0
    across = np.median(centre[-half:]) - np.median(centre[:half])
    return float(across / (np.median(row[-half:]) - np.median(row[:half])))


def _box(side: int) -> Callable[[Sequence[Instance]], Array]:
    return lambda instances: np.array([each.box_px[side] for each in instances], dtype=np.float64)


def _thicknesses(instances: Sequence[Instance]) -> Array:
    return np.array([thickness_px(each) for each in instances], dtype=np.float64)


FEATURES: Final[dict[str, Callable[[Sequence[Instance]], Array]]] = {
    "x1": _box(0),
    "x2": _box(2),
    "y1": _box(1),
    "y2": _box(3),
    "thickness": _thicknesses,
}
"""Every feature by its name: from a frame's instances (N) to its values (N,), px."""

# A feature scales with the image unless it is named here (a later one that is a flag or a ratio has to be).
UNSCALED: Final[frozenset[str]] = frozenset()


def measure(instances: Sequence[Instance], image_width_px: int, image_height_px: int) -> Features:
    """All features of a frame's instances (N, possibly 0) in an image of this size."""
    boxes = np.array([each.box_px for each in instances], dtype=np.float64).reshape(-1, 4)
    values = np.column_stack([feature(instances) for feature in FEATURES.values()])
    limits = np.array([EDGE_PX, EDGE_PX, image_width_px - EDGE_PX, image_height_px - EDGE_PX])
    cut = np.any(boxes[:, :2] <= limits[:2], axis=1) | np.any(boxes[:, 2:] >= limits[2:], axis=1)
    low = boxes[:, 3] - boxes[:, 1] < MIN_HEIGHT_PX
    return Features(tuple(FEATURES), values, cut, low | ~np.all(np.isfinite(values), axis=1))


def check_names(names: Sequence[str]) -> None:
    """InputError where a name is not in ``FEATURES``."""
    unknown = [name for name in names if name not in FEATURES]
    if unknown or not names:
        raise InputError(f"features {list(names)}: unknown {unknown}", f"known: {', '.join(FEATURES)}")
