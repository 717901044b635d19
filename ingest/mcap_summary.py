"""The end of an MCAP file: the summary that makes it readable in any order, and the footer."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from typing import Any, Final

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Footer, SummaryOffset

MAGIC: Final = bytes([137]) + b"MCAP0\r\n"


def encode_record(record: Any) -> bytes:
    """A record of the mcap library as the file has it."""
    builder: Any = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data


def encode_summary(groups: Sequence[tuple[Opcode, Sequence[Any]]], start: int) -> bytes:
    """Summary, summary offsets, footer with its checksum, and the closing magic, as they lie at ``start``."""
    summary, offsets = b"", b""
    for opcode, records in groups:
        group = b"".join(encode_record(record) for record in records)
        if group:
            offsets += encode_record(SummaryOffset(opcode, start + len(summary), len(group)))
        summary += group
    footer = encode_record(Footer(start, start + len(summary), 0))
    crc = zlib.crc32(footer[:-4], zlib.crc32(offsets, zlib.crc32(summary)))
    return summary + offsets + footer[:-4] + struct.pack("<I", crc) + MAGIC
