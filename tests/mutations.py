"""Deterministic damage to bytes of any format."""

from __future__ import annotations

import struct

import numpy as np

_BLOWN_UP = (b"\xff", b"\xff\xff", b"\x7f\xff\xff\xff", b"\xff\xff\xff\xff", b"\0\0\0\0")
_NUMBERS = (np.inf, -np.inf, np.nan, 1e308, -1e308, 5e-324, 604800.0, 0.0)
_TEXTS = (
    b"e999",
    b"nan",
    b"-",
    b",",
    b"\n",
    b"\0",
    b"\xe9",
    b"1e309",
    b"99999999999999999999",
    b"inf",
    b"*",
    b"$",
)


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """The same with one to three damages: flipped bits, cuts, splices, lengths blown up, numbers no one sends."""
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 4))):
        if not out:
            break
        at, other = (int(value) for value in rng.integers(0, len(out), 2))
        size = int(rng.integers(1, 40))
        match int(rng.integers(0, 8)):
            case 0:
                out[at] ^= 1 << int(rng.integers(0, 8))
            case 1:
                del out[at:]
            case 2:
                out[at:at] = out[other : other + size]
            case 3:
                del out[at : at + size]
            case 4:
                out[at : at + 4] = _BLOWN_UP[int(rng.integers(0, len(_BLOWN_UP)))]
            case 5:
                number = _NUMBERS[int(rng.integers(0, len(_NUMBERS)))]
                out[at - at % 8 : at - at % 8 + 8] = struct.pack("<>"[int(rng.integers(0, 2))] + "d", number)
            case 6:
                out[at : at + size] = rng.bytes(size)
            case _:
                out[at : at + 1] = _TEXTS[int(rng.integers(0, len(_TEXTS)))]
    return bytes(out)
