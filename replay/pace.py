"""How fast a replay runs: as fast as it can, or at the log's own times, as a vehicle would."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from scpf.replay.step import Frame

Late = Literal["drop", "wait"]


@dataclass(frozen=True)
class PaceSettings:
    """``factor`` × real time (∞: as fast as it can, nothing dropped), and what happens to a frame that comes too late:
    ``drop`` leaves it out, ``wait`` runs it all the same and falls behind."""

    factor: float = math.inf
    late: Late = "wait"


FULL_SPEED: Final = PaceSettings()


class Pace:
    """Hands each frame out when it is due, and measures how long after that it was finished.

    A frame is due at its stamp's distance from the first one's, divided by the factor. One that comes later than the
    interval to the frame before is too late; where it is dropped, its interval is added to the next frame's.
    """

    def __init__(
        self,
        settings: PaceSettings,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._settings = settings
        self._clock, self._sleep = clock, sleep
        self._begun = 0.0
        self._first_ns: int | None = None
        self._latencies_s: list[float] = []
        self.dropped = 0

    @property
    def live(self) -> bool:
        """Whether frames are due at a time at all."""
        return math.isfinite(self._settings.factor)

    def frames(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """The frames in their order, each not before it is due."""
        missed_s = 0.0
        for frame in frames:
            if not self.live:
                yield frame
                continue
            early_s = self._due(frame) - self._clock()
            if early_s > 0.0:
                self._sleep(early_s)
            elif self._settings.late == "drop" and -early_s > frame.dt_s / self._settings.factor > 0.0:
                self.dropped += 1
                missed_s += frame.dt_s
                continue
            yield replace(frame, dt_s=frame.dt_s + missed_s) if missed_s else frame
            missed_s = 0.0

    def finished(self, frame: Frame) -> None:
        """Note that everything about the frame is done."""
        if self.live:
            self._latencies_s.append(self._clock() - self._due(frame))

    def report(self) -> dict[str, float | int]:
        """Frames dropped, and latencies from due to done (median, 95th percentile, worst); empty at full speed."""
        if not self._latencies_s:
            return {}
        latencies_ms = 1e3 * np.array(self._latencies_s)
        return {
            "dropped": self.dropped,
            "latency_median_ms": float(np.median(latencies_ms)),
            "latency_p95_ms": float(np.percentile(latencies_ms, 95)),
            "latency_max_ms": float(latencies_ms.max()),
        }

    def _due(self, frame: Frame) -> float:
        """When the frame is due, on the clock (s); the first one is due when it comes."""
        if self._first_ns is None:
            self._begun, self._first_ns = self._clock(), frame.stamp_ns
        return self._begun + (frame.stamp_ns - self._first_ns) * 1e-9 / self._settings.factor
