"""JSON of annotation tools, read as what it is: a stranger's file that may be broken at any place."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scpf.models.errors import DamagedError, InputError, MissingError


def read_json(path: Path, most_bytes: int) -> dict[str, Any]:
    """The object that a JSON file holds. Raises MissingError, DamagedError, and InputError above ``most_bytes``."""
    if not path.is_file():
        raise MissingError(f"{path}: no such file")
    size = path.stat().st_size
    if size > most_bytes:
        raise InputError(f"{path}: {size / 2**20:.0f} MiB, {most_bytes / 2**20:.0f} MiB are the most")
    try:
        document = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise DamagedError(f"{path}: not JSON ({error})") from error
    if not isinstance(document, dict):
        raise InputError(f"{path}: not a JSON object")
    return document


def entries(document: Mapping[str, Any], name: str, where: str) -> list[Mapping[str, Any]]:
    """The list of objects ``name`` of a document."""
    values = document.get(name)
    if not isinstance(values, list):
        raise InputError(f"{where}: no list {name!r}")
    for index, value in enumerate(values):
        if not isinstance(value, dict):
            raise InputError(f"{where}: entry {index} of {name!r} is not an object")
    return values


def text(entry: Mapping[str, Any], name: str, where: str) -> str:
    """The text ``name`` of an entry."""
    value = entry.get(name)
    if not isinstance(value, str):
        raise InputError(f"{where}: {name} is not a text")
    return value


def number(value: object, where: str) -> float:
    """A finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{where}: not a number")
    try:
        finite = float(value)
    except OverflowError as error:
        raise InputError(f"{where}: not a finite number") from error
    if not math.isfinite(finite):
        raise InputError(f"{where}: not a finite number")
    return finite


def whole(value: object, where: str) -> int:
    """A whole number."""
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(f"{where}: not a whole number")
    return value
