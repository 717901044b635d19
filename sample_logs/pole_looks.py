"""What a road's light poles look like: those of the Ring Road, and others that a trained network shall know, too."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

COLOURS = (
    (0.30, 0.31, 0.31),
    (0.62, 0.63, 0.62),
    (0.045, 0.045, 0.05),
    (0.06, 0.11, 0.08),
    (0.16, 0.10, 0.06),
    (0.45, 0.44, 0.40),
)
"""Linear: galvanised, bright zinc, black, green, brown, concrete."""


@dataclass(frozen=True)
class PoleLook:
    """One make of poles along a road."""

    shapes: tuple[tuple[float, float], ...] = ((8.6, 1.7), (8.6, 1.65), (8.5, 1.75))
    """Height and length of the arm, m; each pole has one of them."""
    girth: float = 1.0
    """Thickness, relative to the Ring Road's."""
    colour: tuple[float, float, float] = (0.30, 0.31, 0.31)
    banner_share: float = 0.22

    @property
    def lamp_height_m(self) -> float:
        """Height of the light above the ground."""
        return self.shapes[0][0] - 0.15

    @property
    def lamp_inwards_m(self) -> float:
        """From the pole towards the road."""
        return self.shapes[0][1] + 0.2


RING_ROAD_LOOK = PoleLook()


def drawn_look(rng: np.random.Generator) -> PoleLook:
    """Another make: 6 to 11 m high, slender or stout, of any usual colour; one in three as on the Ring Road."""
    if rng.uniform() < 1 / 3:
        return RING_ROAD_LOOK
    height_m, arm_m = float(rng.uniform(6.0, 11.0)), float(rng.uniform(1.2, 2.6))
    shapes = tuple((height_m + float(rng.normal(0, 0.1)), arm_m) for _ in range(3))
    colour = COLOURS[int(rng.integers(len(COLOURS)))]
    banner_share = float(rng.choice([0.0, 0.1, 0.4]))
    return PoleLook(shapes, float(rng.uniform(0.75, 1.5)), colour, banner_share)
