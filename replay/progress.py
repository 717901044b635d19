"""Progress of a replay on stderr: frames, rate, share of real time, time left."""

from __future__ import annotations

import sys
import time
from types import TracebackType

from scpf.replay.step import Step


class Progress:
    """A progress line that is redrawn at most ten times a second; silent where stderr is no terminal."""

    def __init__(self, quiet: bool) -> None:
        self._shown = not quiet and sys.stderr.isatty()
        self._begun = self._drawn = time.monotonic()
        self._first_ns = 0

    def __enter__(self) -> Progress:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._shown:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()

    def step(self, step: Step, done: int, total: int) -> None:
        """Note one finished frame of ``total``."""
        now = time.monotonic()
        if done == 1:
            # The first frame pays for loading the network: the rate counts from its end.
            self._begun, self._first_ns = now, step.frame.stamp_ns
        if not self._shown or (now - self._drawn < 0.1 and done < total):
            return
        self._drawn = now
        elapsed = max(now - self._begun, 1e-3)
        rate = (done - 1) / elapsed
        real_time = (step.frame.stamp_ns - self._first_ns) * 1e-9 / elapsed
        left = (total - done) / rate if rate else 0.0
        sys.stderr.write(
            f"\r\x1b[Kframe {done}/{total}  {rate:.1f} frames/s  {real_time:.2f} × real time  {left:.0f} s left"
        )
        sys.stderr.flush()
