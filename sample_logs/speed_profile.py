"""How fast a bus drives along its path: a cruising speed that wanders, slower in bends, and a stop."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import gaussian_filter1d

from scpf.sample_logs.wander import Wander

Array = NDArray[np.float64]

MAX_SPEED_MPS = 12.0
CRUISE_MPS, CRUISE_DEVIATION_MPS = 11.3, 0.17
"""Four deviations, the bound of a wander, end below the greatest speed."""
CRUISE_WAVELENGTHS_M = (150.0, 900.0)
LATERAL_MPS2 = 1.2
"""At which standing passengers still stand well."""
ACCELERATION_MPS2, BRAKING_MPS2 = 0.9, 1.1
STANDING_S = 6.0
JERK_TIME_S = 0.5
"""Standard deviation, in time, of the smoothing that a driver's foot does."""


def greatest_speeds(path_m: Array, curvature_per_m: Array, stop: int | None, cruise: Wander) -> Array:
    """Speeds (N,), m/s, at ``path_m`` (N,) metres along the driven path: 0 at the index ``stop``, if given.

    Each place has its limit, by the cruising speed and by the lateral acceleration in bends; one pass forward and one
    backward keep within what the bus accelerates and brakes with.
    """
    bend = np.sqrt(LATERAL_MPS2 / np.maximum(np.abs(curvature_per_m), 1e-6))
    squared = np.minimum(np.minimum(CRUISE_MPS + cruise.at(path_m), bend), MAX_SPEED_MPS) ** 2
    if stop is not None:
        squared[stop] = 0.0
    steps = np.diff(path_m)
    for k, step in enumerate(steps):
        squared[k + 1] = min(squared[k + 1], squared[k] + 2 * ACCELERATION_MPS2 * step)
    for k in range(len(steps) - 1, -1, -1):
        squared[k] = min(squared[k], squared[k + 1] + 2 * BRAKING_MPS2 * steps[k])
    speeds: Array = np.sqrt(squared)
    return speeds


def travelled(path_m: Array, speed_mps: Array, stop: int | None, step_s: float) -> tuple[Array, Array, Array]:
    """Times (M,) from 0 in steps of ``step_s``, and path lengths (M,) and speeds (M,) then.

    ``path_m`` and ``speed_mps`` (N,): as ``greatest_speeds`` has them; accelerations are constant between two places.
    """
    passed = 2 * np.diff(path_m) / (speed_mps[1:] + speed_mps[:-1])
    if stop is not None:  # the bus comes to the place, and leaves it later
        passed = np.insert(passed, stop, STANDING_S)
        speed_mps = np.insert(speed_mps, stop, 0.0)
    knots = np.concatenate([[0.0], np.cumsum(passed)])
    times = np.arange(0.0, knots[-1], step_s)
    # Smoothing keeps the integral, so that the bus still stops where it should, and exceeds no maximum.
    speed = gaussian_filter1d(np.interp(times, knots, speed_mps), JERK_TIME_S / step_s, mode="nearest")
    path = path_m[0] + cumulative_trapezoid(speed, dx=step_s, initial=0.0)
    return times, path, speed
