"""Settings in a file: TOML that a person writes, or the JSON that an earlier replay left, to run it again.

A file holds the fields of `scpf.replay.settings.Settings` that differ from its preset. What it says is checked against
the types there, so that a slip of the pen is named and never becomes a default.
"""

from __future__ import annotations

import dataclasses
import difflib
import json
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Final, Literal, Union, get_args, get_origin, get_type_hints

from scpf.models.errors import UsageError
from scpf.replay.settings import Settings, preset

LARGEST_BYTES: Final = 16_000_000


def read_settings(path: Path, preset_name: str | None = None) -> Settings:
    """The settings of a file: its preset's (or that of ``preset_name``), with what the file says in their place.

    ``path``: TOML, or the NAME.json of an earlier replay. Raises UsageError naming the file and the field.
    """
    return settings_of_document(_document(path), path, preset_name)


def settings_of_document(document: Mapping[str, Any], path: Path, preset_name: str | None = None) -> Settings:
    """As `read_settings`, of what a file ``path`` (named in errors) was read into."""
    name = document.get("preset", "paper") if preset_name is None else preset_name
    if not isinstance(name, str):
        raise UsageError(f"{path}: preset is not a name", 'write preset = "default"')
    settings: Settings = _replaced(preset(name), {**document, "preset": name}, path, "")
    return settings


def to_toml(settings: Settings) -> str:
    """The settings as TOML that `read_settings` takes back; what is not set stands as a comment."""
    return _table(settings, "").lstrip("\n")


def _document(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise UsageError(f"{path} is too large for settings")
        text = path.read_text("utf-8")
        document = json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
    except OSError as error:
        raise UsageError(f"{path} cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:  # of TOML, of JSON, and of UTF-8
        hint = "settings are TOML, or the NAME.json of an earlier replay"
        raise UsageError(f"{path}: {error}", hint) from error
    if path.suffix == ".json":
        document = document.get("settings") if isinstance(document, dict) else None
    if not isinstance(document, dict):
        raise UsageError(f"{path} holds no settings", "is it the NAME.json of a replay?")
    return document


def _replaced(record: Any, values: Mapping[str, Any], path: Path, place: str) -> Any:
    """``record`` (a dataclass) with ``values`` in place of its own."""
    hints = get_type_hints(type(record))
    changes = {}
    for name, value in values.items():
        where = f"{place}{name}"
        if name not in hints:
            near = difflib.get_close_matches(name, hints, 1)
            hint = f"did you mean {place}{near[0]}?" if near else f"known: {', '.join(hints)}"
            raise UsageError(f"{path}: no setting {where!r}", hint)
        changes[name] = _converted(hints[name], value, getattr(record, name), path, where)
    return dataclasses.replace(record, **changes)


def _converted(kind: Any, value: Any, current: Any, path: Path, where: str) -> Any:
    """``value`` as the type ``kind``; UsageError where it is none."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        if value is None and NoneType in arguments:
            return None
        kind = next(argument for argument in arguments if argument is not NoneType)
        return _converted(kind, value, current, path, where)
    if dataclasses.is_dataclass(kind):
        if isinstance(value, Mapping):
            make: Any = kind
            return _replaced(make() if current is None else current, value, path, f"{where}.")
    elif origin is Literal:
        if value in arguments:
            return value
        raise UsageError(f"{path}: {where} = {value!r}", f"one of {', '.join(map(str, arguments))}")
    elif origin is tuple:
        if isinstance(value, list):
            kinds = arguments[:1] * len(value) if arguments[-1:] == (...,) else arguments
            if len(kinds) == len(value):
                pairs = zip(kinds, value, strict=True)
                return tuple(_converted(each, one, None, path, where) for each, one in pairs)
    elif kind is float:
        if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value):
            return float(value)
    elif type(value) is kind:
        return value
    wanted = "a table" if dataclasses.is_dataclass(kind) else getattr(kind, "__name__", str(kind))
    if origin is tuple:
        wanted = "a list of " + ("numbers" if float in arguments else "pairs")
    raise UsageError(f"{path}: {where} = {value!r} is not {wanted}")


def _table(record: Any, prefix: str) -> str:
    """A dataclass as a TOML table: its plain fields, then its tables."""
    lines, tables = [], []
    for field in dataclasses.fields(record):
        value = getattr(record, field.name)
        if dataclasses.is_dataclass(value):
            name = f"{prefix}{field.name}"
            tables.append(f"\n[{name}]\n{_table(value, f'{name}.')}")
        elif value is None:
            lines.append(f"# {field.name} is not set\n")
        else:
            # JSON's strings, numbers, booleans and lists are TOML's.
            lines.append(f"{field.name} = {json.dumps(value)}\n")
    return "".join(lines + tables)
