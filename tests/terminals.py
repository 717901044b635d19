"""A real pseudo-terminal with a program on it, for the tests of keys."""

from __future__ import annotations

import os
import pty
import select
import subprocess
import sys
import termios
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Any, Self

# The program becomes the one that the terminal belongs to: the first to open it in a session of its own. As at a
# prompt, Ctrl-C, Ctrl-\ and a hang-up reach it, also where the tests themselves run in the background and ignore them.
OPEN = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.signal(signal.SIGQUIT, signal.SIG_DFL)
signal.signal(signal.SIGHUP, signal.SIG_DFL)
os.close(os.open(os.ttyname(0), os.O_RDWR))
os.execvp(sys.argv[1], sys.argv[1:])
"""


class Terminal:
    """A program on a terminal of its own: what it writes is read with `expect`, keys are pressed with `press`."""

    def __init__(self, command: Sequence[str]) -> None:
        self._ours, self._its = pty.openpty()
        self.at_first = self.modes()
        self._seen = ""
        self.process = subprocess.Popen(
            [sys.executable, "-c", OPEN, *command],
            stdin=self._its,
            stdout=self._its,
            stderr=self._its,
            start_new_session=True,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self._ours)
        os.close(self._its)

    def press(self, keys: str) -> None:
        """Keys, one after the other."""
        os.write(self._ours, keys.encode())

    def expect(self, text: str, within_s: float = 60.0) -> str:
        """Read until ``text`` comes; all up to its end."""
        deadline_s = time.monotonic() + within_s
        while text not in self._seen:
            assert time.monotonic() < deadline_s, f"{text!r} does not come: {self._seen[-2000:]!r}"
            if select.select([self._ours], [], [], 0.1)[0]:
                self._seen += os.read(self._ours, 65536).decode(errors="replace")
        before, _, self._seen = self._seen.partition(text)
        return before + text

    def ended(self, within_s: float = 60.0) -> int:
        """The exit status, once there is one; what is written until then is read."""
        deadline_s = time.monotonic() + within_s
        while self.process.poll() is None:
            assert time.monotonic() < deadline_s, f"it does not end: {self._seen[-2000:]!r}"
            if select.select([self._ours], [], [], 0.05)[0]:
                self._seen += os.read(self._ours, 65536).decode(errors="replace")
        return int(self.process.returncode)

    def modes(self) -> list[Any]:
        """How the terminal is set."""
        return termios.tcgetattr(self._its)

    def collects_lines(self) -> bool:
        """Whether it waits for Enter and echoes, as terminals do by themselves."""
        local = self.modes()[3]
        return bool(local & termios.ICANON and local & termios.ECHO)
