"""Tensors of weights files that others made, read without running anything that stands in them.

.pth and .pt files are pickles in an archive, .pkl files are bare pickles: either may name any function to be called.
`torch.load(weights_only=True)` reads the former and allows tensors alone. The unpickler below reads the latter: it
builds plain values and arrays of numbers by itself and knows no other name. Sizes are those of the file: an archive
that is compressed is refused, and an array is as large as the bytes that it came with.
"""

from __future__ import annotations

import io
import pickle
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from torch import Tensor

from scpf.models.errors import DamagedError, InputError, MissingError

LARGEST_BYTES: Final = 2 << 30
LONGEST_NAME: Final = 200
NUMBERS: Final = re.compile(r"[<>|=]?(f[248]|i[1248]|u[1248]|b1)")
CONTAINERS: Final = ("model", "state_dict", "model_state_dict", "ema_state_dict")
AGAIN: Final = "fetch or copy it again"
HOW_TO_SAVE: Final = "save its tensors alone: torch.save(model.state_dict(), FILE)"


class _RefusedError(Exception):
    """Why a pickle is refused."""


def read_tensors(path: Path) -> dict[str, Tensor]:
    """The named tensors of a .pth, .pt, .pkl or .safetensors file, on the CPU, as they stand in it.

    What else a training left beside them (optimizer, schedule) is passed over. Raises MissingError where there is no
    such file, InputError where it holds code or anything but weights, DamagedError where it is not whole.
    """
    if not path.is_file():
        raise MissingError(f"{path}: no such weights file")
    if path.stat().st_size > LARGEST_BYTES:
        raise InputError(f"{path}: larger than the {LARGEST_BYTES >> 30} GiB that weights may have")
    if path.suffix == ".safetensors":
        content: Any = _safetensors(path)
    elif path.suffix == ".pkl":
        content = _pickle(path)
    else:
        content = _torch(path)
    for name in CONTAINERS:
        if isinstance(content, dict) and isinstance(content.get(name), dict):
            content = content[name]
            break
    if not isinstance(content, dict):
        raise InputError(f"{path}: holds a {type(content).__name__}, not named tensors", HOW_TO_SAVE)
    tensors = {name: _tensor(value) for name, value in dict.items(content) if isinstance(name, str)}
    found = {name: value for name, value in tensors.items() if value is not None}
    if not found:
        raise InputError(f"{path}: holds no named tensors", HOW_TO_SAVE)
    for name, value in found.items():
        if not name.isprintable() or len(name) > LONGEST_NAME:
            raise DamagedError(f"{path}: a tensor called {_shown(name)}", AGAIN)
        if value.numel() * value.element_size() > value.untyped_storage().nbytes():
            raise DamagedError(f"{path}: {name} claims to be larger than its bytes", AGAIN)
    return found


def _tensor(value: object) -> Tensor | None:
    if isinstance(value, Tensor):
        return value
    if isinstance(value, _Array) and value.array is not None:
        return torch.from_numpy(value.array)
    return None


def _safetensors(path: Path) -> dict[str, Tensor]:
    try:
        with safe_open(path, framework="pt") as file:
            return {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, OSError) as error:
        raise DamagedError(f"{path}: not a whole safetensors file ({_shown(error)})", AGAIN) from error


def _torch(path: Path) -> object:
    try:
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                if any(member.compress_type != zipfile.ZIP_STORED for member in archive.infolist()):
                    raise InputError(f"{path}: a compressed archive, which torch does not write", AGAIN)
        return torch.load(path, map_location="cpu", weights_only=True)
    except InputError:
        raise
    except Exception as error:  # a damaged pickle may raise anything that its operations can
        refused = re.search(r"GLOBAL ([\w.]+)|`?([\w.]+)`? was not an allowed global", str(error))
        if refused:
            name = refused[1] or refused[2]
            raise InputError(
                f"{path}: holds {name}, not tensors alone; nothing was run", HOW_TO_SAVE
            ) from error
        raise DamagedError(f"{path}: not a whole torch file ({_shown(error)})", AGAIN) from error


