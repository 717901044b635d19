"""What the names of image files say: counters, stamps, and when a recording began.

``1660847613703000001.png`` and ``frame_1660847613.703000001.jpg`` hold the time of the image (ROS tools).
``Basler_acA2040-55uc__23734412__20220818_183353703_0001.tiff`` holds the time at which the recording began, the
same in each name, and a counter, padded or not.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import PurePath
from typing import Final, NamedTuple

import numpy as np

NaturalKey = tuple[list[tuple[int, int, str]], str]

_DIGITS: Final = re.compile(r"([0-9]+)")
_SECONDS: Final = re.compile(r"(?<![0-9])([0-9]{9,10})(?:\.([0-9]{1,9})|[_-]([0-9]{9}))(?![0-9])")
_SINCE_START: Final = re.compile(r"^([0-9]{1,8})[._-]([0-9]{9})$")
_WHOLE: Final = re.compile(r"(?<![0-9.])([0-9]{19}|[0-9]{16}|[0-9]{13})(?![0-9])")
_BEGIN: Final = re.compile(r"(?<![0-9])([0-9]{8})_([0-9]{6})([0-9]{3})(?![0-9])")


def natural_order(name: str) -> NaturalKey:
    """The order of names in which numbers count as numbers, however many zeros they carry: 2 before 10."""
    parts = _DIGITS.split(PurePath(name).stem)
    return [(1, int(part), "") if k % 2 else (0, 0, part) for k, part in enumerate(parts)], name


def stamp_in_name(stem: str) -> int | None:
    """The time in ns that a name without its ending states, or None.

    Seconds with a fraction (``.`` then 1 to 9 digits, or ``_`` or ``-`` then 9), or a whole number of 19, 16 or 13
    digits: ns, µs or ms since 1970. A name with two of these says nothing.
    """
    found = [
        int(whole) * 10**9 + int((fraction or nine).ljust(9, "0"))
        for whole, fraction, nine in _SECONDS.findall(stem) + [(*m, "") for m in _SINCE_START.findall(stem)]
    ]
    found += [int(digits) * 10 ** (19 - len(digits)) for digits in _WHOLE.findall(stem)]
    return found[0] if len(found) == 1 else None


def begin_in_name(stem: str) -> int | None:
    """When the recording began (ns, the recorder's own clock read as UTC), as Basler's names state it, or None."""
    found = _BEGIN.search(stem)
    if found is None:
        return None
    try:
        moment = datetime.strptime(found[1] + found[2], "%Y%m%d%H%M%S").replace(tzinfo=UTC)
    except ValueError:
        return None
    return int(moment.timestamp()) * 10**9 + int(found[3]) * 10**6


class Counters(NamedTuple):
    """The last number of each name, ascending. ``stride`` is what it grows by where nothing is missing."""

    numbers: list[int]
    stride: int

    @property
    def missing(self) -> int:
        """How many numbers were left out on the way: frames that the camera or the recorder dropped."""
        return sum((b - a) // self.stride - 1 for a, b in pairwise(self.numbers))

    @property
    def gaps(self) -> list[tuple[int, int, int]]:
        """(number before, number after, how many are missing), of each gap."""
        steps = [(a, b, (b - a) // self.stride - 1) for a, b in pairwise(self.numbers)]
        return [step for step in steps if step[2]]

    def positions(self) -> list[int]:
        """Where each image stands in a recording without gaps, from 0."""
        return [(number - self.numbers[0]) // self.stride for number in self.numbers]


def counters(stems: Sequence[str]) -> Counters | None:
    """The counters of names that differ in their last number alone; None where names are of another kind.

    Names that hold stamps have none. A folder that keeps every n-th frame has stride n, and no gap.
    """
    split = [_DIGITS.split(stem) for stem in stems]
    if len(split) < 2 or any(len(parts) < 2 for parts in split) or stamp_in_name(stems[0]) is not None:
        return None
    skeleton = (split[0][:-2], split[0][-1])
    if any((parts[:-2], parts[-1]) != skeleton for parts in split):
        return None
    numbers = [int(parts[-2]) for parts in split]
    steps = [b - a for a, b in pairwise(numbers)]
    smallest = min(steps)
    if smallest <= 0:
        return None
    regular = not np.any(np.array(steps, dtype=object) % smallest)
    return Counters(numbers, smallest if regular else 1)
