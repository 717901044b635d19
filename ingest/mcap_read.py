"""The MCAP reader for files that nobody vouches for: every length is checked before it is read or allocated.

The reference library answers much damage with silence; this one names file and place. A chunk is decompressed
only after its declared size has been checked against the limit and against the compressed frame's own.
"""

from __future__ import annotations

import heapq
import struct
import zlib
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

from scpf.ingest.mcap_decompress import decompress
from scpf.ingest.mcap_index import (
    Channel,
    ChunkEntry,
    Cursor,
    Index,
    damaged,
    read_index,
)

MAX_CHUNK_BYTES: Final = 512 << 20
CACHE_BYTES: Final = 128 << 20
LATEST_NS: Final = (1 << 63) - 1
"""MCAP has room for later times, arrays of times have not."""
RECOVER_HINT: Final = "the readable part may be saved with `scpf recover`"

_MESSAGE: Final = struct.Struct("<HIQQ")


class RawMessage(NamedTuple):
    """A message as stored: ``data`` is a view into its chunk."""

    channel: Channel
    sequence: int
    log_time_ns: int
    publish_time_ns: int
    data: memoryview


@dataclass(frozen=True)
class _Slot:
    """Where a message lies in its uncompressed chunk."""

    channel_id: int
    sequence: int
    publish_time_ns: int
    start: int
    stop: int


