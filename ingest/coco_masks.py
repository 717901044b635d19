"""COCO's three forms of a mask: polygons, run lengths, and run lengths packed into a text.

The packing is that of pycocotools' ``rleToString`` (maskApi.c): each number in groups of five bits, the lowest first,
48 added to make letters, bit 6 where more groups follow; from the fourth on, numbers are differences to the one two
before.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.label_json import number
from scpf.models.errors import InputError
from scpf.models.instances import BoolMask, Instance, decode_runs, instance_from_mask
from scpf.models.polygons import MOST_POINTS, fill

Runs = NDArray[np.int64]
_MOST_GROUPS = 7  # 35 bits


def read_segmentation(
    value: object, size_px: tuple[int, int], where: str
) -> list[NDArray[np.float64]] | Runs:
    """Polygons (N, 2) or run lengths of an annotation's ``segmentation`` in a picture of ``size_px`` (width, height).

    Raises InputError that begins with ``where``.
    """
    if isinstance(value, list) and value:
        return [_polygon(flat, f"{where}: polygon {k}") for k, flat in enumerate(value)]
    if isinstance(value, dict):
        return _runs(value, size_px, where)
    raise InputError(f"{where}: segmentation holds neither polygons nor run lengths")


def _polygon(flat: object, where: str) -> NDArray[np.float64]:
    if not isinstance(flat, list) or len(flat) < 6 or len(flat) % 2:
        raise InputError(f"{where}: not x, y of three points or more")
    if len(flat) > 2 * MOST_POINTS:
        raise InputError(f"{where}: {len(flat) // 2} points, {MOST_POINTS} are the most")
    return np.array([number(value, where) for value in flat], dtype=np.float64).reshape(-1, 2)


def _runs(value: Mapping[str, Any], size_px: tuple[int, int], where: str) -> Runs:
    width, height = size_px
    if value.get("size") != [height, width]:
        raise InputError(
            f"{where}: run lengths of size {value.get('size')}, the picture's is {[height, width]}"
        )
    counts = value.get("counts")
    pixels = width * height
    if isinstance(counts, str):
        runs = unpack_runs(counts, where)
    elif isinstance(counts, list) and len(counts) <= pixels + 1:
        if not all(isinstance(c, int) and not isinstance(c, bool) and 0 <= c <= pixels for c in counts):
            raise InputError(f"{where}: a run length is not a whole number from 0 to {pixels}")
        runs = np.array(counts, dtype=np.int64)
    else:
        raise InputError(f"{where}: no run lengths")
    if (runs < 0).any() or (runs > pixels).any() or int(runs.sum()) != pixels:
        raise InputError(f"{where}: the run lengths do not add up to {width}×{height} pixels")
    return runs


def unpack_runs(packed: str, where: str) -> Runs:
    """The run lengths of a packed text, not yet checked against a picture's size."""
    try:
        groups = np.frombuffer(packed.encode("ascii"), np.uint8).astype(np.int64) - 48
    except UnicodeEncodeError as error:
        raise InputError(f"{where}: a letter that is not of packed run lengths") from error
    if ((groups < 0) | (groups > 63)).any():
        raise InputError(f"{where}: a letter that is not of packed run lengths")
    last = np.flatnonzero((groups & 32) == 0)
    if not len(groups) or len(last) == 0 or last[-1] != len(groups) - 1:
        raise InputError(f"{where}: the packed run lengths end within a number")
    first = np.concatenate(([0], last[:-1] + 1))
    lengths = last - first + 1
    if lengths.max() > _MOST_GROUPS:
        raise InputError(f"{where}: a packed run length is too large")
    place = np.arange(len(groups)) - np.repeat(first, lengths)
    values = np.add.reduceat((groups & 31) << (5 * place), first)
    values -= np.where(groups[last] & 16, np.int64(1) << (5 * lengths), 0)
    runs = values.copy()
    runs[1::2] = np.cumsum(values[1::2])
    runs[2::2] = np.cumsum(values[2::2])
    return runs


def to_instance(
    segmentation: list[NDArray[np.float64]] | Runs, size_px: tuple[int, int], landmark_class: str
) -> Instance | None:
    """The instance of a checked segmentation; None where no pixel of the picture belongs to it."""
    width, height = size_px
    whole: BoolMask
    if isinstance(segmentation, list):
        whole = np.zeros((height, width), dtype=np.bool_)
        for points in segmentation:
            mask, (x, y) = fill(points, width, height)
            whole[y : y + mask.shape[0], x : x + mask.shape[1]] |= mask
    else:
        whole = decode_runs(segmentation.astype(np.uint32), height, width)
    if not whole.any():
        return None
    found = instance_from_mask(whole)
    return Instance(found.box_px, found.mask, found.offset_px, 1.0, landmark_class)
