"""MCAP files by hand, damaged in every way that is known: the table of what recording and copying do to logs."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Sequence

import lz4.frame
from mcap.writer import CompressionType, Writer

MAGIC = b"\x89MCAP0\r\n"
TEXT = b"uint8[] data\n"
Chunk = tuple[bytes, int, bytes, list[tuple[int, int]]]
"""A chunk record, the declared size of its records, its compression, and its messages' times and places."""


def record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def text(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value


def schema(name: bytes = b"a/msg/A") -> bytes:
    return record(3, struct.pack("<H", 1) + text(name) + text(b"ros2msg") + text(TEXT))


def channel(topic: bytes = b"/a") -> bytes:
    return record(4, struct.pack("<HH", 1, 1) + text(topic) + text(b"cdr") + text(b""))


def message(k: int, time_ns: int, size: int = 20, channel_id: int = 1, declared: int | None = None) -> bytes:
    data = b"\0\1\0\0" + struct.pack("<I", size) + bytes([65 + k % 26]) * size
    body = struct.pack("<HIQQ", channel_id, k, time_ns, time_ns) + data
    return struct.pack("<BQ", 5, len(body) if declared is None else declared) + body


def messages(count: int = 5, start_ns: int = 1000, step_ns: int = 10) -> tuple[bytes, list[tuple[int, int]]]:
    data, places = b"", []
    for k in range(count):
        places.append((start_ns + k * step_ns, len(data)))
        data += message(k, start_ns + k * step_ns)
    return data, places


def chunk(
    data: bytes,
    places: list[tuple[int, int]],
    compression: bytes = b"",
    *,
    size: int | None = None,
    crc: int | None = None,
    declared: int | None = None,
) -> Chunk:
    """``size``: what it declares unpacked, ``declared``: what it declares packed."""
    size = len(data) if size is None else size
    crc = zlib.crc32(data) if crc is None else crc
    times = [time_ns for time_ns, _ in places] or [0]
    head = struct.pack("<QQQI", min(times), max(times), size, crc) + text(compression)
    stored = struct.pack("<Q", len(data) if declared is None else declared)
    return record(6, head + stored + data), size, compression, places


def whole(
    chunks: Sequence[Chunk], *, index: bool = True, message_index: bool = True, before: bytes = b""
) -> bytes:
    """A file of chunks, with its index; all records are in order, whatever the chunks hold."""
    out = bytearray(MAGIC + record(1, text(b"ros2") + text(b"x")) + before + schema() + channel())
    entries, count = b"", 0
    for data, size, compression, places in chunks:
        start, count = len(out), count + len(places)
        out += data
        at, times = len(out), [time_ns for time_ns, _ in places] or [0]
        rows = b"".join(struct.pack("<QQ", *place) for place in places)
        after = record(7, struct.pack("<HI", 1, len(rows)) + rows) if message_index else b""
        out += after
        offsets = struct.pack("<IHQ", 10, 1, at) if message_index else struct.pack("<I", 0)
        head = struct.pack("<QQQQ", min(times), max(times), start, len(data)) + offsets
        sizes = struct.pack("<QQ", len(data) - 49 - len(compression), size)
        entries += record(8, head + struct.pack("<Q", len(after)) + text(compression) + sizes)
    out += record(15, struct.pack("<I", 0))
    summary_start = len(out)
    if index:
        statistics = struct.pack("<QHIIIIQQI", count, 1, 1, 0, 0, len(chunks), 1000, 2000, 10)
        out += schema() + channel() + record(11, statistics + struct.pack("<HQ", 1, count)) + entries
    return bytes(out) + record(2, struct.pack("<QQI", summary_start if index else 0, 0, 0)) + MAGIC


def by_library(compression: CompressionType, count: int = 20, *, crcs: bool = True) -> bytes:
    """A sound file of the reference library."""
    out = io.BytesIO()
    writer = Writer(out, chunk_size=2000, compression=compression, enable_crcs=crcs)
    writer.start("ros2")
    channel_id = writer.register_channel("/a", "cdr", writer.register_schema("a/msg/A", "ros2msg", TEXT))
    for k in range(count):
        data = b"\0\1\0\0" + struct.pack("<I", 400) + bytes([65 + k % 26]) * 400
        writer.add_message(channel_id, 1000 + 10 * k, data, 1000 + 10 * k, k)
    writer.finish()
    return out.getvalue()


def zstd_bomb(size: int, *, says_so: bool) -> bytes:
    """A frame of ``size`` zeros in run-length blocks of 128 KiB: 131 kB become 4 GiB."""
    head = b"\x28\xb5\x2f\xfd" + (b"\xc0\x38" + struct.pack("<Q", size) if says_so else b"\x00\x38")
    blocks = size >> 17
    run = (1 << 1 | (1 << 17) << 3).to_bytes(3, "little") + b"\0"
    last = (1 | 1 << 1 | (1 << 17) << 3).to_bytes(3, "little") + b"\0"
    return head + run * (blocks - 1) + last


def cases() -> dict[str, tuple[bytes, int | None, int]]:
    """Name → the file, messages that recover saves (None: nothing, an error), messages that the log then lacks."""
    data, places = messages()
    flipped = bytearray(data)
    flipped[60] ^= 0xFF
    sound = chunk(data, places)
    plain, packed = by_library(CompressionType.NONE), by_library(CompressionType.ZSTD)
    stream = by_library(CompressionType.LZ4)
    lying = data[:1] + struct.pack("<Q", 1 << 60) + data[9:]
    backwards, backwards_places = messages(5, 5000, -900)
    later, later_places = messages(5, 3000)
    strange = message(0, 1000, channel_id=9)
    bomb = zstd_bomb(4 << 30, says_so=True)
    hidden = zstd_bomb(4 << 30, says_so=False)
    lz4_bomb = lz4.frame.compress(bytes(256 << 20))
    other = schema() + channel(b"/other")

    def one(*args: object, **kwargs: object) -> bytes:
        return whole([chunk(*args, **kwargs)])  # type: ignore[arg-type]

    def lost(packed_data: bytes, compression: bytes, size: int) -> bytes:
        return whole([sound, chunk(packed_data, later_places, compression, size=size, crc=0)])

    return {
        "sound": (plain, 20, 0),
        "sound, zstd": (packed, 20, 0),
        "sound, lz4": (stream, 20, 0),
        "cut at 60 %": (plain[: len(plain) * 6 // 10], 12, -1),
        "cut at 60 %, zstd": (packed[: len(packed) * 6 // 10], 20, -1),
        "cut at 60 %, lz4": (stream[: len(stream) * 6 // 10], 15, -1),
        "cut in the last magic": (plain[:-4], 20, -1),
        "cut after the header": (plain[:40], None, 0),
        "empty": (b"", None, 0),
        "magic alone": (MAGIC, None, 0),
        "no index": (whole([sound], index=False), 5, 0),
        "index beyond the end": (plain[:-37] + record(2, struct.pack("<QQI", 1 << 50, 0, 0)) + MAGIC, 20, 0),
        "bit flip under a checksum": (whole([sound, chunk(bytes(flipped), places, crc=sound_crc(data))]), 5, 5),
        "unknown compression": (lost(b"garbage" * 9, b"brotli", 145), 5, 5),
        "message of 2^60 bytes": (one(lying, places), 4, 1),
        "record of 2^62 bytes": (
            MAGIC + record(1, text(b"") * 2) + schema() + channel() + data[:59] + struct.pack("<BQ", 5, 1 << 62)
            + b"abc" + record(15, bytes(4)) + record(2, bytes(20)) + MAGIC, 1, -1,
        ),
        "chunk of 2^40 bytes": (one(data, places, declared=1 << 40), 5, 0),
        "chunk of 8 GB": (one(data, places, declared=8 << 30), 5, 0),
        "chunk of 2 GB": (one(data, places, declared=2 << 30), 5, 0),
        "schema of 4 GB": (
            MAGIC + record(1, text(b"") * 2) + record(3, b"\1\0\xff\xff\xff\xffabc") + schema() + channel() + data
            + record(15, bytes(4)) + record(2, bytes(20)) + MAGIC, 5, -1,
        ),
        "chunk index without message index": (whole([sound], message_index=False), 5, 0),
        "zstd bomb that declares little": (lost(bomb, b"zstd", 500), 5, 5),
        "zstd bomb that declares nothing": (lost(hidden, b"zstd", 500), 5, 5),
        "zstd bomb that declares itself": (lost(bomb, b"zstd", 4 << 30), 5, 5),
        "lz4 bomb": (lost(lz4_bomb, b"lz4", 500), 5, 5),
        "empty chunk": (whole([chunk(b"", []), sound]), 5, 0),
        "times backwards in a chunk": (one(backwards, backwards_places), 5, 0),
        "chunks backwards": (whole([chunk(later, later_places), sound]), 10, 0),
        "one id, two topics": (whole([sound], before=other), 5, 0),
        "one id, two topics, in a chunk": (
            whole([chunk(channel(b"/other") + data, [(t, p + len(channel(b"/other"))) for t, p in places])]), 5, -1,
        ),
        "message of an unknown channel": (
            whole([chunk(strange + data, [(1000, 0)] + [(t, p + len(strange)) for t, p in places])]), 5, 1,
        ),
    }  # fmt: skip


def sound_crc(data: bytes) -> int:
    """The checksum of data before they were damaged."""
    return zlib.crc32(data)


def repack(data: bytes) -> bytes:
    """The same records as one file without checksums and compression, so that damage reaches the messages."""
    from mcap.reader import make_reader

    reader = make_reader(io.BytesIO(data))
    out = io.BytesIO()
    options = {"enable_crcs": False, "enable_data_crcs": False, "compression": CompressionType.NONE}
    writer = Writer(out, chunk_size=4000, **options)  # type: ignore[arg-type]
    writer.start("ros2")
    ids: dict[int, int] = {}
    for its_schema, its_channel, item in reader.iter_messages():
        if its_channel.id not in ids:
            assert its_schema is not None
            schema_id = writer.register_schema(its_schema.name, its_schema.encoding, its_schema.data)
            ids[its_channel.id] = writer.register_channel(
                its_channel.topic, its_channel.message_encoding, schema_id, its_channel.metadata
            )
        writer.add_message(ids[its_channel.id], item.log_time, item.data, item.publish_time, item.sequence)
    for attachment in reader.iter_attachments():
        writer.add_attachment(0, 0, attachment.name, attachment.media_type, attachment.data)
    for entry in reader.iter_metadata():
        writer.add_metadata(entry.name, entry.metadata)
    writer.finish()
    return out.getvalue()
