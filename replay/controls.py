"""A replay in the hands of whoever sits at the terminal: pause, single frames, another pace, an early end."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Final

from scpf.replay.keys import Keyboard
from scpf.replay.pace import Pace

HINT: Final = "space pauses and goes on, n is one frame while paused, + and - change the pace, q ends"
PAUSE, END = " ", "qQ"
ONE_FRAME: Final = "nN\r\n"
FASTER, SLOWER = "+=", "-_"
FASTEST, SLOWEST = 16.0, 1.0 / 16.0


class Controls:
    """Takes the keys between two frames, and while the pace sleeps. Without a keyboard nothing happens.

    With ``stepping`` every replay begins paused after its first frame. ``ended`` says that the replay was told to end;
    ``waited_s`` is the time spent paused or suspended, which is nobody's fault.
    """

    def __init__(
        self,
        keyboard: Keyboard | None = None,
        stepping: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._keyboard = keyboard
        self._clock = clock
        self._pace: Pace | None = None
        self._factor: float | None = None
        self._waiting = False
        self.paused = stepping
        self.ended = False
        self.waited_s = 0.0
        self.on_change: Callable[[], None] = lambda: None
        if keyboard is not None:
            keyboard.on_resumed = self._resumed

    def govern(self, pace: Pace) -> None:
        """Act on this pace from now on. What was changed by a key stays changed."""
        self._pace = pace
        if self._factor is not None:
            pace.set_factor(self._factor)
        if self.paused:
            pace.hold()

    def sleep(self, seconds: float) -> None:
        """Sleep, at most until a key is pressed, and do what it says."""
        if self._keyboard is None or not self._keyboard.present:
            time.sleep(seconds)
        else:
            self._act(self._keyboard.read(seconds))

    def goes_on(self) -> bool:
        """Whether there is to be a next frame: after the keys that were pressed and, while paused, those to come."""
        if self._keyboard is None:
            return True
        begun, self._waiting = self._clock(), True
        while not self.ended:
            key = self._keyboard.read(None if self.paused else 0.0)
            if self.paused and key and key in ONE_FRAME:
                break
            self._act(key)
            if not self._keyboard.present and self.paused:  # nobody is left to let it go on
                self.ended = True
            if not key and not self.paused:
                break
        self.waited_s += self._clock() - begun
        self._waiting = False
        return not self.ended

    def state(self) -> str:
        """What a display says of pace and pause; "" where nobody has touched them."""
        if self.paused:
            return "paused"
        if self._factor is None:
            return ""
        return "pace max" if math.isinf(self._factor) else f"pace {self._factor:g}"

    def _act(self, key: str) -> None:
        if not key or self._pace is None:
            return
        if key == PAUSE:
            self.paused = not self.paused
            if self.paused:
                self._pace.hold()
            else:
                self._pace.go_on()
        elif key in END:
            self.ended = True
            self._pace.hold()  # nothing is waited for any more
        elif key in FASTER or key in SLOWER:
            self._factor = _changed(self._pace.factor, key in FASTER)
            self._pace.set_factor(self._factor)
        else:
            return
        self.on_change()

    def _resumed(self, seconds: float) -> None:
        """The process was suspended for that long."""
        if not self._waiting:  # else it is counted already
            self.waited_s += seconds
            if self._pace is not None:
                self._pace.shift(seconds)


def _changed(factor: float, faster: bool) -> float:
    """Twice or half the pace; beyond the fastest lies ``max``, and down from there real time."""
    if math.isinf(factor):
        return factor if faster else 1.0
    doubled = factor * 2.0
    if faster:
        return math.inf if doubled > FASTEST else doubled
    return max(factor / 2.0, SLOWEST)
