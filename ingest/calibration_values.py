"""Numbers out of calibration files, which are untrusted: checked before anything is built of them."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError

Array = NDArray[np.float64]

MAX_VALUES: Final = 10_000
MAX_SIDE_PX: Final = 100_000


def flat_numbers(values: Any, place: str) -> list[float]:
    """Numbers of a list, or of a list of lists. YAML lets a short text name a list of lists of lists without end:
    nothing deeper than two is followed, and no more than ten thousand numbers.
    """
    rows = values if isinstance(values, list | tuple) else [values]
    if len(rows) > MAX_VALUES or sum(len(row) if isinstance(row, list) else 1 for row in rows) > MAX_VALUES:
        raise InputError(f"{place} holds more than {MAX_VALUES} values")
    flat = [cell for row in rows for cell in (row if isinstance(row, list) else [row])]
    try:
        return [float(cell) for cell in flat]
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{place} is not a list of numbers") from error


def matrix(values: Any, shape: tuple[int, ...], place: str) -> Array:
    """Finite numbers of a shape (-1: any number). Raises InputError naming ``place``."""
    flat = np.array(flat_numbers(values, place), dtype=np.float64)
    try:
        shaped = flat.reshape(shape)
    except ValueError as error:
        size = "×".join(map(str, shape))
        raise InputError(f"{place} has {len(flat)} numbers, where {size} are needed") from error
    if not np.isfinite(shaped).all():
        raise InputError(f"{place} holds a value that is not finite")
    return shaped


def shown(value: Any) -> str:
    """A value for a message. Lists are named alone: what a short text says, written out, may fill the memory."""
    plain = value is None or isinstance(value, str | int | float)
    try:
        return str(value)[:40] if plain else f"a {type(value).__name__}"
    except ValueError:  # whole numbers of thousands of digits
        return "a huge number"


def whole(value: Any, place: str) -> int:
    """A size in pixels. Raises InputError."""
    try:
        number = int(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{place}: {shown(value)!r} is not a whole number") from error
    if not 0 < number <= MAX_SIDE_PX:
        raise InputError(f"{place}: {number} px")
    return number


def rigid(values: Any, place: str) -> Array:
    """A transform (4, 4): a rotation within 1e-3, and a translation in m. Raises InputError."""
    transform = matrix(values, (4, 4), place)
    rotation = transform[:3, :3]
    off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if off > 1e-3 or np.linalg.det(rotation) < 0 or not np.allclose(transform[3], [0, 0, 0, 1]):
        raise InputError(f"{place} is not a rotation and a translation (misses by {off:.2g})")
    return transform
