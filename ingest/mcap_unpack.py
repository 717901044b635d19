"""The records of a chunk, whatever it says of itself, in bounded memory: a large one goes to a temporary file."""

from __future__ import annotations

import struct
import tempfile
import zlib
from collections.abc import Iterator
from typing import Final, NamedTuple

from scpf.ingest.mcap_read import MAX_CHUNK_BYTES
from scpf.ingest.mcap_scan import Record, Region

IN_MEMORY_BYTES: Final = 32 << 20
MAX_WINDOW_BYTES: Final = 128 << 20
BLOCK: Final = 1 << 20


class ChunkHead(NamedTuple):
    """What a chunk says of itself, and where its ``stored`` bytes begin in the region."""

    size: int
    crc: int
    compression: str
    data: int
    stored: int
    cut: bool


class Unpacked(NamedTuple):
    """``records`` as far as there are any, ``problem`` (empty: none), and whether they may be taken for true."""

    records: Region
    problem: str
    usable: bool


class Budget:
    """How much a file may inflate to in all: a small file must not cost hours of unpacking zeros."""

    def __init__(self, file_size: int) -> None:
        self.left_bytes = (2 << 30) + 200 * file_size


def read_head(region: Region, record: Record) -> ChunkHead:
    """The head of a chunk, which may be ``cut`` by the end of the file.

    The length of the record counts more than the inner one: after it another record follows.
    """
    fixed = region.read(record.body, 32)
    _, _, size, crc, length = struct.unpack("<QQQII", fixed)
    name = str(region.read(record.body + 32, min(length, 64)), "utf-8", "replace")
    data = record.body + 40 + length
    return ChunkHead(size, crc, name, data, min(record.end, region.length) - data, record.end > region.length)


def unpack(region: Region, head: ChunkHead, budget: Budget) -> Unpacked:
    """Unpack a chunk and check it. A chunk that the file's end cuts is usable as far as it goes."""
    stored = region.part(head.data, head.stored)
    nothing = Region(memoryview(b""), 0, 0)
    if head.compression == "":
        return _unpack_plain(stored, head)
    if head.compression not in ("zstd", "lz4"):
        return Unpacked(nothing, f"is packed by {head.compression[:40]!r}, which is not known", False)
    if head.size > min(MAX_CHUNK_BYTES, budget.left_bytes):
        return Unpacked(nothing, f"declares {head.size} bytes, more than this file may unpack to", False)
    blocks = _zstd(stored) if head.compression == "zstd" else _lz4(stored)
    records, crc, problem = _collect(blocks, head.size)
    budget.left_bytes -= records.length
    if records.length > head.size:
        problem = problem or f"declares {head.size} bytes and holds more"
    elif records.length == head.size or not head.cut:
        if records.length < head.size and not head.crc:
            problem = problem or f"declares {head.size} bytes and holds {records.length}"
        elif head.crc and crc != head.crc:
            problem = problem or "fails its checksum"
    elif not problem:
        return Unpacked(records, "is cut short by the end of the file", True)
    return Unpacked(records, problem, not problem)


def _unpack_plain(stored: Region, head: ChunkHead) -> Unpacked:
    """A chunk that is not compressed: large ones are read where they lie."""
    if stored.length > IN_MEMORY_BYTES:
        records, crc = stored, 0
        for block in _plain(stored):
            crc = zlib.crc32(block, crc)
    else:
        data = stored.read(0, stored.length)
        records, crc = Region(data, 0, len(data)), zlib.crc32(data)
    problem = "fails its checksum" if head.crc and crc != head.crc else ""
    return Unpacked(records, problem, not problem)


def _collect(blocks: Iterator[bytes], size: int) -> tuple[Region, int, str]:
    """Up to ``size`` + 1 bytes of ``blocks``, their CRC, and the error that ended them."""
    memory = bytearray()
    # Not `with`: the region that is returned reads from it, and the file goes away with the region.
    spilled = tempfile.TemporaryFile() if size > IN_MEMORY_BYTES else None  # noqa: SIM115
    length, crc, problem = 0, 0, ""
    try:
        for block in blocks:
            taken = memoryview(block)[: size + 1 - length]
            crc = zlib.crc32(taken, crc)
            length += len(taken)
            if spilled is not None:
                spilled.write(taken)
            else:
                memory += taken
            if length > size:
                break
    except ValueError as error:
        problem = f"cannot be unpacked: {error}"
    if spilled is not None:
        return Region(spilled, 0, length), crc, problem
    return Region(memoryview(memory), 0, length), crc, problem


def _plain(stored: Region) -> Iterator[memoryview]:
    for offset in range(0, stored.length, BLOCK):
        yield stored.read(offset, BLOCK)


def _zstd(stored: Region) -> Iterator[bytes]:
    import zstandard

    class Source:
        """What zstandard reads from."""

        def __init__(self) -> None:
            self.offset = 0

        def read(self, size: int) -> memoryview:
            data = stored.read(self.offset, size)
            self.offset += len(data)
            return data

    decoder = zstandard.ZstdDecompressor(max_window_size=MAX_WINDOW_BYTES)
    try:
        with decoder.stream_reader(Source(), read_size=1 << 17) as reader:  # type: ignore[arg-type]
            while block := reader.read(BLOCK):
                yield block
    except zstandard.ZstdError as error:
        raise ValueError(f"zstd: {error}") from error


def _lz4(stored: Region) -> Iterator[bytes]:
    import lz4.frame

    decoder, offset = lz4.frame.LZ4FrameDecompressor(), 0
    try:
        while not decoder.eof:
            data = stored.read(offset, 1 << 17) if decoder.needs_input else memoryview(b"")
            if decoder.needs_input and not data:
                return
            offset += len(data)
            yield decoder.decompress(data, max_length=BLOCK)
    except (RuntimeError, EOFError) as error:
        raise ValueError(f"lz4: {error}") from error