class McapFile:
    """An indexed MCAP file, opened for reading. A context manager; reads on demand, in bounded memory."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._file = path.open("rb")
        except OSError as error:
            raise damaged(path, 0, f"cannot be opened ({error.strerror})") from error
        try:
            self.index: Index = read_index(self._file, path)
        except BaseException:
            self._file.close()
            raise
        self._cache: OrderedDict[int, memoryview] = OrderedDict()

    def __enter__(self) -> McapFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._cache.clear()
        self._file.close()

    def messages(
        self, topics: set[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """Messages with ``start_ns`` ≤ log time < ``end_ns``, by log time, then by place in the file.

        Raises DamagedError for a chunk that fails a check, and, after a whole topic has been read, where
        fewer messages were found than the index counts.
        """
        wanted = {k for k, c in self.index.channels.items() if topics is None or c.topic in topics}
        low = -1 if start_ns is None else start_ns
        high = 1 << 64 if end_ns is None else end_ns
        pending = [
            entry
            for entry in sorted(self.index.chunks, key=lambda e: (e.start_ns, e.offset))
            if (not entry.channel_ids or entry.channel_ids & wanted)
            and entry.end_ns >= low
            and entry.start_ns < high
        ]
        pending.reverse()
        heap: list[tuple[int, int, int, _Slot]] = []
        by_offset: dict[int, ChunkEntry] = {}
        found = 0
        while pending or heap:
            while pending and (not heap or pending[-1].start_ns <= heap[0][0]):
                entry = pending.pop()
                by_offset[entry.offset] = entry
                for log_time_ns, slot in self._slots(entry, wanted):
                    found += 1
                    if low <= log_time_ns < high:
                        heapq.heappush(heap, (log_time_ns, entry.offset, slot.start, slot))
            if not heap:
                continue
            log_time_ns, offset, _, slot = heapq.heappop(heap)
            data = self._chunk(by_offset[offset])[slot.start : slot.stop]
            channel = self.index.channels[slot.channel_id]
            yield RawMessage(channel, slot.sequence, log_time_ns, slot.publish_time_ns, data)
        counts = self.index.counts
        if start_ns is None and end_ns is None and counts is not None:
            declared = sum(counts.get(k, 0) for k in wanted)
            if found != declared:
                raise damaged(
                    self.path, 0, f"{found} messages found where the index counts {declared}", RECOVER_HINT
                )

    def counts(self) -> dict[int, int]:
        """Messages by channel id: as the index says, else counted (statistics are optional in MCAP)."""
        if self.index.counts is None:
            found: dict[int, int] = {}
            for record in self.messages():
                found[record.channel.id] = found.get(record.channel.id, 0) + 1
            self.index.counts = found
        return self.index.counts

    def read_exactly(self, offset: int, length: int, what: str) -> bytes:
        """``length`` bytes at ``offset``; DamagedError where the file does not hold them."""
        if offset < 0 or length < 0 or offset + length > self.index.file_size:
            raise damaged(
                self.path, offset, f"{what} of {length} bytes reaches past the end of the file", RECOVER_HINT
            )
        self._file.seek(offset)
        data = self._file.read(length)
        if len(data) != length:
            raise damaged(self.path, offset, f"{what} is cut short", RECOVER_HINT)
        return data

    def _slots(self, entry: ChunkEntry, wanted: set[int]) -> Iterator[tuple[int, _Slot]]:
        """Log time and place of the wanted messages of a chunk."""
        chunk = self._chunk(entry)
        position, size = 0, len(chunk)
        while position < size:
            if position + 9 > size:
                raise damaged(self.path, entry.offset, "a record in this chunk is cut short", RECOVER_HINT)
            opcode, length = struct.unpack_from("<BQ", chunk, position)
            start = position + 9
            position = start + length
            if position > size:
                text = f"a record in this chunk declares {length} bytes and {size - start} are left"
                raise damaged(self.path, entry.offset, text, RECOVER_HINT)
            if opcode == 4:
                self._check_channel(entry, chunk[start:position])
            if opcode != 5:
                continue
            if length < _MESSAGE.size:
                raise damaged(
                    self.path, entry.offset, f"a message of {length} bytes in this chunk", RECOVER_HINT
                )
            channel_id, sequence, log_time_ns, publish_time_ns = _MESSAGE.unpack_from(chunk, start)
            if channel_id not in self.index.channels:
                text = f"a message of channel {channel_id}, which the index does not describe"
                raise damaged(self.path, entry.offset, text, RECOVER_HINT)
            if not entry.start_ns <= log_time_ns <= entry.end_ns:
                text = f"a message at {log_time_ns} ns lies outside the times of its chunk"
                raise damaged(self.path, entry.offset, text, RECOVER_HINT)
            if log_time_ns > LATEST_NS:
                text = f"a message at {log_time_ns} ns, after the year 2262"
                raise damaged(self.path, entry.offset, text, RECOVER_HINT)
            if channel_id in wanted:
                yield (
                    log_time_ns,
                    _Slot(channel_id, sequence, publish_time_ns, start + _MESSAGE.size, position),
                )

    def _check_channel(self, entry: ChunkEntry, body: memoryview) -> None:
        """Refuse a chunk that gives a channel another topic than the index: its messages would change theirs."""
        cursor = Cursor(body, self.path, entry.offset)
        channel_id, _ = cursor.unpack("<HH")
        topic = cursor.text()
        known = self.index.channels.get(channel_id)
        if known is not None and known.topic != topic:
            text = (
                f"channel {channel_id} is {topic[:80]!r} in this chunk and {known.topic[:80]!r} in the index"
            )
            raise damaged(self.path, entry.offset, text, RECOVER_HINT)

    def _chunk(self, entry: ChunkEntry) -> memoryview:
        """The uncompressed records of a chunk, checked; the last few stay in memory."""
        cached = self._cache.get(entry.offset)
        if cached is not None:
            self._cache.move_to_end(entry.offset)
            return cached
        data = memoryview(self._load(entry))
        self._cache[entry.offset] = data
        while len(self._cache) > 1 and sum(map(len, self._cache.values())) > CACHE_BYTES:
            self._cache.popitem(last=False)
        return data

    def _load(self, entry: ChunkEntry) -> bytes | memoryview:
        place = entry.offset
        if entry.uncompressed_size > MAX_CHUNK_BYTES or entry.length > MAX_CHUNK_BYTES + (1 << 20):
            text = (
                f"a chunk declares {entry.uncompressed_size} bytes ({entry.length} stored), more than 512 MiB"
            )
            raise damaged(self.path, place, text)
        record = memoryview(self.read_exactly(place, entry.length, "a chunk"))
        cursor = Cursor(record, self.path, place)
        opcode, length = cursor.unpack("<BQ")
        start_ns, end_ns, size, crc = cursor.unpack("<QQQI")
        compression = cursor.text()
        (stored,) = cursor.unpack("<Q")
        told = (6, entry.length - 9, entry.start_ns, entry.end_ns, entry.uncompressed_size, entry.compression)
        if (opcode, length, start_ns, end_ns, size, compression) != told or stored != cursor.left:
            raise damaged(self.path, place, "a chunk contradicts the index", RECOVER_HINT)
        try:
            data = decompress(compression, cursor.take(stored), size)
        except ValueError as error:
            raise damaged(self.path, place, f"a chunk cannot be unpacked: {error}", RECOVER_HINT) from error
        if crc and zlib.crc32(data) != crc:
            raise damaged(self.path, place, "a chunk fails its checksum", RECOVER_HINT)
        return data