def _pickle(path: Path) -> object:
    content = path.read_bytes()
    try:
        return _Unpickler(io.BytesIO(content), encoding="latin1").load()
    except _RefusedError as error:
        raise InputError(
            f"{path}: holds {_shown(error)}; nothing was run", "weights are arrays of numbers by name"
        ) from error
    except Exception as error:  # a damaged pickle may raise anything that its operations can
        raise DamagedError(f"{path}: not a whole pickle ({_shown(error)})", AGAIN) from error


def _shown(said: str | Exception) -> str:
    """What a file or its reader says, as part of one line."""
    lines = str(said).strip().splitlines() or [type(said).__name__]
    return "".join(c if c.isprintable() else "?" for c in lines[0])[:160]


class _Mapping(dict[Any, Any]):
    """An OrderedDict of the file; what it carries beside its items is passed over."""

    def __setstate__(self, state: object) -> None:
        pass


class _NumberType:
    """A dtype of the file: numbers alone, given by their letter and size."""

    def __init__(self, code: object, *_: object) -> None:
        if not isinstance(code, str) or not NUMBERS.fullmatch(code):
            raise _RefusedError(f"values of type {code!r}"[:100])
        self.dtype = np.dtype(code)

    def __setstate__(self, state: object) -> None:
        if isinstance(state, tuple) and len(state) > 1 and state[1] in ("<", ">"):
            self.dtype = self.dtype.newbyteorder(state[1])


class _NdArray:
    """What stands for the class numpy.ndarray itself; it cannot be called to make one."""

    def __new__(cls, *_: object) -> _NdArray:
        raise _RefusedError("an array without its bytes")


class _Array:
    """An array of the file, filled by its state."""

    array: np.ndarray[Any, Any] | None = None

    def __init__(self, kind: object, *_: object) -> None:
        if kind is not _NdArray:
            raise _RefusedError("an array of another kind")

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        shape, number, by_column, content = state[-4:]
        self.array = _numbers(number, content).reshape(shape, order="F" if by_column else "C")


def _array_of_buffer(content: object, number: object, shape: Any, order: object) -> _Array:
    """Protocol 5 writes arrays by another function."""
    array = _Array(_NdArray)
    array.array = _numbers(number, content).reshape(shape, order="F" if order == "F" else "C")
    return array


def _scalar(number: object, content: object) -> float:
    return float(_numbers(number, content)[0])


def _numbers(number: object, content: object) -> np.ndarray[Any, Any]:
    """The numbers that bytes hold, in this machine's byte order; a copy."""
    if not isinstance(number, _NumberType) or not isinstance(content, (bytes, str)):
        raise _RefusedError("an array of objects")
    raw = content if isinstance(content, bytes) else content.encode("latin1")
    return np.frombuffer(raw, number.dtype).astype(number.dtype.newbyteorder("="))


def _encoded(text: object, encoding: object) -> bytes:
    """Protocol 2 writes bytes as text."""
    if not isinstance(text, str) or encoding not in ("latin1", "latin-1"):
        raise _RefusedError("text in another encoding")
    return text.encode("latin1")


_KNOWN: Final[Mapping[tuple[str, str], Any]] = {
    ("collections", "OrderedDict"): _Mapping,
    ("_codecs", "encode"): _encoded,
    ("numpy", "ndarray"): _NdArray,
    ("numpy", "dtype"): _NumberType,
    **{
        (f"numpy.{core}.{module}", name): stand_in
        for core in ("core", "_core")  # before and since numpy 2
        for module, name, stand_in in (
            ("multiarray", "_reconstruct", _Array),
            ("multiarray", "scalar", _scalar),
            ("numeric", "_frombuffer", _array_of_buffer),
        )
    },
}


class _Unpickler(pickle._Unpickler):
    """In Python, as the one in C sizes its memory by numbers that stand in the file."""

    # A bytearray would be made before its bytes are there; bytes are only as long as what is there.
    dispatch: ClassVar[dict[int, Any]] = {
        **pickle._Unpickler.dispatch,
        pickle.BYTEARRAY8[0]: pickle._Unpickler.dispatch[pickle.BINBYTES8[0]],
    }

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in _KNOWN:
            raise _RefusedError(f"{_shown(module)}.{_shown(name)}, not tensors alone")
        return _KNOWN[module, name]

    def get_extension(self, code: int) -> None:
        raise _RefusedError(f"the extension {code}")

    def persistent_load(self, pid: object) -> Any:
        raise _RefusedError("references to another file")
