"""Finding MCAP records in bytes that nobody vouches for: what may be a record, and where the next one begins.

A record is an opcode, a length of eight bytes, and a body. A length that lies leads astray, so every record is
measured by its own fields, and after damage the bytes are searched for a record that another one follows.
"""

from __future__ import annotations

import struct
from collections.abc import Container
from typing import BinaryIO, Final, NamedTuple

import numpy as np

from scpf.ingest.mcap_summary import MAGIC

MAX_MESSAGE_BYTES: Final = 64 << 20
MAX_CANDIDATES: Final = 500_000
"""Places that are tried, and one more for each kilobyte, before a search gives up: bytes made to look like records
everywhere must not cost hours."""
FIRST_WINDOW: Final = 1 << 12
LAST_WINDOW: Final = 1 << 20
"""A search begins small, since the next record is often near, and grows."""

_LAYOUTS: Final[dict[int, str]] = {
    1: "SS",  # header: profile, library
    2: "20",  # footer
    3: "2SSS",  # schema: id, name, encoding, data
    4: "4SSS",  # channel: id and schema, topic, encoding, metadata
    5: "22",  # message: channel, sequence, two times; the rest is the message
    6: "28SQ",  # chunk: times, size, checksum, compression, records
    7: "2S",  # message index
    8: "32S8S16",  # chunk index
    9: "16SSQ4",  # attachment
    10: "40SS",
    11: "42S",  # statistics
    12: "SS",  # metadata: name, values
    13: "16S",
    14: "17",
    15: "4",  # end of data
}
"""Bodies: digits are bytes, S and Q fields with a length of 4 and 8 bytes before them."""
_FIELDS: Final = {
    op: [
        int(part) if part.isdigit() else part
        for part in layout.replace("S", " S ").replace("Q", " Q ").split()
    ]
    for op, layout in _LAYOUTS.items()
}
_SIZES: Final = {"S": 4, "Q": 8}
_LEAST: Final = np.zeros(256, dtype=np.int64)
for _op, _fields in _FIELDS.items():
    _LEAST[_op] = sum(part if isinstance(part, int) else _SIZES[part] for part in _fields)
_MOST: Final = dict.fromkeys((1, 3, 4, 8, 10, 11, 12, 13), 16 << 20) | {
    2: 20,
    5: 22 + MAX_MESSAGE_BYTES,
    14: 1 << 10,
    15: 4,
}
_IN_CHUNK: Final = (3, 4, 5)
_HEAD: Final = struct.Struct("<BQ")


class Region:
    """Bytes of a file from ``start`` on, or of memory, as far as they go."""

    def __init__(self, source: BinaryIO | memoryview, start: int, length: int) -> None:
        self._source, self._start, self.length = source, start, length

    def read(self, offset: int, length: int) -> memoryview:
        """Up to ``length`` bytes at ``offset``."""
        length = max(0, min(length, self.length - offset))
        if isinstance(self._source, memoryview):
            return self._source[self._start + offset : self._start + offset + length]
        self._source.seek(self._start + offset)
        return memoryview(self._source.read(length))

    def part(self, offset: int, length: int) -> Region:
        """The bytes of a part."""
        return Region(self._source, self._start + offset, min(length, self.length - offset))


class Record(NamedTuple):
    """A record by its place: ``body`` and ``end`` are offsets in the region."""

    opcode: int
    start: int
    body: int
    end: int

    @property
    def length(self) -> int:
        """Bytes of the body."""
        return self.end - self.body


class Scanner:
    """Looks for records in a region: all kinds in a file, schemas, channels and messages in a chunk."""

    def __init__(self, region: Region, *, in_chunk: bool) -> None:
        self.region = region
        self._allowed = frozenset(_IN_CHUNK if in_chunk else _LAYOUTS)
        self._in_chunk = in_chunk
        self._table = np.isin(np.arange(256), sorted(self._allowed))
        self._tries_left = MAX_CANDIDATES + region.length // 1000

    def record(self, offset: int) -> Record | None:
        """The record at ``offset``, if its length holds what its fields need; None where it does not."""
        found = self._head(offset)
        if found is None or found.end > self.region.length:
            return None
        measured = self._measure(found)
        return found if measured is not None and measured <= found.length else None

    def follows(self, offset: int) -> bool:
        """Whether ``offset`` is where a record may end: at the end, or before another, be it cut short."""
        if offset >= self.region.length:
            return offset == self.region.length
        return self._head(offset) is not None or (
            not self._in_chunk and self.region.read(offset, len(MAGIC)) == MAGIC
        )

    def next_record(self, offset: int, channels: Container[int]) -> int:
        """Where, from ``offset`` on, the next certain record begins; the region's end where none does.

        Certain: its fields fill it exactly, another follows it, and a message belongs to one of ``channels``.
        """
        region, window = self.region, FIRST_WINDOW
        while offset < region.length:
            data = np.frombuffer(region.read(offset, window + 8), dtype=np.uint8)
            window = min(2 * window, LAST_WINDOW)
            count = len(data) - 8
            if count <= 0:
                break
            opcodes = data[:count]
            # Lengths from 4 GiB on are no lengths of a record that could be recovered.
            small = (data[5 : 5 + count] | data[6 : 6 + count] | data[7 : 7 + count] | data[8:]) == 0
            places = np.flatnonzero(small & self._table[opcodes])
            lengths = sum(data[places + 1 + k].astype(np.int64) << (8 * k) for k in range(4))
            fits = (lengths >= _LEAST[opcodes[places]]) & (offset + places + 9 + lengths <= region.length)
            for place in places[fits].tolist():
                self._tries_left -= 1
                if self._tries_left < 0:
                    return region.length
                if self._certain(offset + int(place), channels):
                    return offset + int(place)
            offset += count
        return region.length

    def _certain(self, offset: int, channels: Container[int]) -> bool:
        found = self.record(offset)
        if found is None or found.opcode not in self._allowed or not self.follows(found.end):
            return False
        if found.opcode == 5:
            return struct.unpack("<H", self.region.read(found.body, 2))[0] in channels
        return self._measure(found) == found.length

    def _head(self, offset: int) -> Record | None:
        head = self.region.read(offset, 9)
        if len(head) < 9:
            return None
        opcode, length = _HEAD.unpack(head)
        private = opcode >= 0x80 and not self._in_chunk  # the format lets others add kinds of their own
        if not private and (opcode not in self._allowed or length < _LEAST[opcode]):
            return None
        if length > _MOST.get(opcode, 1 << 40):
            return None
        return Record(opcode, offset, offset + 9, offset + 9 + length)

    def _measure(self, record: Record) -> int | None:
        """Bytes that the fields of a record take by what they say of themselves; None beyond its end."""
        at = record.body
        for part in _FIELDS.get(record.opcode, ()):
            if isinstance(part, int):
                at += part
            else:
                size = _SIZES[part]
                at += size + int.from_bytes(self.region.read(at, size), "little")
            if at > record.end:
                # A chunk whose inner length lies may still be read: its own end is known.
                return record.length if record.opcode == 6 and part == "Q" else None
        return at - record.body
