"""A chunk in the making: messages gathered until it is large or old enough, then packed, checked and indexed."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field

from mcap.opcode import Opcode
from mcap.records import ChunkIndex, MessageIndex

from scpf.ingest.mcap_summary import encode_record

Buffer = bytes | bytearray | memoryview


@dataclass
class ChunkStream:
    """``parts`` are written one after the other, not joined where uncompressed; ``indices``: time and place of
    each message by channel."""

    compression: str
    limit_bytes: int
    parts: list[Buffer] = field(default_factory=list)
    size: int = 0
    start_ns: int = 0
    end_ns: int = 0
    indices: dict[int, list[tuple[int, int]]] = field(default_factory=dict)

    def add(self, part: Buffer) -> None:
        """Add bytes of a record."""
        self.parts.append(part)
        self.size += len(part)

    def add_message(self, channel_id: int, log_time_ns: int, head: bytes, data: Buffer) -> None:
        """Add a message in two parts, and remember where it begins."""
        first = not self.indices
        self.start_ns = log_time_ns if first else min(self.start_ns, log_time_ns)
        self.end_ns = log_time_ns if first else max(self.end_ns, log_time_ns)
        self.indices.setdefault(channel_id, []).append((log_time_ns, self.size))
        self.add(head)
        self.add(data)

    def pack(self, offset: int) -> tuple[list[Buffer], ChunkIndex]:
        """The chunk with its message indices as they are written at ``offset``, and its index entry; then empty."""
        crc = 0
        for part in self.parts:
            crc = zlib.crc32(part, crc)
        parts: list[Buffer] = self.parts
        if self.compression == "zstd":
            import zstandard

            parts = [zstandard.compress(b"".join(self.parts))]
        stored = sum(len(part) for part in parts)
        name = self.compression.encode()
        fixed = struct.pack("<QQQI", self.start_ns, self.end_ns, self.size, crc)
        head = fixed + struct.pack("<I", len(name)) + name + struct.pack("<Q", stored)
        head = struct.pack("<BQ", Opcode.CHUNK, len(head) + stored) + head
        length = len(head) + stored
        indices, places = b"", {}
        for channel_id, records in self.indices.items():
            places[channel_id] = offset + length + len(indices)
            indices += encode_record(MessageIndex(channel_id, records))
        entry = ChunkIndex(
            chunk_length=length,
            chunk_start_offset=offset,
            compression=self.compression,
            compressed_size=stored,
            message_end_time=self.end_ns,
            message_index_length=len(indices),
            message_index_offsets=places,
            message_start_time=self.start_ns,
            uncompressed_size=self.size,
        )
        self.parts, self.size, self.indices = [], 0, {}
        return [head, *parts, indices], entry
