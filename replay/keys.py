"""Single keys from the terminal, without Enter and without waiting; the terminal is left as it was found.

While the keyboard is open, the terminal neither echoes nor collects lines ("cbreak"). It is put right again at the end,
on an exception, while the process is suspended (Ctrl-Z), and before a signal that ends it. A process in the background
leaves the terminal alone: touching it there would stop the process.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
import time
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any, Final, Self

LOOK_AGAIN_S: Final = 0.2
"""How long to wait at once, before looking whether the terminal is still ours."""
ENDING: Final = ("SIGTERM", "SIGHUP", "SIGQUIT")


class Keyboard:
    """Keys of the terminal ``descriptor`` (standard input); none where that is no terminal.

    ``on_resumed(seconds)`` is called after the process was suspended for so long.
    """

    def __init__(self, descriptor: int | None = None) -> None:
        self._descriptor = descriptor if descriptor is not None else _standard_input()
        self.present = self._descriptor >= 0 and os.isatty(self._descriptor) and _has_modes()
        self.on_resumed: Callable[[float], None] = lambda seconds: None
        self._found: list[Any] | None = None
        self._handlers: dict[int, Any] = {}

    def __enter__(self) -> Self:
        if self.present:
            self._install()
            self._take()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._give_back()
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        self._handlers.clear()

    def read(self, timeout_s: float | None) -> str:
        """The next key, "" where none comes within ``timeout_s``; None waits as long as it takes.

        Once the terminal has gone, ``present`` is False and "" comes at once.
        """
        begun = time.monotonic()
        while self.present:
            left_s = LOOK_AGAIN_S if timeout_s is None else timeout_s - (time.monotonic() - begun)
            pause_s = min(max(left_s, 0.0), LOOK_AGAIN_S)
            if self._in_front():
                self._take()
                if select.select([self._descriptor], [], [], pause_s)[0] and self._in_front():
                    return self._next()
            else:
                time.sleep(pause_s)
            if timeout_s is not None and left_s <= LOOK_AGAIN_S:
                break
        return ""

    def _next(self) -> str:
        try:
            byte = os.read(self._descriptor, 1)
        except OSError:  # a terminal that was closed
            byte = b""
        self.present = bool(byte)
        return byte.decode("ascii", "replace")

    def _in_front(self) -> bool:
        """Whether this process is the one that the terminal belongs to at present."""
        try:
            return os.tcgetpgrp(self._descriptor) == os.getpgrp()
        except OSError:
            return False

    def _take(self) -> None:
        """Single keys from now on."""
        import termios
        import tty

        if self._found is None and self._in_front():
            try:
                found = termios.tcgetattr(self._descriptor)
                tty.setcbreak(self._descriptor, termios.TCSANOW)
            except termios.error:
                self.present = False
            else:
                self._found = found

    def _give_back(self) -> None:
        """The terminal as it was found."""
        import termios

        found, self._found = self._found, None
        if found is not None and self._in_front():
            try:
                termios.tcsetattr(self._descriptor, termios.TCSANOW, found)
            except termios.error:  # it has gone: there is nothing to put right
                self.present = False

    def _install(self) -> None:
        """Signals that would leave the terminal changed; those that somebody chose to ignore stay so."""
        if threading.current_thread() is not threading.main_thread():
            return
        wanted = {signal.SIGTSTP: self._suspended}
        wanted |= {signal.Signals[name]: self._ended for name in ENDING}
        for number, handler in wanted.items():
            if signal.getsignal(number) is not signal.SIG_IGN:
                self._handlers[number] = signal.signal(number, handler)

    def _suspended(self, number: int, frame: FrameType | None) -> None:
        begun = time.monotonic()
        self._give_back()
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)  # returns when somebody lets the process go on
        signal.signal(number, self._suspended)
        self._take()
        self.on_resumed(time.monotonic() - begun)

    def _ended(self, number: int, frame: FrameType | None) -> None:
        self._give_back()
        signal.signal(number, self._handlers.get(number, signal.SIG_DFL))
        os.kill(os.getpid(), number)


def _standard_input() -> int:
    """The descriptor of standard input; −1 where it is closed or replaced."""
    try:
        return sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):
        return -1


def _has_modes() -> bool:
    """Whether this system has terminals of the kind that can be switched to single keys."""
    try:
        import termios  # noqa: F401
    except ImportError:
        return False
    return True
