"""Message types of bags: which definition an output channel gets, and how its messages pass into it."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, Final

from scpf.ingest.bag_source import BagChannel
from scpf.ingest.ros1_transcode import transcoder
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
    """None where none fits: the messages are then copied, for software that knows their type."""
    convert: Callable[[Bytes], Bytes] | None = None
    """None where messages are copied as they are."""
    counted_header: bool = False
    """ROS 1 only: each message starts with a Header, whose ``seq`` becomes MCAP's sequence number."""
    note: str = ""
    encoding: str = "cdr"
    schema_encoding: str = "ros2msg"
    metadata: dict[str, str] = field(default_factory=dict)
    source_store: Callable[[], Typestore] | None = None
    """Makes what decodes the recording's messages; None where they are copied."""
    store: Typestore | None = None
    """What decodes the output's messages; None where nothing does."""


def passage(channel: BagChannel, first: Bytes | None, encoding: str = "ros2") -> Passage:
    """The passage of a channel into the output. Raises InputError, with the reason, where there is none.

    ``ros1``: the bytes of ROS 1 as they are. ``ros2``: ros2msg and CDR. ROS 2 messages are copied; ``first``, the first
    of them, shows which definition fits; messages that are not ROS at all are copied, too. ROS 1 messages are rewritten
    byte by byte, and get ROS 2's own definition where the fields agree (so that ``K`` of a CameraInfo becomes ``k``),
    else the one in the bag.
    """
    if encoding == "ros1":
        return _kept(channel)
    if channel.encoding not in ("ros1", "cdr"):
        return _foreign(channel)
    if len(channel.definition) > MAX_DEFINITION_BYTES:
        raise InputError(f"a type definition of {len(channel.definition)} bytes")
    return _copied(channel, first) if channel.encoding == "cdr" else _rewritten(channel)


def _kept(channel: BagChannel) -> Passage:
    """ROS 1 as it is, with what its connection says, under the names that other readers of MCAP look for."""
    if channel.encoding != "ros1":
        raise InputError(
            f"messages in {channel.encoding!r} are not ROS 1 messages; --encoding ros2 takes them"
        )
    metadata = {
        "md5sum": channel.md5,
        "callerid": channel.caller,
        "latching": "1" if channel.latching else "",
    }
    metadata = {name: value for name, value in metadata.items() if value}
    name = channel.native_type or channel.type
    return Passage(name, channel.definition, encoding="ros1", schema_encoding="ros1msg", metadata=metadata)


def _foreign(channel: BagChannel) -> Passage:
    """Messages that are not ROS (JSON, protobuf …) pass as they are, with their own schema."""
    note = f"its messages are {channel.encoding}, not ROS: copied as they are"
    return Passage(
        channel.type,
        channel.definition,
        note=note,
        encoding=channel.encoding,
        schema_encoding=channel.definition_format,
        metadata=dict(channel.metadata),
    )


def _copied(channel: BagChannel, first: Bytes | None) -> Passage:
    """Recordings before ROS 2 Iron define no types, and some define them wrongly: a definition has to prove itself."""
    from scpf.ingest.messages import definition, typestore

    name, known = channel.type, typestore()
    metadata = {**dict(channel.metadata), "offered_qos_profiles": channel.qos}
    reason = "the recording does not define it"
    if channel.definition_format:
        try:
            store = _store(_types(channel), name)
            _check(store, name, first)
            verbatim = channel.definition_format == "ros2msg"
            text = channel.definition if verbatim else _generate(store, name)[0].encode()
            return Passage(name, text, metadata=metadata, store=store)
        except InputError as error:
            reason = error.message
    if name in known.fielddefs:
        try:
            _check(known, name, first)
            note = f"{name}: {reason}; ROS 2 Humble's definition is used" if channel.definition_format else ""
            return Passage(name, definition(name), note=note, metadata=metadata, store=known)
        except InputError:
            reason += ", and ROS 2 Humble's definition does not fit"
    note = f"{name}: {reason}; its messages are copied without a definition"
    return Passage(name, None, note=note, schema_encoding="", metadata=metadata)


def _check(store: Typestore, name: str, first: Bytes | None) -> None:
    try:
        if first is not None:
            store.deserialize_cdr(first, name)
    except Exception as error:  # generated code: which exception a wrong layout becomes depends on the type
        raise InputError("the recording's definition does not fit its messages") from error


def _rewritten(channel: BagChannel) -> Passage:
    found = _rewriting(channel.type, channel.definition, channel.md5)
    return replace(found, metadata={"offered_qos_profiles": channel.qos})


