"""The line on stderr that says how far a long work is."""

from __future__ import annotations

import sys

_AFRESH = "\r\x1b[K"


class StatusLine:
    """A line that each text replaces; silent with ``quiet``, and where stderr is no terminal."""

    def __init__(self, quiet: bool = False) -> None:
        self.shown = not quiet and sys.stderr.isatty()

    def show(self, text: str) -> None:
        """Put the text in the place of the one before."""
        self._write(_AFRESH + text)

    def clear(self) -> None:
        """Take the line away."""
        self._write(_AFRESH)

    def keep(self) -> None:
        """Leave the line as it is, and go on below it."""
        self._write("\n")

    def _write(self, text: str) -> None:
        if self.shown:
            sys.stderr.write(text)
            sys.stderr.flush()
