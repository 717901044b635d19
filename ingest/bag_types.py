"""Message types of bags: which definition an output channel gets, and how its messages become CDR."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from scpf.ingest.bag_sources import BagChannel
from scpf.ingest.messages import definition, typestore
from scpf.models.errors import InputError

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

Bytes = bytes | memoryview

RENAMED: Final = {"tf/msg/tfMessage": "tf2_msgs/msg/TFMessage"}
"""ROS 1 types that ROS 2 knows by another name, with the same fields."""
MAX_DEFINITION_BYTES: Final = 1 << 20


@dataclass(frozen=True)
class Passage:
    """How the messages of a channel pass into the output; ``convert`` raises InputError where bytes do not fit."""

    type: str
    definition: bytes | None
    """ros2msg; None where none fits: the messages are then copied, for software that knows their type."""
    convert: Callable[[Bytes], Bytes]
    counted_header: bool = False
    """ROS 1 only: each message starts with a Header, whose ``seq`` becomes MCAP's sequence number."""
    note: str = ""


def passage(channel: BagChannel, first: Bytes | None) -> Passage:
    """The passage of a channel to ros2msg and CDR. Raises InputError, with the reason, where there is none.

    ROS 2 messages are copied; ``first``, the first of them, shows which definition fits. ROS 1 messages are
    rewritten byte by byte, and get ROS 2's own definition where the fields agree (so that ``K`` of a CameraInfo
    becomes ``k``), else the one in the bag.
    """
    if channel.encoding not in ("ros1", "cdr"):
        raise InputError(f"messages in {channel.encoding!r} are not ROS messages")
    if len(channel.definition) > MAX_DEFINITION_BYTES:
        raise InputError(f"a type definition of {len(channel.definition)} characters")
    return _copied(channel, first) if channel.encoding == "cdr" else _rewritten(channel)


def _copied(channel: BagChannel, first: Bytes | None) -> Passage:
    """Recordings before ROS 2 Iron define no types, and some define them wrongly: a definition has to prove itself."""
    name, known = channel.type, typestore()
    reason = "the recording does not define it"
    if channel.definition_format:
        try:
            store = _store(_types(channel), name)
            _check(store, name, first)
            verbatim = channel.definition_format == "ros2msg"
            return Passage(
                name, channel.definition.encode() if verbatim else _generate(store, name), _unchanged
            )
        except InputError as error:
            reason = error.message
    if name in known.fielddefs:
        try:
            _check(known, name, first)
            note = f"{name}: {reason}; ROS 2 Humble's definition is used" if channel.definition_format else ""
            return Passage(name, definition(name), _unchanged, note=note)
        except InputError:
            reason += ", and ROS 2 Humble's definition does not fit"
    return Passage(
        name, None, _unchanged, note=f"{name}: {reason}; its messages are copied without a definition"
    )


def _check(store: Typestore, name: str, first: Bytes | None) -> None:
    try:
        if first is not None:
            store.deserialize_cdr(first, name)
    except Exception as error:  # generated code: which exception a wrong layout becomes depends on the type
        raise InputError("the recording's definition does not fit its messages") from error


def _rewritten(channel: BagChannel) -> Passage:
    name, known = RENAMED.get(channel.type, channel.type), typestore()
    types = _types(channel)
    if channel.md5 not in ("", "*"):
        have = _store(types, channel.type).generate_msgdef(channel.type, ros_version=1)[1]
        if have != channel.md5:
            raise InputError(f"the definition of {channel.type} does not match its checksum (md5)")
    if name != channel.type:
        types[name] = types.pop(channel.type)
    store = _store({**types, **_ros2_basics(known)}, name)
    header = store.fielddefs[name][1][:1]
    counted = bool(header) and "std_msgs/msg/Header" in header[0][1]
    same = name in known.fielddefs and _same_fields(store, known, name, 0)
    text = definition(name) if same else _generate(store, name)

    def convert(raw: Bytes) -> Bytes:
        try:
            return store.ros1_to_cdr(raw, name)
        except Exception as error:  # generated code, as above
            raise InputError(f"not a {name} ({type(error).__name__}: {error})") from error

    return Passage(name, text, convert, counted)


def header_sequence(raw: Bytes) -> int:
    """``seq`` of a ROS 1 message that starts with a Header."""
    return int(struct.unpack_from("<I", raw)[0]) if len(raw) >= 4 else 0


def _unchanged(raw: Bytes) -> Bytes:
    return raw


def _types(channel: BagChannel) -> dict[str, Any]:
    """The parsed definition of a channel, with all the types that it needs."""
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    try:
        if channel.definition_format == "ros2msg":
            return dict(get_types_from_msg(channel.definition, channel.type))
        if channel.definition_format != "ros2idl":
            raise InputError(f"a definition in {channel.definition_format!r} is not read")
        types: dict[str, Any] = {}
        separator = "=" * 80 + "\n"
        text = channel.definition
        for part in text.split(separator)[1:] if text.startswith(separator) else [text]:
            types.update(get_types_from_idl(part.split("\n", 1)[1] if part.startswith("IDL: ") else part))
        return types
    except InputError:
        raise
    except Exception as error:  # the parser's own errors, and what broken text makes of it
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"the definition of {channel.type} cannot be read ({reason[:120]})") from error


def _store(types: dict[str, Any], name: str) -> Typestore:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.EMPTY)
    try:
        basics = {key: value for key, value in _time_types().items() if key not in types}
        store.register({**basics, **types})
        store.get_msgdef(name)
    except Exception as error:
        raise InputError(
            f"the definition of {name} cannot be used ({type(error).__name__}: {error})"
        ) from error
    return store


def _time_types() -> dict[str, Any]:
    """ROS 1's time and duration, which its definitions take for granted."""
    fields = typestore().fielddefs
    return {
        f"builtin_interfaces/msg/{name}": fields[f"builtin_interfaces/msg/{name}"]
        for name in ("Time", "Duration")
    }


def _ros2_basics(known: Typestore) -> dict[str, Any]:
    """What rosbags' byte-by-byte conversion expects in place of ROS 1's own: a Header without ``seq``."""
    return {"std_msgs/msg/Header": known.fielddefs["std_msgs/msg/Header"], **_time_types()}


def _generate(store: Typestore, name: str) -> bytes:
    try:
        return store.generate_msgdef(name, ros_version=2)[0].encode()
    except Exception as error:
        raise InputError(f"the definition of {name} cannot be written ({error})") from error


def _same_fields(one: Typestore, other: Typestore, name: str, depth: int) -> bool:
    """Whether a type has the same layout in two stores, whatever its fields are called."""
    if name not in one.fielddefs or name not in other.fielddefs or depth > 32:
        return False
    mine, theirs = ([field[1] for field in store.fielddefs[name][1]] for store in (one, other))
    return mine == theirs and all(
        _same_fields(one, other, sub, depth + 1) for desc in mine for sub in _named(desc)
    )


def _named(desc: Any) -> list[str]:
    """The message types that a field consists of."""
    from rosbags.interfaces import Nodetype

    if desc[0] == Nodetype.NAME:
        return [str(desc[1])]
    return _named(desc[1][0]) if desc[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE) else []
