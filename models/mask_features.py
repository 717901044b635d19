"""Features that a pole's mask gives: its thickness as in the paper, its axis, its widths, and its lamp."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import ceil, floor, isnan
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models import mask_kernels
from scpf.models.instances import Instance

Array = NDArray[np.float64]

CENTRAL_SHARE: Final = 0.2
"""The share of the box's rows, about its middle, over which the thickness is measured (the paper: "central
part").
"""

TILT_SHARE: Final = 0.5
"""The share of the rows that the tilt is taken from: more than for the thickness, since a slope needs
length.
"""

Line = tuple[float, float, float, float, float]


@dataclass(frozen=True, eq=False)
class Masks:
    """The masks of N instances; what is measured once is kept for the features that share it."""

    instances: Sequence[Instance]
    _lines: list[Line] = field(default_factory=list)
    _axes: list[Array] = field(default_factory=list)

    def lines(self) -> list[Line]:
        """What ``mask_kernels.thickness`` finds in each mask."""
        if not self._lines:
            self._lines.extend(_line(each) for each in self.instances)
        return self._lines

    def axes(self) -> Array:
        """What ``mask_kernels.axis`` finds in each mask, (N, 9); rows of NaN where there is no thickness."""
        if not self._axes:
            self._axes.extend(
                _axis(each, line) for each, line in zip(self.instances, self.lines(), strict=True)
            )
        return np.array(self._axes).reshape(len(self.instances), -1)


def thickness_px(instance: Instance) -> float:
    """Thickness of the pole across its axis (px) in the central part of its box; NaN where it has no pixel.

    Each row counts with its main run: the one nearest to the column where most rows have theirs, so that an
    arm or a lamp beside the pole adds nothing. The widths are averaged over the rows that agree with their
    median within a pixel or a quarter: as robust as the median, but it keeps fractions of a pixel, which
    matter for poles three pixels wide. The horizontal width times the cosine of the tilt is the thickness.
    """
    return _line(instance)[0]


def thicknesses(masks: Masks) -> Array:
    """``thickness_px`` of each instance (N,)."""
    return np.array([line[0] for line in masks.lines()])


def base_rows(masks: Masks) -> Array:
    """Where the pole's axis ends below (N,): one past its last row, px of the full image, as y2 is."""
    tops = np.array([each.offset_px[1] for each in masks.instances], dtype=np.float64)
    return tops + _column(mask_kernels.BASE_ROW)(masks)


def tilts(masks: Masks) -> Array:
    """The axis' angle from upright (N,), rad; positive where its foot lies right of its top."""
    return np.arctan(_column(mask_kernels.SLOPE)(masks))


def _column(which: int) -> Callable[[Masks], Array]:
    def values(masks: Masks) -> Array:
        return masks.axes()[:, which] if masks.instances else np.zeros(0)

    return values


MASK_FEATURES: Final[dict[str, Callable[[Masks], Array]]] = {
    "thickness": thicknesses,
    "lamp": _column(mask_kernels.LAMP),
    "base_row": base_rows,
    "axis_length": _column(mask_kernels.LENGTH),
    "tilt": tilts,
    "mean_width": _column(mask_kernels.MEAN_WIDTH),
    **{
        f"width_{100 * height:.0f}": _column(mask_kernels.WIDTHS + k)
        for k, height in enumerate(mask_kernels.WIDTH_HEIGHTS)
    },
}
"""Features by name, N values each: px, but for ``lamp`` (1 where one reaches out in the upper quarter of the
mask, else 0) and ``tilt`` (rad). ``mean_width``: the thickness over the whole axis, ``width_P`` at P % of its
height. All are finite where the thickness is.
"""


def _line(instance: Instance) -> Line:
    first, last = _middle_rows(instance, TILT_SHARE)
    start, end = _middle_rows(instance, CENTRAL_SHARE)
    return mask_kernels.thickness(_pixels(instance), first, last, start, end)


def _axis(instance: Instance, line: Line) -> Array:
    if isnan(line[0]):
        return np.full(mask_kernels.WIDTHS + len(mask_kernels.WIDTH_HEIGHTS), np.nan)
    return mask_kernels.axis(_pixels(instance), *line[1:])


def _pixels(instance: Instance) -> NDArray[np.uint8]:
    return np.ascontiguousarray(instance.mask).view(np.uint8)


def _middle_rows(instance: Instance, share: float) -> tuple[int, int]:
    """First row of the mask, and one past the last, within ``share`` of the box's height about its middle."""
    y1, y2 = instance.box_px[1], instance.box_px[3]
    middle, half = 0.5 * (y1 + y2) - instance.offset_px[1], 0.5 * share * (y2 - y1)
    first = max(floor(middle - half), 0)
    return first, max(ceil(middle + half), first + 1)
