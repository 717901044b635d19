"""Records and chunks of ROS 1 bags (format 2.0, wiki.ros.org/Bags/Format/2.0): parsed and unpacked within bounds.

A record is a header (fields name=value) and data, each with its length before it. Nothing here believes a length:
what reaches past its end, or unpacks to more than it declares, is cut off and said.
"""

from __future__ import annotations

import bz2
import struct
from dataclasses import dataclass, field
from itertools import permutations
from typing import Any, Final, NamedTuple

MAX_CHUNK_BYTES: Final = 512 << 20
MAX_HEADER_BYTES: Final = 1 << 20
MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
PIECE_BYTES: Final = 1 << 16

Bytes = bytes | memoryview
Fields = dict[bytes, bytes]
Place = tuple[int, int, int, int]
"""Log time (ns), first and last byte of the data within the chunk, connection."""


class Connection(NamedTuple):
    """What a bag says of a publisher: its topic, and the header of its connection."""

    topic: str
    type: str
    """package/Name."""
    definition: bytes
    md5: str
    caller: str
    latching: bool


@dataclass
class Records:
    """The records of a chunk. ``problem``: why it ends too early, empty where it does not."""

    messages: list[Place] = field(default_factory=list)
    connections: dict[int, Connection] = field(default_factory=dict)
    problem: str = ""


class _Layout(NamedTuple):
    """A message header as it is written again and again: what stands around its connection and its time."""

    unpack: Any
    second: int
    """Where in the unpacked values the second of the three constant parts stands."""
    parts: tuple[bytes, bytes, bytes]
    connection: int
    seconds: int


def _layouts() -> dict[tuple[bytes, ...], _Layout]:
    heads = {b"conn": b"\x09\0\0\0conn=", b"op": b"\x04\0\0\0op=\x02", b"time": b"\x0d\0\0\0time="}
    found = {}
    for order in permutations(heads):
        parts, values = [b"\x26\0\0\0"], []
        for name in order:
            parts[-1] += heads[name]
            if name != b"op":
                values.append("I" if name == b"conn" else "II")
                parts.append(b"")
        layout = f"<{len(parts[0])}s{values[0]}{len(parts[1])}s{values[1]}{len(parts[2])}sI"
        connection, seconds = (1, 3) if values[0] == "I" else (4, 1)
        second = 1 + len(values[0])
        found[order] = _Layout(
            struct.Struct(layout).unpack_from, second, (parts[0], parts[1], parts[2]), connection, seconds
        )
    return found


_LAYOUTS: Final = _layouts()
_HEAD_BYTES: Final = 46


def parse_fields(data: Bytes) -> Fields:
    """The fields of a record's header; ValueError where they do not fill it exactly."""
    fields: Fields = {}
    position, size = 0, len(data)
    while position < size:
        if position + 4 > size:
            raise ValueError("a header that is cut short")
        (length,) = struct.unpack_from("<I", data, position)
        position += 4
        if length > size - position:
            raise ValueError(f"a header field of {length} bytes where {size - position} are left")
        name, sign, value = bytes(data[position : position + length]).partition(b"=")
        if not sign:
            raise ValueError("a header field without a name")
        fields[name] = value
        position += length
    return fields


def number(fields: Fields, name: bytes, layout: str) -> int:
    """A number out of a header, such as ``<I``; ValueError where it is missing or has another size."""
    value = fields.get(name, b"")
    if len(value) != struct.calcsize(layout):
        raise ValueError(f"a record without a usable {name.decode()!r}")
    return int(struct.unpack(layout, value)[0])


def time_ns(value: bytes) -> int:
    """Nanoseconds of a time in a header; ValueError for another number of bytes than 8."""
    if len(value) != 8:
        raise ValueError("a record without a usable 'time'")
    seconds, nanoseconds = struct.unpack("<II", value)
    return int(seconds * 10**9 + nanoseconds)


def parse_connection(fields: Fields, data: Bytes) -> tuple[int, Connection]:
    """Number and content of a connection record; ValueError where something necessary is missing."""
    inner = parse_fields(data)
    if b"topic" not in fields or b"type" not in inner:
        raise ValueError("a connection without topic or type")

    def text(source: Fields, name: bytes) -> str:
        return source.get(name, b"").decode(errors="replace")

    latching = inner.get(b"latching", b"").strip() in (b"1", b"true", b"True")
    found = Connection(
        text(fields, b"topic"), text(inner, b"type"), inner.get(b"message_definition", b""),
        text(inner, b"md5sum"), text(inner, b"callerid"), latching,
    )  # fmt: skip
    return number(fields, b"conn", "<I"), found


