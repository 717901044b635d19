"""Roll and pitch of a bus on its springs: driven by its accelerations and by the road."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import bilinear, lfilter, lfilter_zi

Array = NDArray[np.float64]

ROLL_RAD_PER_MPS2 = np.radians(0.40)
"""Four degrees a g, away from the bend: a city bus."""
PITCH_RAD_PER_MPS2 = np.radians(0.25)
SPRING_HZ, DAMPING = 1.1, 0.35
"""Natural frequency, and damping as a share of the critical one, of the body on its springs."""


def sway(
    lateral_mps2: Array, forward_mps2: Array, road_roll_rad: Array, road_pitch_rad: Array, step_s: float
) -> tuple[Array, Array]:
    """Roll and pitch (N,), rad, of a body x forward, y left, z up, at times ``step_s`` apart.

    ``lateral_mps2`` (N,) is positive to the left: there the left side rises (roll > 0). ``forward_mps2`` (N,):
    braking lowers the front (pitch > 0). The springs let through what is slower than they are, and ring at their own
    frequency. The road's angles (N,) are those of an unsprung body.
    """
    roll = ROLL_RAD_PER_MPS2 * lateral_mps2 + road_roll_rad
    pitch = -PITCH_RAD_PER_MPS2 * forward_mps2 + road_pitch_rad
    return _sprung(roll, step_s), _sprung(pitch, step_s)


def _sprung(target_rad: Array, step_s: float) -> Array:
    """The answer (N,) of a damped oscillator to a target (N,), settled at the beginning."""
    w = 2 * np.pi * SPRING_HZ
    b, a = bilinear([w**2], [1.0, 2 * DAMPING * w, w**2], fs=1 / step_s)
    answer, _ = lfilter(b, a, target_rad, zi=lfilter_zi(b, a) * target_rad[0])
    settled: Array = answer
    return settled
