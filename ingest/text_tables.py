"""Text files of numbers: a header, then rows of equally many numbers."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import DamagedError, InputError

Array = NDArray[np.float64]

MAX_TEXT_BYTES: Final = 1 << 30
HEADER_BYTES: Final = 1 << 16
MAX_COLUMNS: Final = 256


def header_lines(head: bytes) -> list[str]:
    """The lines of a file's first bytes; a byte that is no ASCII becomes a replacement character."""
    return head[:HEADER_BYTES].removeprefix(b"\xef\xbb\xbf").decode("ascii", errors="replace").split("\n")


def read_head(path: Path) -> bytes:
    """The first bytes of a text file. Raises InputError where it cannot be read or is too large to be one."""
    try:
        size = path.stat().st_size
        if size == 0:
            raise DamagedError(f"{path} is empty (0 bytes)", "copy or export it again")
        if size > MAX_TEXT_BYTES:
            raise InputError(f"{path} has {size} bytes, more than 1 GiB", "export a part of the drive")
        with path.open("rb") as file:
            return file.read(HEADER_BYTES)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from error


def read_rows(path: Path, skip_lines: int, columns: int, delimiter: str | None) -> Array:
    """The numbers (N, columns) after ``skip_lines`` lines. Raises DamagedError naming line and byte."""
    try:
        with path.open(encoding="latin-1", newline="") as file:
            for _ in range(skip_lines):
                file.readline()
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # no row at all: refused below
                rows: Array = np.loadtxt(file, delimiter=delimiter, comments=None, ndmin=2)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise _damage(path, skip_lines, columns, delimiter, str(error)) from error
    if not rows.size:
        raise DamagedError(f"{path} ends after its header of {skip_lines} lines: no row", "export it again")
    if rows.shape[1] != columns:
        raise _damage(path, skip_lines, columns, delimiter, f"{rows.shape[1]} columns")
    return rows


def _damage(path: Path, skip_lines: int, columns: int, delimiter: str | None, text: str) -> DamagedError:
    """The first row that is not ``columns`` numbers, searched line by line."""
    hint = "was the file cut off? delete the line, or export the file again"
    offset = 0
    with path.open("rb") as file:
        for number, line in enumerate(file, 1):
            cells = line.decode("latin-1").split(delimiter)
            if number > skip_lines and line.strip():
                place = f"{path}:{number} (byte {offset})"
                if len(cells) != columns:
                    return DamagedError(
                        f"{place}: {len(cells)} columns, and the header names {columns}", hint
                    )
                for cell in cells:
                    try:
                        float(cell)
                    except ValueError:
                        return DamagedError(f"{place}: {cell.strip()[:40]!r} is not a number", hint)
            offset += len(line)
    return DamagedError(f"{path}: {text}", hint)
