"""What a face of the simulated world is made of: the number that the shading looks up."""

from __future__ import annotations

from enum import IntEnum


class Material(IntEnum):
    """Materials of faces; PLAIN, METAL, PAINT, BARK, LEAF and FACADE take the tint of their instance."""

    NONE = 0
    ASPHALT = 1
    KERB = 2
    PAVEMENT = 3
    GRASS = 4
    FACADE = 5
    BARK = 6
    LEAF = 7
    METAL = 8
    LENS = 9
    PAINT = 10
    GLASS = 11
    RUBBER = 12
    SIGN = 13
    TAIL_LIGHT = 14
    PLAIN = 15
    HEADLIGHT = 16
    RIM = 17
    PARKING_LOT = 18
