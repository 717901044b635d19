"""What makes an evaluation harder than its case: outages of the GPS, lost detections, another map or range error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import UsageError
from scpf.replay.protocol import Case, Detection

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

WORST_RANGE_ERROR_M: Final = 20.0


@dataclass(frozen=True)
class Conditions:
    """Changes to the cases of an evaluation; the defaults change nothing.

    ``gps_outages_s``: from and to, in seconds after the first frame, end excluded. Without ``gps_after_start`` only
    the first frame has a fix. ``drop_out``: probability that a detection is lost, beyond those that the case loses.
    ``map_error_m``: how far every landmark is off, at least and at most. ``range_error_m``: mean absolute errors,
    close and far; ``correlated``: whether they last for a second. None leaves the case's own.
    """

    gps_outages_s: tuple[tuple[float, float], ...] = ()
    gps_after_start: bool = True
    drop_out: float = 0.0
    map_error_m: tuple[float, float] | None = None
    range_error_m: tuple[float, float] | None = None
    correlated: bool | None = None

    def check(self) -> None:
        """UsageError where a value makes no sense."""
        for start_s, end_s in self.gps_outages_s:
            if not 0.0 <= start_s < end_s:
                raise UsageError(f"a GPS outage from {start_s:g} to {end_s:g} s", "give --gps-outage FROM:TO")
        if not 0.0 <= self.drop_out <= 1.0:
            raise UsageError("--drop-out is a probability between 0 and 1")
        if self.map_error_m is not None and not 0.0 <= self.map_error_m[0] <= self.map_error_m[1] < np.inf:
            raise UsageError("--map-error is LEAST:MOST, in m")
        if self.range_error_m is not None and not all(
            0.0 < error_m <= WORST_RANGE_ERROR_M for error_m in self.range_error_m
        ):
            raise UsageError(
                f"--range-error is CLOSE:FAR, in m, each above 0 and up to {WORST_RANGE_ERROR_M:g}"
            )

    def applied_to(self, case: Case) -> Case:
        """The case with its map and range errors changed."""
        changes: dict[str, Any] = {
            "map_error_m": self.map_error_m,
            "mean_absolute_error_m": self.range_error_m,
            "correlated": self.correlated,
        }
        return replace(case, **{name: value for name, value in changes.items() if value is not None})

    def fixed(self, times_s: Array) -> Mask:
        """Which of the frames (K,) have a fix; ``times_s`` (K,) since the first one."""
        has = np.ones(len(times_s), dtype=bool)
        for start_s, end_s in self.gps_outages_s:
            has &= (times_s < start_s) | (times_s >= end_s)
        if not self.gps_after_start:
            has[1:] = False
        return has


def thinned(
    detections: Sequence[tuple[Detection, ...]], drop_out: float, rng: np.random.Generator
) -> tuple[tuple[Detection, ...], ...]:
    """The detections of each frame, each lost with probability ``drop_out``."""
    return tuple(tuple(seen for seen in frame if rng.uniform() >= drop_out) for frame in detections)
