"""Decoding messages by the schema of their own channel, so that foreign types read as well as ours."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from scpf.ingest.mcap_index import Channel
from scpf.ingest.messages import definition, typestore
from scpf.models.errors import DamagedError, InputError

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


MAX_DEFINITION_BYTES: Final = 1 << 20


class Decoder:
    """Decodes the CDR messages of one file; a schema that is not the one we know gets its own type store."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._stores: dict[int, Typestore] = {}

    def decode(self, channel: Channel, raw: memoryview, place: str) -> Any:
        """The message, as a rosbags dataclass. InputError for an encoding or schema that cannot be decoded,
        DamagedError for bytes that are not a message of the schema; ``place`` says where in the file.
        """
        store = self._stores.get(channel.id)
        if store is None:
            store = self._stores[channel.id] = schema_store(channel, self._path)
        assert channel.schema is not None
        try:
            return store.deserialize_cdr(raw, channel.schema.name)
        except Exception as error:
            # Generated code: which exception a lying length becomes depends on the type.
            text = f"{self._path}: {place}: not a {channel.schema.name} ({type(error).__name__}: {error})"
            raise DamagedError(text) from error


def schema_store(channel: Channel, path: Path) -> Typestore:
    """A type store that knows the type of a channel. InputError where its schema cannot be read."""
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    schema = channel.schema
    what = f"{path}: {channel.topic}"
    if schema is None or channel.encoding != "cdr":
        name = schema.name if schema else "no type"
        text = f"{what} holds {name} as {channel.encoding or 'an unnamed encoding'}, not ROS 2 messages (cdr)"
        raise InputError(text, "only ROS 2 messages are decoded; leave this topic out")
    if len(schema.data) > MAX_DEFINITION_BYTES:
        raise InputError(f"{what}: a type definition of {len(schema.data)} bytes")
    known = typestore()
    if schema.name in known.fielddefs and schema.data == definition(schema.name):
        return known
    try:
        text = schema.data.decode()
        if schema.encoding == "ros2msg":
            types = get_types_from_msg(text, schema.name)
        elif schema.encoding == "ros2idl":
            types = {}
            separator = "=" * 80 + "\n"
            parts = text.split(separator)[1:] if text.startswith(separator) else [text]
            for part in parts:
                types.update(get_types_from_idl(part.split("\n", 1)[1] if part.startswith("IDL: ") else part))
        else:
            raise InputError(
                f"{what}: a schema in {schema.encoding!r} is not read", "known: ros2msg, ros2idl"
            )
        store = get_typestore(Stores.EMPTY)
        store.register(types)
        store.get_msgdef(schema.name)
    except InputError:
        raise
    except (Exception, RecursionError, struct.error) as error:
        text = f"{what}: the definition of {schema.name} cannot be read ({type(error).__name__}: {error})"
        raise InputError(text) from error
    return store
