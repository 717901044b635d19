"""ROS 1 messages to CDR without decoding them: the fields of a type flattened to copies of bytes, once for a type.

The two differ in alignment (CDR aligns each number to its own size, ROS 1 packs), in strings (CDR counts and writes a
final zero), and in the Header (``seq`` falls away). Types with sequences of messages or of strings are left to rosbags.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

Bytes = bytes | memoryview
Transcode = Callable[[Bytes], bytes]

HEADER: Final = "std_msgs/msg/Header"
ENCAPSULATION: Final = b"\0\1\0\0"
"""CDR, little-endian."""
MAX_LEAVES: Final = 10_000
_SIZES: Final = {
    "bool": 1, "byte": 1, "char": 1, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4, "uint32": 4,
    "float32": 4, "int64": 8, "uint64": 8, "float64": 8,
}  # fmt: skip
_PADS: Final = [bytes(size) for size in range(8)]
_COUNT: Final = struct.Struct("<I")

_STRING, _SEQUENCE, _SKIP = "string", "sequence", "skip"
_Leaf = tuple[str, int]
"""A kind, or ``run`` of one number; and the size of a number."""
_Piece = tuple[int, int, int]
"""Padding before, first byte (from the beginning of the run) and last byte of what is copied."""


class _Unfit(Exception):
    """The type is not made of numbers, strings and sequences of numbers alone."""


def transcoder(store: Typestore, name: str) -> Transcode | None:
    """What turns ROS 1 bytes of a type into CDR; it raises ValueError or struct.error for bytes that do not fit.

    ``store`` has a Header without ``seq``, as ROS 2 has it. None for types that are left to rosbags.
    """
    leaves: list[_Leaf] = []
    try:
        _flatten(store, name, leaves, 0)
    except _Unfit:
        return None
    steps: list[tuple[str, Any]] = []
    run: list[int] = []
    for kind, size in [*leaves, ("end", 0)]:
        if kind == "run":
            run.append(size)
            continue
        if run:
            steps.append(("run", ([_pieces(run, start) for start in range(8)], sum(run))))
            run = []
        if kind != "end":
            steps.append((kind, size))
    return _program(steps)


def _flatten(store: Typestore, name: str, leaves: list[_Leaf], depth: int) -> None:
    from rosbags.interfaces import Nodetype

    if name not in store.fielddefs or depth > 32:
        raise _Unfit
    if name == HEADER:
        leaves.append((_SKIP, 4))
    for _, (node, detail) in store.fielddefs[name][1]:
        inner, count = (
            (detail[0], detail[1]) if node in (Nodetype.ARRAY, Nodetype.SEQUENCE) else ((node, detail), 1)
        )
        if node == Nodetype.NAME:
            _flatten(store, str(detail), leaves, depth + 1)
        elif inner[0] != Nodetype.BASE:
            raise _Unfit
        elif inner[1][0] == "string":
            if node != Nodetype.BASE:
                raise _Unfit
            leaves.append((_STRING, 0))
        elif inner[1][0] not in _SIZES or len(leaves) + int(count) > MAX_LEAVES:
            raise _Unfit
        elif node == Nodetype.SEQUENCE:
            leaves.append((_SEQUENCE, _SIZES[inner[1][0]]))
        else:
            leaves += [("run", _SIZES[inner[1][0]])] * int(count)
    if (
        not store.fielddefs[name][1]
        or store.fielddefs[name][1][0][0] == "structure_needs_at_least_one_member"
    ):
        raise _Unfit


def _pieces(run: list[int], start: int) -> tuple[list[_Piece], int]:
    """What is copied of consecutive numbers that begin at ``start`` (modulo 8), and the bytes that come of it."""
    pieces: list[_Piece] = []
    at, taken = start, 0
    for size in run:
        pad = -at % size
        if pad or not pieces:
            pieces.append((pad, taken, taken + size))
        else:
            pieces[-1] = (*pieces[-1][:2], taken + size)
        at, taken = at + pad + size, taken + size
    return pieces, at - start


def _program(steps: list[tuple[str, Any]]) -> Transcode:
    count = _COUNT.unpack_from
    pack = _COUNT.pack

    def transcode(raw: Bytes) -> bytes:
        parts: list[Bytes] = [ENCAPSULATION]
        add = parts.append
        size, position, at = len(raw), 0, 0
        for kind, detail in steps:
            if kind == "run":
                layouts, taken = detail
                pieces, made = layouts[at & 7]
                for pad, first, last in pieces:
                    if pad:
                        add(_PADS[pad])
                    add(raw[position + first : position + last])
                position += taken
                at += made
                if position > size:
                    raise ValueError(f"{size} bytes where more are needed")
                continue
            if kind == _SKIP:
                position += detail
                continue
            (length,) = count(raw, position)
            position += 4
            end = position + (length if kind == _STRING else length * detail)
            if end > size:
                raise ValueError(f"a length of {length} where {size - position} bytes are left")
            pad = -at & 3
            if pad:
                add(_PADS[pad])
            at += pad + 4
            if kind == _STRING:
                add(pack(length + 1))
                add(raw[position:end])
                add(b"\0")
                at += length + 1
            else:
                add(pack(length))
                if length:
                    pad = -at % detail
                    if pad:
                        add(_PADS[pad])
                        at += pad
                    add(raw[position:end])
                    at += end - position
            position = end
        if position != size:
            raise ValueError(f"{size} bytes where {position} are needed")
        return b"".join(parts)

    return transcode