@lru_cache(maxsize=256)
def _rewriting(type_name: str, definition_text: bytes, md5: str) -> Passage:
    """The passage of a ROS 1 type: made once, since it takes milliseconds and recordings share their types."""
    channel = BagChannel("", type_name, "ros1", "ros2msg", definition_text, md5, "", 0)
    from scpf.ingest.messages import definition, typestore

    name, known = RENAMED.get(channel.type, channel.type), typestore()
    types = _types(channel)
    if channel.md5 not in ("", "*"):
        have = _generate(_store(types, channel.type), channel.type, 1)[1]
        if have != channel.md5:
            raise InputError(f"the definition of {channel.type} does not match its checksum (md5)")
    if name != channel.type:
        types[name] = types.pop(channel.type)
    source = partial(_store, dict(types), name)
    store = _store({**types, **_ros2_basics(known)}, name)
    header = store.fielddefs[name][1][:1]
    counted = bool(header) and "std_msgs/msg/Header" in header[0][1]
    same = name in known.fielddefs and _same_fields(store, known, name)
    text = definition(name) if same else _generate(store, name)[0].encode()
    within = [sub for _, desc in store.fielddefs[name][1][counted:] for sub in _named(desc)]
    dropped = "std_msgs/msg/Header" in _closure(store, within)
    note = "`seq` of Headers within the messages has no place in ROS 2 and is dropped" if dropped else ""

    direct = transcoder(store, name)

    def convert(raw: Bytes) -> Bytes:
        try:
            return direct(raw) if direct is not None else store.ros1_to_cdr(raw, name)
        except Exception as error:  # generated code, as above
            raise InputError(f"not a {name} ({type(error).__name__}: {error})") from error

    decoder = known if same else store
    return Passage(name, text, convert, counted, note, source_store=source, store=decoder)


def header_sequence(raw: Bytes) -> int:
    """``seq`` of a ROS 1 message that starts with a Header."""
    return int(struct.unpack_from("<I", raw)[0]) if len(raw) >= 4 else 0


def _types(channel: BagChannel) -> dict[str, Any]:
    """The parsed definition of a channel, with all the types that it needs."""
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    text = channel.definition.decode(errors="replace")
    try:
        if channel.definition_format == "ros2msg":
            return dict(get_types_from_msg(text, channel.type))
        if channel.definition_format != "ros2idl":
            raise InputError(f"a definition in {channel.definition_format!r} is not read")
        types: dict[str, Any] = {}
        separator = "=" * 80 + "\n"
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
    from scpf.ingest.messages import typestore

    fields = typestore().fielddefs
    return {
        f"builtin_interfaces/msg/{name}": fields[f"builtin_interfaces/msg/{name}"]
        for name in ("Time", "Duration")
    }


def _ros2_basics(known: Typestore) -> dict[str, Any]:
    """What rosbags' byte-by-byte conversion expects in place of ROS 1's own: a Header without ``seq``."""
    return {"std_msgs/msg/Header": known.fielddefs["std_msgs/msg/Header"], **_time_types()}


def _generate(store: Typestore, name: str, ros_version: int = 2) -> tuple[str, str]:
    """Text and checksum (md5) of a type's definition."""
    try:
        return store.generate_msgdef(name, ros_version=ros_version)
    except Exception as error:
        raise InputError(
            f"the definition of {name} cannot be written ({type(error).__name__}: {error})"
        ) from error


def _same_fields(one: Typestore, other: Typestore, name: str) -> bool:
    """Whether a type has the same layout in two stores, whatever its fields are called."""
    names = _closure(one, [name])
    return all(
        sub in one.fielddefs
        and sub in other.fielddefs
        and [field[1] for field in one.fielddefs[sub][1]] == [field[1] for field in other.fielddefs[sub][1]]
        for sub in names
    )


def _closure(store: Typestore, names: list[str]) -> set[str]:
    """These types and all the message types within them."""
    found: set[str] = set()
    pending = list(names)
    while pending:
        name = pending.pop()
        if name not in found:
            found.add(name)
            for field_ in store.fielddefs[name][1] if name in store.fielddefs else ():
                pending += _named(field_[1])
    return found


def _named(desc: Any) -> list[str]:
    """The message types that a field consists of."""
    from rosbags.interfaces import Nodetype

    if desc[0] == Nodetype.NAME:
        return [str(desc[1])]
    return _named(desc[1][0]) if desc[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE) else []
