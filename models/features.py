"""Features of an instance: the numbers from which its distance is predicted.

The paper uses the box (x1, x2, y1, y2, px) and the pole's thickness in the central part of its box (px,
from the mask). A feature is a function of a frame in the table ``FEATURES``, and can be named in
``DistanceSettings``; those of the mask are in ``mask_features``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError
from scpf.models.instances import Instance
from scpf.models.mask_features import MASK_FEATURES, Masks

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

EDGE_PX: Final = 1.0
"""A box that comes this near to the image's edge is taken to go on beyond it."""

MIN_HEIGHT_PX: Final = 12.0
"""Lower boxes hold too few rows to measure a thickness in."""

BOX: Final = ("x1", "x2", "y1", "y2")


@dataclass(frozen=True, eq=False)
class Features:
    """Features of N instances.

    ``names`` (F,) name the columns of ``values`` (N, F): px, but for those in ``UNSCALED``. ``cut`` (N,): the
    box touches the image's edge. ``too_small`` (N,): too low, or a feature could not be measured; such an
    instance gets no distance.
    """

    names: tuple[str, ...]
    values: Array
    cut: Flags
    too_small: Flags

    def __len__(self) -> int:
        return len(self.values)

    def columns(self, names: Sequence[str]) -> Array:
        """The named columns (N, len(names)), in the order asked for."""
        return self.values.take([self.names.index(name) for name in names], axis=1)

    def rows(self, which: NDArray[np.intp] | Flags) -> Features:
        """The instances that ``which`` (indices or flags) selects."""
        return Features(self.names, self.values[which], self.cut[which], self.too_small[which])


@dataclass(frozen=True, eq=False)
class Frame:
    """N instances of an image: ``boxes`` (N, 4): x1, y1, x2, y2, px; ``cut`` (N, 4): which sides the edge cuts."""

    boxes: Array
    cut: Flags
    masks: Masks

    @property
    def any_cut(self) -> Flags:
        """(N,): whether any side is cut."""
        flags: Flags = np.any(self.cut, axis=1)
        return flags


def _box(side: int) -> Callable[[Frame], Array]:
    def values(frame: Frame) -> Array:
        column: Array = frame.boxes[:, side]
        return column

    return values


def _mask(feature: Callable[[Masks], Array]) -> Callable[[Frame], Array]:
    return lambda frame: feature(frame.masks)


FEATURES: Final[dict[str, Callable[[Frame], Array]]] = {
    "x1": _box(0),
    "x2": _box(2),
    "y1": _box(1),
    "y2": _box(3),
    **{name: _mask(feature) for name, feature in MASK_FEATURES.items()},
    "cut": lambda frame: frame.any_cut.astype(np.float64),
    "cut_top": lambda frame: frame.cut[:, 1].astype(np.float64),
}
"""Every feature by its name: from a frame's N instances to its values (N,). ``cut`` is 1 where any of the
image's edges cuts the box, ``cut_top`` where the upper one does, else 0.
"""

UNSCALED: Final[frozenset[str]] = frozenset({"lamp", "tilt", "cut", "cut_top"})
"""Flags and angles. Every other feature scales with the image."""


def measure(
    instances: Sequence[Instance],
    image_width_px: int,
    image_height_px: int,
    names: Iterable[str] = tuple(FEATURES),
) -> Features:
    """The named features (default: all) of a frame's instances (N, possibly 0) in an image of this size.

    InputError for an unknown name.
    """
    names = tuple(names)
    check_names(names)
    boxes = np.array([each.box_px for each in instances], dtype=np.float64).reshape(-1, 4)
    cut = np.empty(boxes.shape, dtype=np.bool_)
    cut[:, :2] = boxes[:, :2] <= EDGE_PX
    cut[:, 2:] = boxes[:, 2:] >= (image_width_px - EDGE_PX, image_height_px - EDGE_PX)
    frame = Frame(boxes, cut, Masks(instances))
    values = np.array([FEATURES[name](frame) for name in names]).T
    too_small: Flags = (boxes[:, 3] - boxes[:, 1] < MIN_HEIGHT_PX) | ~np.isfinite(values).all(axis=1)
    return Features(names, values, frame.any_cut, too_small)


def check_names(names: Sequence[str]) -> None:
    """InputError where a name is not in ``FEATURES``."""
    unknown = [name for name in names if name not in FEATURES]
    if unknown or not names:
        raise InputError(f"features {list(names)}: unknown {unknown}", f"known: {', '.join(FEATURES)}")
