"""The chunks of a ROS 1 bag, found by walking through the file, so that a bag without an index reads as well.

A bag that was not closed (``.active``), was cut short or is damaged in between gives what is whole; what is not is
said in ``losses``. The index at the end is believed only where it agrees with the chunks.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, Final

from scpf.ingest.ros1_chunks import (
    BAG_HEADER,
    CHUNK,
    CHUNK_INFO,
    CONNECTION,
    INDEX,
    MAX_CHUNK_BYTES,
    MAX_HEADER_BYTES,
    MESSAGE,
    Connection,
    Fields,
    number,
    parse_connection,
    parse_fields,
)
from scpf.models.errors import DamagedError

MAGIC: Final = b"#ROSBAG V2.0\n"
MAX_RECORD_BYTES: Final = 64 << 20
MAX_CONNECTIONS: Final = 100_000
SEARCH_BYTES: Final = 4 << 20
MAX_TRIES: Final = 1_000_000
"""Places looked at in search of a chunk, after damage; more of them are no accident."""
MAX_LOSSES: Final = 100
_CHUNK_FIELD: Final = re.compile(
    rb"\x04\x00\x00\x00op=\x05|.\x00\x00\x00compression=(?:none|bz2|lz4)", re.DOTALL
)
_LENGTH: Final = re.compile(rb"[\x14-\xc8]\x00\x00\x00", re.DOTALL)
"""A chunk's header has 20 to 200 bytes."""


@dataclass
class Chunk:
    """A chunk: its place in the file, and what the index records after it say. ``counts``: messages by connection."""

    position: int
    data: int
    stored: int
    compression: str
    size: int
    start_ns: int = 0
    end_ns: int = -1
    counts: dict[int, int] = field(default_factory=dict)
    indexed: bool = False
    """Whether index records follow it, so that it need not be unpacked to know what it holds."""
    open: bool = False
    """Whether it was still being written when the recording ended."""


@dataclass
class BagIndex:
    """Chunks and connections of a bag. ``claimed``: messages by connection, as the index at the end counts them."""

    chunks: list[Chunk] = field(default_factory=list)
    connections: dict[int, Connection] = field(default_factory=dict)
    claimed: dict[int, int] = field(default_factory=dict)
    losses: list[str] = field(default_factory=list)
    closed: bool = False


def walk(file: BinaryIO, path: Path) -> BagIndex:
    """Walk through an open bag, record by record. Raises DamagedError for a file that is no ROS 1 bag."""
    size = file.seek(0, 2)
    file.seek(0)
    start = file.read(len(MAGIC))
    if start != MAGIC:
        what = "the file is empty" if not start else "this is not a ROS 1 bag (format 2.0)"
        raise DamagedError(f"{path}: {what}", "known: ROS 1 .bag, rosbag2 folders, .db3 and .mcap files")
    walker = _Walker(file, path, size, BagIndex())
    walker.walk(len(MAGIC))
    index = walker.index
    if not index.closed:
        index.losses.append(
            "the bag was not closed: it has no index, and what came after its end is not known"
        )
    elif walker.index_position > size:
        text = (
            f"the bag is cut short: its index should begin at byte {walker.index_position}, it ends at {size}"
        )
        index.losses.append(text)
    elif walker.infos < walker.chunk_count:
        index.losses.append("the index at the end of the bag is cut short, or damaged")
    elif walker.chunk_count > len(index.chunks):
        index.losses.append(
            f"{walker.chunk_count - len(index.chunks)} of {walker.chunk_count} chunks are missing"
        )
    return index


