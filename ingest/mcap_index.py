"""The index at the end of an MCAP file: channels, schemas, chunks, attachments, metadata, counts."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, Final

from scpf.ingest.mcap_summary import MAGIC
from scpf.models.errors import DamagedError

MAX_INDEX_BYTES: Final = 64 << 20
_FOOTER_BYTES: Final = 9 + 20
FOREIGN: Final = {
    b"#ROSBAG V2.0": ("a ROS 1 bag", "convert it with `scpf convert`"),
    b"SQLite format 3": ("a rosbag2 SQLite file", "convert it with `scpf convert`"),
}


@dataclass(frozen=True)
class Schema:
    """The message type of a channel."""

    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True)
class Channel:
    """A channel; ``schema`` is None where the file gives it none."""

    id: int
    topic: str
    encoding: str
    schema: Schema | None
    metadata: dict[str, str]


@dataclass(frozen=True)
class ChunkEntry:
    """What the index says of a chunk; ``channel_ids`` is empty where it does not say."""

    offset: int
    length: int
    start_ns: int
    end_ns: int
    compression: str
    uncompressed_size: int
    channel_ids: frozenset[int]


@dataclass(frozen=True)
class AttachmentEntry:
    """What the index says of an attachment."""

    offset: int
    length: int
    name: str
    media_type: str
    size: int


@dataclass
class Index:
    """The whole index. ``counts``: messages by channel id, None where the file has no statistics."""

    file_size: int
    profile: str = ""
    library: str = ""
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[ChunkEntry] = field(default_factory=list)
    attachments: list[AttachmentEntry] = field(default_factory=list)
    metadata: list[tuple[int, int]] = field(default_factory=list)
    counts: dict[int, int] | None = None

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """Log times of the first and the last message; None without messages."""
        # A chunk of schemas alone states 0 and 0, which is no time of a message.
        full = [chunk for chunk in self.chunks if chunk.channel_ids or chunk.end_ns]
        return (min(c.start_ns for c in full), max(c.end_ns for c in full)) if full else None


def damaged(path: Path, offset: int, text: str, hint: str = "") -> DamagedError:
    """The error of a damaged file, with its place."""
    return DamagedError(f"{path}: byte {offset}: {text}", hint)


class Cursor:
    """Reads fields out of a record; DamagedError where a field reaches past its end."""

    def __init__(self, data: memoryview, path: Path, offset: int) -> None:
        self._data, self._path, self._offset = data, path, offset
        self.position = 0

    @property
    def left(self) -> int:
        """Bytes that are left."""
        return len(self._data) - self.position

    def take(self, length: int) -> memoryview:
        """The next ``length`` bytes."""
        if length > self.left:
            text = f"a field of {length} bytes where {self.left} are left"
            raise damaged(self._path, self._offset + self.position, text)
        self.position += length
        return self._data[self.position - length : self.position]

    def unpack(self, layout: str) -> tuple[Any, ...]:
        """The next fields, as struct.unpack gives them."""
        return struct.unpack(layout, self.take(struct.calcsize(layout)))

    def text(self) -> str:
        """A string with its length before it."""
        (length,) = self.unpack("<I")
        try:
            return str(self.take(length), "utf-8")
        except UnicodeDecodeError as error:
            raise damaged(self._path, self._offset + self.position, "text that is not UTF-8") from error

    def mapping(self) -> dict[str, str]:
        """Names and values, with their total length before them."""
        (length,) = self.unpack("<I")
        inner = Cursor(self.take(length), self._path, self._offset + self.position - length)
        values = {}
        while inner.left:
            name = inner.text()
            values[name] = inner.text()
        return values

    def record(self) -> tuple[int, Cursor]:
        """The next record: its opcode, and a cursor over its body."""
        opcode, length = self.unpack("<BQ")
        start = self._offset + self.position
        return opcode, Cursor(self.take(length), self._path, start)


def read_index(file: BinaryIO, path: Path) -> Index:
    """The index of an open file. DamagedError for everything that is not a whole, indexed MCAP file."""
    file_size = file.seek(0, 2)
    file.seek(0)
    start = file.read(1024)
    if not start.startswith(MAGIC):
        for magic, (what, remedy) in FOREIGN.items():
            if start.startswith(magic):
                raise damaged(path, 0, f"this is {what}, not an MCAP file", remedy)
        what = "the file is empty" if not start else "this is not an MCAP file"
        raise damaged(path, 0, what, "a drive log comes from `scpf ingest` or `scpf convert`")
    hint = "it was not closed properly, or copied in part; `scpf recover` may save its messages"
    tail_start = file_size - _FOOTER_BYTES - len(MAGIC)
    if tail_start < len(MAGIC):
        raise damaged(path, file_size, "the file ends too early", hint)
    file.seek(tail_start)
    tail = file.read(_FOOTER_BYTES + len(MAGIC))
    opcode, length, summary_start, _, summary_crc = struct.unpack_from("<BQQQI", tail)
    if tail[_FOOTER_BYTES:] != MAGIC or opcode != 2 or length != 20:
        raise damaged(path, file_size, "the file is cut short: its end is not that of an MCAP file", hint)
    if summary_start == 0:
        raise damaged(path, tail_start, "the file has no index", hint)
    if not len(MAGIC) <= summary_start <= tail_start:
        raise damaged(path, tail_start, f"the index is said to start at {summary_start}", hint)
    if tail_start - summary_start > MAX_INDEX_BYTES:
        raise damaged(path, summary_start, "the index is larger than 64 MiB", hint)
    file.seek(summary_start)
    summary = file.read(tail_start - summary_start)
    if summary_crc and zlib.crc32(tail[: _FOOTER_BYTES - 4], zlib.crc32(summary)) != summary_crc:
        raise damaged(path, summary_start, "the index fails its checksum", hint)
    index = _parse(Cursor(memoryview(summary), path, summary_start), file_size, path, summary_start)
    _check(index, path, hint)
    head = Cursor(memoryview(start)[len(MAGIC) :], path, len(MAGIC))
    if struct.unpack_from("<B", start, len(MAGIC))[0] == 1:
        _, body = head.record()
        index.profile, index.library = body.text(), body.text()
    return index


def _parse(cursor: Cursor, file_size: int, path: Path, summary_start: int) -> Index:
    index = Index(file_size)
    schemas: dict[int, Schema] = {}
    channels: list[tuple[int, int, str, str, dict[str, str]]] = []
    while cursor.left:
        opcode, body = cursor.record()
        if opcode == 3:
            (schema_id,) = body.unpack("<H")
            name, encoding = body.text(), body.text()
            schemas[schema_id] = Schema(name, encoding, bytes(body.take(body.unpack("<I")[0])))
        elif opcode == 4:
            channel_id, schema_id = body.unpack("<HH")
            channels.append((channel_id, schema_id, body.text(), body.text(), body.mapping()))
        elif opcode == 8:
            start_ns, end_ns, offset, length, size = body.unpack("<QQQQI")
            inner = body.take(size - size % 10)
            body.take(size % 10)
            ids = frozenset(key for key, _ in struct.iter_unpack("<HQ", inner))
            body.unpack("<Q")
            compression = body.text()
            _, uncompressed_size = body.unpack("<QQ")
            index.chunks.append(
                ChunkEntry(offset, length, start_ns, end_ns, compression, uncompressed_size, ids)
            )
        elif opcode == 10:
            offset, length, _, _, size = body.unpack("<QQQQQ")
            index.attachments.append(AttachmentEntry(offset, length, body.text(), body.text(), size))
        elif opcode == 11:
            body.unpack("<QHIIIIQQ")
            inner = body.take(body.unpack("<I")[0] // 10 * 10)
            index.counts = dict(struct.iter_unpack("<HQ", inner))
        elif opcode == 13:
            offset, length = body.unpack("<QQ")
            index.metadata.append((offset, length))
    for channel_id, schema_id, topic, encoding, metadata in channels:
        if schema_id and schema_id not in schemas:
            raise damaged(path, summary_start, f"channel {topic!r} names a schema that the index lacks")
        index.channels[channel_id] = Channel(channel_id, topic, encoding, schemas.get(schema_id), metadata)
    return index


def _check(index: Index, path: Path, hint: str) -> None:
    """Refuse an index that leaves messages out."""
    for chunk in index.chunks:
        if not chunk.channel_ids <= index.channels.keys():
            raise damaged(path, chunk.offset, "the index does not describe a channel of this chunk", hint)
    ends_at = 0
    for chunk in sorted(index.chunks, key=lambda entry: entry.offset):
        if chunk.offset < ends_at:
            raise damaged(path, chunk.offset, "two chunks of the index overlap", hint)
        ends_at = chunk.offset + chunk.length
    counts = index.counts or {}
    if sum(counts.values()) and not index.chunks:
        raise damaged(path, 0, f"{sum(counts.values())} messages, and no chunk in the index", hint)
