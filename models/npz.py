"""Arrays out of .npz and .npy files that nobody vouches for: no pickle, bounded size, one kind of error."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from tokenize import TokenError
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import DamagedError

DAMAGE: Final = (
    *(zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError, KeyError),
    # numpy evaluates an array's header as Python text, and allocates what it claims.
    *(SyntaxError, TokenError, MemoryError, OverflowError, TypeError),
    RuntimeError,  # zipfile: an entry that says that it is encrypted, or of a later version of the format
)


def load_arrays(path: Path, limit_bytes: int) -> dict[str, NDArray[Any]]:
    """Every array of an .npz by name, or that of an .npy under "".

    Raises DamagedError, naming the file, for one that is cut short, corrupt, pickled, or would unpack to more than
    ``limit_bytes``.
    """
    try:
        if zipfile.is_zipfile(path):
            # The size on disk says nothing about a compressed array: the archive's own table is read first.
            with zipfile.ZipFile(path) as archive:
                if sum(entry.file_size for entry in archive.infolist()) > limit_bytes:
                    raise ValueError(f"it would unpack to more than {limit_bytes >> 20} MiB")
            with np.load(path, allow_pickle=False) as members:
                return {name: members[name] for name in members.files}
        if path.suffix.lower() == ".npz":
            raise ValueError("not an .npz archive")
        if path.stat().st_size > limit_bytes:
            raise ValueError(f"it is larger than {limit_bytes >> 20} MiB")
        with path.open("rb") as file:
            return {"": np.lib.format.read_array(file, allow_pickle=False)}
    except DAMAGE as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise DamagedError(f"{path}: cannot be read as numpy arrays ({reason})") from error