class _Walker:
    """Reads the records of a file from front to back; after damage it goes on at the next chunk."""

    def __init__(self, file: BinaryIO, path: Path, size: int, index: BagIndex) -> None:
        self._file, self._path, self._size, self.index = file, path, size, index
        self._left_out = self._tries = 0
        self.index_position = 0
        self.chunk_count = 0
        self.infos = 0

    def walk(self, position: int) -> None:
        while position < self._size:
            try:
                position = self._record(position)
            except ValueError as error:
                following = self._next_chunk(position + 1)
                self._left_out += 1
                if self._left_out <= MAX_LOSSES:
                    text = f"byte {position}: {error}; {following - position} bytes left out"
                    self.index.losses.append(text)
                position = following
        if self._left_out > MAX_LOSSES:
            self.index.losses.append(f"{self._left_out - MAX_LOSSES} more places of this kind")

    def _record(self, position: int) -> int:
        """Take in the record at a place; returns where the next one begins. ValueError where it is not whole."""
        length = int.from_bytes(self._bytes(position, 4), "little")
        if length > MAX_HEADER_BYTES:
            raise ValueError(f"a record header of {length} bytes")
        head = self._bytes(position + 4, length + 4)
        fields = parse_fields(head[:-4])
        data: int = position + 8 + length
        stored = int.from_bytes(head[-4:], "little")
        operation = number(fields, b"op", "<B")
        if operation == CHUNK:
            return self._chunk(position, data, stored, fields)
        if operation in (MESSAGE, CONNECTION) and self._in_open_chunk():
            # A chunk in the making was never given its length: its records lie in the file one after the other.
            self._open_chunk(position)
            return self._size
        if data + stored > self._size:
            raise ValueError(f"a record of {stored} bytes where {self._size - data} are left")
        if operation == BAG_HEADER:
            self.index_position = number(fields, b"index_pos", "<Q")
            self.chunk_count = number(fields, b"chunk_count", "<I")
            self.index.closed = self.index_position > 0
            if fields.get(b"encryptor"):
                raise DamagedError(
                    f"{self._path}: the bag is encrypted", "decrypt it first: `rosbag decrypt`"
                )
        elif operation == INDEX:
            self._index(fields, self._index_data(data, stored))
        elif operation == CONNECTION:
            key, connection = parse_connection(fields, self._index_data(data, stored))
            if len(self.index.connections) >= MAX_CONNECTIONS:
                raise ValueError(f"more than {MAX_CONNECTIONS} connections")
            self.index.connections.setdefault(key, connection)
        elif operation == CHUNK_INFO:
            self._chunk_info(self._index_data(data, stored))
        elif operation == MESSAGE:
            raise ValueError("a message outside of any chunk")
        return data + stored

    def _chunk(self, position: int, data: int, stored: int, fields: Fields) -> int:
        compression = fields.get(b"compression", b"").decode(errors="replace")
        chunk = Chunk(position, data, stored, compression, number(fields, b"size", "<I"))
        if data + stored > self._size:
            lost = data + stored - self._size
            self.index.losses.append(f"byte {position}: the last chunk is cut short by {lost} bytes")
            chunk.stored = self._size - data
        self.index.chunks.append(chunk)
        if not stored and not chunk.size and compression != "none" and data < self._size:
            self._open_chunk(data)  # compressed, and in the making: a stream that nobody closed
            return self._size
        return data + chunk.stored

    def _in_open_chunk(self) -> bool:
        chunks = self.index.chunks
        return bool(chunks) and not chunks[-1].stored and not chunks[-1].size

    def _open_chunk(self, data: int) -> None:
        chunk = self.index.chunks[-1]
        chunk.data, chunk.stored, chunk.size = data, min(self._size - data, MAX_CHUNK_BYTES), MAX_CHUNK_BYTES
        if chunk.compression == "none":
            chunk.size = chunk.stored
        chunk.open = True
        self.index.losses.append(f"byte {chunk.position}: the last chunk was never closed")

    def _index(self, fields: Fields, data: bytes) -> None:
        if not self.index.chunks:
            raise ValueError("an index record before any chunk")
        chunk = self.index.chunks[-1]
        if number(fields, b"ver", "<I") != 1 or len(data) != 12 * number(fields, b"count", "<I"):
            raise ValueError("an index record of another size than it counts")
        connection = number(fields, b"conn", "<I")
        times = [seconds * 10**9 + rest for seconds, rest, _ in struct.iter_unpack("<III", data)]
        if times:
            chunk.start_ns = min(times) if chunk.end_ns < 0 else min(chunk.start_ns, *times)
            chunk.end_ns = max(chunk.end_ns, *times)
        chunk.counts[connection] = chunk.counts.get(connection, 0) + len(times)
        chunk.indexed = True

    def _chunk_info(self, data: bytes) -> None:
        self.infos += 1
        for connection, count in struct.iter_unpack("<II", data[: len(data) // 8 * 8]):
            self.index.claimed[connection] = self.index.claimed.get(connection, 0) + count

    def _index_data(self, position: int, length: int) -> bytes:
        if length > MAX_RECORD_BYTES:
            raise ValueError(f"a record of {length} bytes")
        return self._bytes(position, length)

    def _bytes(self, position: int, length: int) -> bytes:
        self._file.seek(position)
        data = self._file.read(length) if position + length <= self._size else b""
        if len(data) != length:
            raise ValueError("the file is cut short within a record")
        return data

    def _next_chunk(self, position: int) -> int:
        """Where the next chunk record begins, at or after a place; the end of the file where there is none."""
        while position < self._size:
            self._file.seek(position)
            block = self._file.read(SEARCH_BYTES)
            for match in _CHUNK_FIELD.finditer(block):
                # The field may be the first of the header, or the second or third: at most 60 bytes in.
                for at in range(max(match.start() - 60, 0), match.start() - 3):
                    self._tries += 1
                    if self._tries > MAX_TRIES:
                        return self._size
                    if _LENGTH.match(block, at) and self._is_chunk(position + at):
                        return position + at
            position += max(len(block) - 128, 1) if len(block) == SEARCH_BYTES else len(block)
        return self._size

    def _is_chunk(self, position: int) -> bool:
        try:
            (length,) = struct.unpack("<I", self._bytes(position, 4))
            if not 20 <= length <= 200:
                return False
            fields = parse_fields(self._bytes(position + 4, length))
            number(fields, b"size", "<I")
            return number(fields, b"op", "<B") == CHUNK and b"compression" in fields
        except ValueError:
            return False
