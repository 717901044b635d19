"""Progress of a replay on stderr: frames, rate, share of real time, time left."""

from __future__ import annotations

import sys
import time
from types import TracebackType

from scpf.replay.controls import Controls
from scpf.replay.status_line import StatusLine
from scpf.replay.step import Step


class Progress:
    """A progress line that is redrawn at most ten times a second; silent where stderr is no terminal.

    What ``controls`` waited does not count, and the line ends with their state.
    """

    def __init__(self, quiet: bool, controls: Controls | None = None) -> None:
        self._status = StatusLine(quiet)
        self._controls = controls or Controls()
        self._controls.on_change = self._draw
        self._begun = self._drawn = self._now()
        self._first_ns = 0
        self._line = ""

    def __enter__(self) -> Progress:
        self._line = "getting ready (the first replay on a machine compiles for some 15 s)"
        self._draw()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._status.clear()

    def say(self, text: str) -> None:
        """A line that stays."""
        if self._status.shown:
            print(text, file=sys.stderr)

    def step(self, step: Step, done: int, total: int) -> None:
        """Note one finished frame of ``total``."""
        now = self._now()
        if done == 1:
            # The first frame pays for loading the network: the rate counts from its end.
            self._begun, self._first_ns = now, step.frame.stamp_ns
        hurried = now - self._drawn < 0.1 and done < total and not self._controls.paused
        if not self._status.shown or hurried:
            return
        self._drawn = now
        elapsed = max(now - self._begun, 1e-3)
        rate = (done - 1) / elapsed
        real_time = (step.frame.stamp_ns - self._first_ns) * 1e-9 / elapsed
        left = (total - done) / rate if rate else 0.0
        self._line = (
            f"frame {done}/{total}  {rate:.1f} frames/s  {real_time:.2f} × real time  {left:.0f} s left"
        )
        self._draw()

    def _draw(self) -> None:
        self._status.show("  ".join(part for part in (self._line, self._controls.state()) if part))

    def _now(self) -> float:
        """Time (s) without what was spent waiting for somebody."""
        return time.monotonic() - self._controls.waited_s