def read_records(data: memoryview) -> Records:
    """Messages and connections of an unpacked chunk, one after the other, up to the first that is not whole."""
    found = Records()
    messages = found.messages
    position, size = 0, len(data)
    layout = _LAYOUTS[b"conn", b"op", b"time"]
    unpack, second_at, (first, second, third), connection_at, seconds_at = layout
    try:
        while position < size:
            if position + _HEAD_BYTES <= size:
                values = unpack(data, position)
                # The frequent case: a message header of the same layout as the last one.
                if values[0] == first and values[second_at] == second and values[5] == third:
                    start = position + _HEAD_BYTES
                    stop = start + values[-1]
                    if stop > size:
                        raise ValueError(f"a message of {values[-1]} bytes where {size - start} are left")
                    stamp = values[seconds_at] * 1_000_000_000 + values[seconds_at + 1]
                    messages.append((stamp, start, stop, values[connection_at]))
                    position = stop
                    continue
            fields, start, stop = record_at(data, position)
            operation = number(fields, b"op", "<B")
            if operation == MESSAGE:
                place = (time_ns(fields.get(b"time", b"")), start, stop, number(fields, b"conn", "<I"))
                messages.append(place)
                layout = _LAYOUTS.get(tuple(fields), layout)
                unpack, second_at, (first, second, third), connection_at, seconds_at = layout
            elif operation == CONNECTION:
                key, connection = parse_connection(fields, data[start:stop])
                found.connections.setdefault(key, connection)
            else:
                raise ValueError(f"a record of kind {operation} within a chunk")
            position = stop
    except ValueError as error:
        found.problem = str(error)
    return found


def record_at(data: Bytes, position: int) -> tuple[Fields, int, int]:
    """Header of the record at a place, and where its data begin and end; ValueError where it is not whole."""
    size = len(data)
    if position + 4 > size:
        raise ValueError(f"{size - position} bytes that are no record")
    (length,) = struct.unpack_from("<I", data, position)
    start = position + 4 + length
    if length > MAX_HEADER_BYTES or start + 4 > size:
        raise ValueError(f"a record header of {length} bytes where {size - position - 4} are left")
    fields = parse_fields(data[position + 4 : start])
    (length,) = struct.unpack_from("<I", data, start)
    if start + 4 + length > size:
        raise ValueError(f"a record of {length} bytes where {size - start - 4} are left")
    return fields, start + 4, start + 4 + length


def unpack_chunk(compression: str, data: memoryview, size: int) -> tuple[memoryview, str]:
    """What can be unpacked of a chunk that declares ``size`` bytes, and what is wrong with it (or nothing).

    Never makes more than ``size`` bytes and a block, whatever the compressed data ask for.
    """
    if size > MAX_CHUNK_BYTES:
        return memoryview(b""), f"a chunk that declares {size} bytes, more than {MAX_CHUNK_BYTES >> 20} MiB"
    if compression == "none":
        # Nothing to unpack: the length of the record counts, whatever its header says.
        return data, "" if len(data) == size else f"a chunk that declares {size} bytes holds {len(data)}"
    if compression == "bz2":
        found, problem = _unpacked(bz2.BZ2Decompressor, data, size)
    elif compression == "lz4":
        import lz4.frame

        found, problem = _unpacked(lz4.frame.LZ4FrameDecompressor, data, size)
    else:
        return memoryview(b""), f"compression {compression[:40]!r} is not known (known: none, bz2, lz4)"
    if len(found) > size:
        return found[:size], f"a chunk that declares {size} bytes holds more"
    if len(found) < size and not problem:
        problem = f"a chunk that declares {size} bytes holds {len(found)}"
    return found, problem


def _unpacked(make: Any, data: memoryview, size: int) -> tuple[memoryview, str]:
    try:
        decompressor = make()
        whole = decompressor.decompress(data, max_length=size + 1)
        if decompressor.eof or len(whole) > size:
            return memoryview(whole), ""
    except (OSError, RuntimeError, EOFError, ValueError):
        pass
    # Piece by piece: what comes before the damage can be kept.
    decompressor, parts, made, problem = make(), [], 0, "compressed data that are cut short"
    try:
        for start in range(0, len(data), PIECE_BYTES):
            piece: Bytes = data[start : start + PIECE_BYTES]
            while made <= size:
                part = decompressor.decompress(piece, max_length=min(size + 1 - made, 1 << 20))
                parts.append(part)
                made += len(part)
                piece = b""
                if decompressor.eof or decompressor.needs_input:
                    break
            if decompressor.eof or made > size:
                break
    except (OSError, RuntimeError, EOFError, ValueError) as error:
        problem = f"damaged compressed data ({error})"
    return memoryview(b"".join(parts)), problem
