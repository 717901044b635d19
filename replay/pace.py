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

    While it is held, frames come as soon as they are asked for, and nothing is late: the frame after it goes on is due
    as if no time had passed. ``sleep`` may return early, where the pace was changed meanwhile.
    """

    def __init__(
        self,
        settings: PaceSettings,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._late, self.factor = settings.late, settings.factor
        self._clock, self._sleep = clock, sleep
        self._begun = 0.0
        self._begun_ns: int | None = None
        self._last_ns: int | None = None
        self._late_at_hold_s: float | None = None
        self._latencies_s: list[float] = []
        self.dropped = 0

    @property
    def live(self) -> bool:
        """Whether frames are due at a time at all."""
        return math.isfinite(self.factor) and self._late_at_hold_s is None

    @property
    def frames_ahead(self) -> int:
        """How many frames may be read ahead of the one at hand: each adds its interval to the latency."""
        return 1 if math.isfinite(self.factor) else 4

    def frames(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """The frames in their order, each not before it is due."""
        missed_s = 0.0
        for frame in frames:
            early = False
            while self.live and (early_s := self._due(frame) - self._clock()) > 0.0:
                early = True
                self._sleep(early_s)
            if self._late == "drop" and self.live and not early and self._is_late(frame):
                self.dropped += 1
                missed_s += frame.dt_s
                continue
            self._last_ns = frame.stamp_ns
            yield replace(frame, dt_s=frame.dt_s + missed_s) if missed_s else frame
            missed_s = 0.0

    def finished(self, frame: Frame) -> None:
        """Note that everything about the frame is done."""
        if self.live:
            self._latencies_s.append(self._clock() - self._due(frame))

    def hold(self) -> None:
        """Wait for nothing from now on."""
        if self._late_at_hold_s is None:
            self._late_at_hold_s = self._lateness_s()

    def go_on(self) -> None:
        """Frames are due again, the next one its interval after the last, as late as it was when the hold began."""
        if self._late_at_hold_s is not None:
            self._begin_anew(self._late_at_hold_s)
            self._late_at_hold_s = None

    def set_factor(self, factor: float) -> None:
        """Another pace from the last frame on."""
        self._begin_anew(self._lateness_s())
        self.factor = factor

    def shift(self, seconds: float) -> None:
        """Everything is due that much later."""
        self._begun += seconds

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
        if self._begun_ns is None:
            self._begun, self._begun_ns = self._clock(), frame.stamp_ns
        return self._begun + (frame.stamp_ns - self._begun_ns) * 1e-9 / self.factor

    def _is_late(self, frame: Frame) -> bool:
        """Whether the interval since the frame before has passed once more already."""
        return self._clock() - self._due(frame) > frame.dt_s / self.factor > 0.0

    def _lateness_s(self) -> float:
        """How long ago the last frame was due (s); 0 where none was."""
        if self._begun_ns is None or self._last_ns is None or not self.live:
            return 0.0
        return self._clock() - self._begun - (self._last_ns - self._begun_ns) * 1e-9 / self.factor

    def _begin_anew(self, late_s: float) -> None:
        """Count from the last frame on, which was due ``late_s`` ago."""
        if self._last_ns is not None:
            self._begun, self._begun_ns = self._clock() - late_s, self._last_ns
