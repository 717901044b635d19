"""The stages of one step: how long each took, and which failed.

A stage that fails on a frame must not end the replay: the step goes on with less, and the frame says so.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TypeVar

from scpf.replay.step import Frame

Result = TypeVar("Result")


def failure(error: Exception) -> str:
    """What went wrong, for the log lane."""
    return f"{type(error).__name__}: {error}"


@dataclass
class Stages:
    """Those of one step. ``timing_s``: by name; ``problems``: as those of `Frame`."""

    timing_s: dict[str, float] = field(default_factory=dict)
    problems: list[tuple[str, str]] = field(default_factory=list)

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        """Add the seconds that the block takes to ``timing_s[name]``."""
        begun = time.perf_counter()
        yield
        self.timing_s[name] = self.timing_s.get(name, 0.0) + time.perf_counter() - begun

    def attempt(self, what: str, run: Callable[[], Result], otherwise: Callable[[], Result]) -> Result:
        """The result of ``run``; where it fails, that of ``otherwise``, and a problem of ``what``."""
        try:
            return run()
        except Exception as error:  # whatever is wrong with one frame, the others are worth having
            self.problems.append((f"{what} that failed", failure(error)))
            return otherwise()

    def told(self, frame: Frame) -> Frame:
        """The frame with what failed among its problems."""
        return replace(frame, problems=(*frame.problems, *self.problems)) if self.problems else frame
