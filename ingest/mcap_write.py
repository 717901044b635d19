"""The MCAP writer: messages in several streams of chunks, so that a small topic is read without the images.

The reference library keeps one chunk at a time and therefore mixes images with poses; reading the poses then
reads every image. Everything written carries a checksum: chunks, attachments, the index, the data as a whole.
"""

from __future__ import annotations

import struct
import time
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, BinaryIO, Final

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

MAGIC: Final = bytes([137]) + b"MCAP0\r\n"
FLUSH_EVERY_S: Final = 1.0
Buffer = bytes | bytearray | memoryview

_RECORD: Final = struct.Struct("<BQ")
_MESSAGE: Final = struct.Struct("<BQHIQQ")


@dataclass
class _Stream:
    """A chunk in the making: ``parts`` are written one after the other, not joined where uncompressed."""

    compression: str
    limit_bytes: int
    parts: list[Buffer] = field(default_factory=list)
    size: int = 0
    start_ns: int = 0
    end_ns: int = 0
    indices: dict[int, list[tuple[int, int]]] = field(default_factory=dict)

    def add(self, part: Buffer) -> None:
        self.parts.append(part)
        self.size += len(part)


# Images are compressed already: zstd gains nothing on them. Four MiB keep the index of an hour's drive small.
_STREAMS: Final = {"small": ("zstd", 1 << 20), "image": ("", 4 << 20)}


