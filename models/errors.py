"""The one exception family of scpf.

ScpfError                 caught once, at the command line: one line, a hint, exit 1
├── InputError            a file or a value that cannot be used: names the file and the place
│   └── DamagedError      the file is recognised, but cut short, corrupt or lying about its sizes
├── UsageError            the call itself is wrong: exit 2
└── MissingError          something that the job needs is not there (a map, a calibration, a model)
"""

from __future__ import annotations


class ScpfError(Exception):
    """What went wrong, in one line, and what to do about it.

    ``message`` names file and place; ``hint`` says the remedy (may be empty).
    """

    exit_code = 1

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


class InputError(ScpfError):
    """A file or a value that cannot be used as it is."""


class DamagedError(InputError):
    """A recognised file that is cut short, corrupt, or declares sizes that it does not keep."""


class UsageError(ScpfError):
    """The call itself is wrong."""

    exit_code = 2


class MissingError(ScpfError):
    """Something that the job needs was neither in the log nor given."""
