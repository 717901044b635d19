"""The MCAP writer: messages in several streams of chunks, so that a small topic is read without the images.

The reference library keeps one chunk at a time and therefore mixes images with poses; reading the poses then
reads every image. Everything written carries a checksum: chunks, attachments, the index, the data as a whole.
"""

from __future__ import annotations

import struct
import threading
import time
import zlib
from collections.abc import Iterable, Mapping
from typing import BinaryIO, Final

from mcap.opcode import Opcode
from mcap.records import (
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)

from scpf.ingest.mcap_chunk import Buffer, ChunkStream
from scpf.ingest.mcap_flush import start_flushing
from scpf.ingest.mcap_summary import MAGIC, encode_record, encode_summary

FLUSH_EVERY_S: Final = 1.0

_RECORD: Final = struct.Struct("<BQ")
_MESSAGE: Final = struct.Struct("<BQHIQQ")


# Images are compressed already: zstd gains nothing on them. Four MiB keep the index of an hour's drive small.
_STREAMS: Final = {"small": ("zstd", 1 << 20), "image": ("", 4 << 20)}


class McapWriter:
    """Writes MCAP records to a binary stream. Channels belong to the chunk stream ``small`` or ``image``.

    What is added is in the hands of the system within about a second, also while no more is added; with ``live``
    false, only when a chunk is full: the same messages then give the same bytes, however long they take to come. Each
    chunk holds the schemas and channels of its messages: whatever else is lost, it explains itself.
    """

    def __init__(self, output: BinaryIO, library: str, profile: str = "ros2", *, live: bool = True) -> None:
        self._output = output
        self._live = live
        self._lock = threading.RLock()
        self._flush_error: OSError | ValueError | None = None
        self._stop_flushing: threading.Event | None = None
        self._position = 0
        self._crc = 0
        self._streams = {name: ChunkStream(*settings) for name, settings in _STREAMS.items()}
        self._schemas: dict[int, Schema] = {}
        self._schema_ids: dict[tuple[str, str, bytes], int] = {}
        self._channels: dict[int, Channel] = {}
        self._stream_of: dict[int, ChunkStream] = {}
        self._counts: dict[int, int] = {}
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._start_ns: int | None = None
        self._end_ns = 0
        self._flushed_s = time.monotonic()
        self._write(MAGIC)
        self._write(encode_record(Header(profile, library)))

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
        with self._lock:
            schema_id = self._schema_ids.get(wanted, 0) if schema_name else 0
            if schema_name and not schema_id:
                schema_id = self._schema_ids[wanted] = len(self._schemas) + 1
                self._schemas[schema_id] = Schema(schema_id, schema_data, schema_encoding, schema_name)
            channel_id = len(self._channels) + 1
            self._channels[channel_id] = Channel(
                channel_id, topic, message_encoding, dict(metadata or {}), schema_id
            )
            self._stream_of[channel_id] = self._streams[stream]
        return channel_id

    def add_message(
        self, channel_id: int, log_time_ns: int, data: Buffer, publish_time_ns: int, sequence: int
    ) -> None:
        """Add a message; ``data`` must not change afterwards, since it is written with its chunk."""
        with self._lock:
            self._raise_flush_error()
            stream = self._stream_of[channel_id]
            if channel_id not in stream.indices:
                self._define(stream, channel_id)
            head = (22 + len(data), channel_id, sequence & 0xFFFFFFFF, log_time_ns, publish_time_ns)
            stream.add_message(channel_id, log_time_ns, _MESSAGE.pack(Opcode.MESSAGE, *head), data)
            self._start_ns = log_time_ns if self._start_ns is None else min(self._start_ns, log_time_ns)
            self._end_ns = max(self._end_ns, log_time_ns)
            self._counts[channel_id] = self._counts.get(channel_id, 0) + 1
            if stream.size >= stream.limit_bytes:
                self._end_chunk(stream)
            if not self._live:
                return
            if time.monotonic() - self._flushed_s > FLUSH_EVERY_S:
                self.flush()
            elif self._stop_flushing is None:
                self._stop_flushing = start_flushing(self, FLUSH_EVERY_S / 2)

    def add_attachment(
        self, name: str, media_type: str, data: bytes, time_ns: int = 0, create_time_ns: int = 0
    ) -> None:
        """Add a file as an attachment."""
        self.add_attachment_blocks(name, media_type, len(data), [data], time_ns, create_time_ns)

    def add_attachment_blocks(
        self,
        name: str,
        media_type: str,
        size: int,
        blocks: Iterable[Buffer],
        time_ns: int,
        create_time_ns: int,
    ) -> None:
        """Add a file of ``size`` bytes that comes in blocks, so that it need not fit into memory."""
        names = b"".join(struct.pack("<I", len(raw)) + raw for raw in (name.encode(), media_type.encode()))
        head = struct.pack("<QQ", time_ns, create_time_ns) + names + struct.pack("<Q", size)
        length = len(head) + size + 4
        with self._lock:
            self._attachments.append(
                AttachmentIndex(
                    offset=self._position,
                    length=9 + length,
                    log_time=time_ns,
                    create_time=create_time_ns,
                    data_size=size,
                    name=name,
                    media_type=media_type,
                )
            )
            self._write(_RECORD.pack(Opcode.ATTACHMENT, length) + head)
            crc, written = zlib.crc32(head), 0
            for block in blocks:
                self._write(block)
                crc, written = zlib.crc32(block, crc), written + len(block)
            if written != size:
                raise ValueError(f"attachment {name!r}: {written} bytes where {size} were announced")
            self._write(struct.pack("<I", crc))

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a record of names and values."""
        record = encode_record(Metadata(name=name, metadata=dict(values)))
        with self._lock:
            self._metadata.append(MetadataIndex(offset=self._position, length=len(record), name=name))
            self._write(record)

    def flush(self) -> None:
        """End the chunks in the making and hand everything to the system: what is written survives a kill."""
        with self._lock:
            for stream in self._streams.values():
                self._end_chunk(stream)
            self._output.flush()
            self._flushed_s = time.monotonic()

    def flush_if_due(self) -> None:
        """Flush what is older than half a second; an error waits for the next message, or the end."""
        with self._lock:
            pending = any(stream.indices for stream in self._streams.values())
            if pending and time.monotonic() - self._flushed_s > FLUSH_EVERY_S / 2:
                try:
                    self.flush()
                except (OSError, ValueError) as error:  # ValueError: the file was closed under us
                    self._flush_error = error

    def finish(self) -> None:
        """Write what is pending, and the index; the stream stays open."""
        if self._stop_flushing is not None:
            self._stop_flushing.set()
        with self._lock:
            self._finish()

    def _finish(self) -> None:
        self._raise_flush_error()
        self.flush()
        self._write(encode_record(DataEnd(self._crc)))
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
        self._write(encode_summary(groups, self._position))
        self._output.flush()

    def _raise_flush_error(self) -> None:
        if self._flush_error is not None:
            error, self._flush_error = self._flush_error, None
            raise error

    def _define(self, stream: ChunkStream, channel_id: int) -> None:
        channel = self._channels[channel_id]
        if channel.schema_id:
            stream.add(encode_record(self._schemas[channel.schema_id]))
        stream.add(encode_record(channel))

    def _end_chunk(self, stream: ChunkStream) -> None:
        if stream.indices:
            parts, entry = stream.pack(self._position)
            for part in parts:
                self._write(part)
            self._chunks.append(entry)

    def _write(self, data: Buffer) -> None:
        self._output.write(data)
        self._crc = zlib.crc32(data, self._crc)
        self._position += len(data)