class McapWriter:
    """Writes MCAP records to a binary stream. Channels belong to the chunk stream ``small`` or ``image``."""

    def __init__(self, output: BinaryIO, library: str, profile: str = "ros2") -> None:
        self._output = output
        self._position = 0
        self._crc = 0
        self._streams = {name: _Stream(*settings) for name, settings in _STREAMS.items()}
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._stream_of: dict[int, _Stream] = {}
        self._counts: dict[int, int] = {}
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._start_ns: int | None = None
        self._end_ns = 0
        self._flushed_s = time.monotonic()
        self._write(MAGIC)
        self._write(_record(Header(profile, library)))

    def add_channel(
        self,
        topic: str,
        schema_name: str,
        schema_data: bytes,
        *,
        stream: str = "small",
        message_encoding: str = "cdr",
        schema_encoding: str = "ros2msg",
        metadata: Mapping[str, str] | None = None,
    ) -> int:
        """Register a channel and, where it is new, its schema; returns the channel's id."""
        wanted = (schema_name, schema_encoding, schema_data)
        known = (k for k, s in self._schemas.items() if (s.name, s.encoding, s.data) == wanted)
        schema_id = next(known, 0) if schema_name else 0
        target = self._streams[stream]
        if schema_name and not schema_id:
            schema_id = len(self._schemas) + 1
            self._schemas[schema_id] = Schema(schema_id, schema_data, schema_encoding, schema_name)
        channel_id = len(self._channels) + 1
        channel = Channel(channel_id, topic, message_encoding, dict(metadata or {}), schema_id)
        self._channels[channel_id] = channel
        self._stream_of[channel_id] = target
        if schema_id:  # again for each channel: whatever chunk is lost, the others explain themselves
            target.add(_record(self._schemas[schema_id]))
        target.add(_record(channel))
        return channel_id

    def add_message(
        self, channel_id: int, log_time_ns: int, data: Buffer, publish_time_ns: int, sequence: int
    ) -> None:
        """Add a message; ``data`` must not change afterwards, since it is written with its chunk."""
        stream = self._stream_of[channel_id]
        records = stream.indices.setdefault(channel_id, [])
        first = not any(stream.indices.values())
        stream.start_ns = log_time_ns if first else min(stream.start_ns, log_time_ns)
        stream.end_ns = log_time_ns if first else max(stream.end_ns, log_time_ns)
        records.append((log_time_ns, stream.size))
        head = (
            Opcode.MESSAGE,
            22 + len(data),
            channel_id,
            sequence & 0xFFFFFFFF,
            log_time_ns,
            publish_time_ns,
        )
        stream.add(_MESSAGE.pack(*head))
        stream.add(data)
        self._start_ns = log_time_ns if self._start_ns is None else min(self._start_ns, log_time_ns)
        self._end_ns = max(self._end_ns, log_time_ns)
        self._counts[channel_id] = self._counts.get(channel_id, 0) + 1
        if stream.size >= stream.limit_bytes:
            self._end_chunk(stream)
        if time.monotonic() - self._flushed_s > FLUSH_EVERY_S:
            self.flush()

    def add_attachment(self, name: str, media_type: str, data: bytes, time_ns: int = 0) -> None:
        """Add a file as an attachment."""
        record = _record(Attachment(0, time_ns, name, media_type, data))
        self._attachments.append(
            AttachmentIndex(self._position, len(record), time_ns, 0, len(data), name, media_type)
        )
        self._write(record)

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a record of names and values."""
        record = _record(Metadata(name=name, metadata=dict(values)))
        self._metadata.append(MetadataIndex(offset=self._position, length=len(record), name=name))
        self._write(record)

    def flush(self) -> None:
        """End the chunks in the making and hand everything to the system: what is written survives a kill."""
        for stream in self._streams.values():
            self._end_chunk(stream)
        self._output.flush()
        self._flushed_s = time.monotonic()

    def finish(self) -> None:
        """Write what is pending, and the index; the stream stays open."""
        self.flush()
        self._write(_record(DataEnd(self._crc)))
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_end_time=self._end_ns,
            message_start_time=self._start_ns or 0,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        groups = (
            (Opcode.SCHEMA, list(self._schemas.values())),
            (Opcode.CHANNEL, list(self._channels.values())),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        )
        start = self._position
        summary, offsets = b"", b""
        for opcode, records in groups:
            group = b"".join(_record(record) for record in records)
            if group:
                offsets += _record(SummaryOffset(opcode, start + len(summary), len(group)))
            summary += group
        footer = _record(Footer(start, start + len(summary), 0))
        crc = zlib.crc32(footer[:-4], zlib.crc32(offsets, zlib.crc32(summary)))
        self._write(summary + offsets + footer[:-4] + struct.pack("<I", crc) + MAGIC)
        self._output.flush()

    def _end_chunk(self, stream: _Stream) -> None:
        if not stream.indices:
            return
        crc = 0
        for part in stream.parts:
            crc = zlib.crc32(part, crc)
        parts: list[Buffer] = stream.parts
        if stream.compression == "zstd":
            import zstandard

            parts = [zstandard.compress(b"".join(stream.parts))]
        stored = sum(len(part) for part in parts)
        name = stream.compression.encode()
        fixed = struct.pack("<QQQI", stream.start_ns, stream.end_ns, stream.size, crc)
        head = fixed + struct.pack("<I", len(name)) + name + struct.pack("<Q", stored)
        offset = self._position
        self._write(_RECORD.pack(Opcode.CHUNK, len(head) + stored) + head)
        for part in parts:
            self._write(part)
        length, index_start = self._position - offset, self._position
        message_index_offsets = {}
        for channel_id, records in stream.indices.items():
            message_index_offsets[channel_id] = self._position
            self._write(_record(MessageIndex(channel_id, records)))
        self._chunks.append(
            ChunkIndex(
                chunk_length=length,
                chunk_start_offset=offset,
                compression=stream.compression,
                compressed_size=stored,
                message_end_time=stream.end_ns,
                message_index_length=self._position - index_start,
                message_index_offsets=message_index_offsets,
                message_start_time=stream.start_ns,
                uncompressed_size=stream.size,
            )
        )
        stream.parts, stream.size, stream.indices = [], 0, {}

    def _write(self, data: Buffer) -> None:
        self._output.write(data)
        self._crc = zlib.crc32(data, self._crc)
        self._position += len(data)


def _record(record: Any) -> bytes:
    builder: Any = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data
