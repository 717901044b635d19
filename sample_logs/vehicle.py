"""A simulated drive: where the bus is when the camera triggers, and which frames never arrive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError
from scpf.sample_logs.centre_line import CentreLine
from scpf.sample_logs.speed_profile import MAX_SPEED_MPS
from scpf.sample_logs.vehicle_motion import MotionState, VehicleMotion

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

RATE_HZ = 13.0
JITTER_NS, GREATEST_JITTER_NS = 300_000.0, 1_000_000
DROPPED_SHARE = 0.004
START_NS = 1_660_847_633_703_000_000
"""2022-08-18, 18:33:53.703 UTC."""
SHORTEST_S = 1.0


@dataclass(frozen=True, eq=False)
class VehicleDrive:
    """A drive: ``frames`` is the state at each picture that arrived, ``motion`` that at any other moment."""

    motion: VehicleMotion
    frames: MotionState
    frame_numbers: NDArray[np.int64]
    """The camera's counter (N,) of these pictures, from 1; it counts those that were dropped, too."""
    dropped_numbers: NDArray[np.int64]
    """The numbers (M,) of the pictures that never arrived."""
    rate_hz: float = RATE_HZ
    """The camera's."""

    @property
    def stamps_ns(self) -> Stamps:
        """When the pictures (N,) were taken, UTC, strictly increasing."""
        return self.frames.stamps_ns

    @property
    def T_map_body(self) -> Array:
        """Poses (N, 4, 4) then."""
        return self.frames.T_map_body

    def __len__(self) -> int:
        return len(self.frames.stamps_ns)


def simulate_vehicle(
    centre_line: CentreLine,
    *,
    start_m: float = 0.0,
    length_m: float | None = None,
    duration_s: float | None = None,
    seed: int = 0,
    stop_at_m: float | None = None,
    start_ns: int = START_NS,
    dropped_share: float = DROPPED_SHARE,
    rate_hz: float = RATE_HZ,
) -> VehicleDrive:
    """Drive along the right lane from ``start_m`` of the centre line, for ``length_m`` or ``duration_s``.

    ``stop_at_m``: where, along the centre line as ``start_m`` is, the bus stands for some seconds; None: nowhere. The
    camera triggers at ``rate_hz`` with a jitter of 0.3 ms; a share of its pictures is dropped, never the first or the
    last. The same arguments give the same drive. Raises InputError for a drive that leaves an open centre line, one
    of no length, and for a stop outside it.
    """
    if (length_m is None) == (duration_s is None):
        raise InputError("a drive has a length or a duration", "give one of the two")
    reach_m = length_m
    if duration_s is not None:
        reach_m = MAX_SPEED_MPS * duration_s + 1.0
        if not centre_line.closed:
            reach_m = min(reach_m, centre_line.length_m - start_m)
    assert reach_m is not None
    stop_m = start_m + reach_m
    if not (np.isfinite([start_m, stop_m]).all() and stop_m - start_m >= 1.0):
        raise InputError(f"a drive from {start_m:g} m to {stop_m:g} m", "give a positive length")
    if not centre_line.closed and not 0.0 <= start_m < stop_m <= centre_line.length_m:
        text = f"a drive from {start_m:g} m to {stop_m:g} m of a road of {centre_line.length_m:.0f} m"
        raise InputError(text, "begin earlier, or drive less")
    if stop_at_m is not None and not start_m < stop_at_m < stop_m:
        raise InputError(f"a stop at {stop_at_m:g} m of a drive from {start_m:g} m to {stop_m:g} m")
    rng = np.random.default_rng([seed, 11])
    motion = VehicleMotion(centre_line, start_m, stop_m, start_ns, rng, stop_at_m)
    seconds = motion.duration_s if duration_s is None else duration_s
    if not SHORTEST_S <= seconds <= motion.duration_s:
        hint = (
            f"the road is long enough for {motion.duration_s:.1f} s from there; {SHORTEST_S:g} s is the least"
        )
        raise InputError(f"a drive of {seconds:.1f} s", hint)
    stamps, numbers, dropped = _triggers(
        start_ns, seconds, rate_hz, dropped_share, np.random.default_rng([seed, 12])
    )
    return VehicleDrive(motion, motion.at(stamps), numbers, dropped, rate_hz)


def _triggers(
    start_ns: int, duration_s: float, rate_hz: float, dropped_share: float, rng: np.random.Generator
) -> tuple[Stamps, NDArray[np.int64], NDArray[np.int64]]:
    """Stamps and numbers of the pictures that arrive, and the numbers of those that do not."""
    count = int(duration_s * rate_hz) + 1
    jitter = np.clip(rng.normal(0.0, JITTER_NS, count), -GREATEST_JITTER_NS, GREATEST_JITTER_NS)
    stamps = start_ns + np.rint(np.arange(count) * (1e9 / rate_hz) + jitter).astype(np.int64)
    lost = rng.uniform(size=count) < dropped_share
    lost[[0, -1]] = False
    numbers = np.arange(1, count + 1)
    return stamps[~lost], numbers[~lost], numbers[lost]
