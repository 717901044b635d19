"""Attachments and metadata of an MCAP file, checked."""

from __future__ import annotations

import zlib
from typing import Final

from scpf.ingest.mcap_index import AttachmentEntry, Cursor, damaged
from scpf.ingest.mcap_read import McapFile

MAX_ATTACHMENT_BYTES: Final = 512 << 20


def read_attachment(mcap: McapFile, entry: AttachmentEntry) -> bytes:
    """The bytes of an attachment. DamagedError where it contradicts the index or fails its checksum."""
    if entry.length > MAX_ATTACHMENT_BYTES:
        text = f"attachment {entry.name!r} of {entry.length} bytes, more than 512 MiB"
        raise damaged(mcap.path, entry.offset, text)
    record = memoryview(mcap.read_exactly(entry.offset, entry.length, f"attachment {entry.name!r}"))
    opcode, cursor = Cursor(record, mcap.path, entry.offset).record()
    if opcode != 9:
        raise damaged(mcap.path, entry.offset, f"no attachment where the index has {entry.name!r}")
    cursor.unpack("<QQ")
    name = cursor.text()
    cursor.text()
    data = cursor.take(cursor.unpack("<Q")[0])
    checked = cursor.position
    (crc,) = cursor.unpack("<I")
    if crc and zlib.crc32(record[9 : 9 + checked]) != crc:
        raise damaged(mcap.path, entry.offset, f"attachment {entry.name!r} fails its checksum")
    if (name, len(data)) != (entry.name, entry.size):
        raise damaged(mcap.path, entry.offset, f"attachment {entry.name!r} contradicts the index")
    return bytes(data)


def read_metadata(mcap: McapFile, offset: int, length: int) -> tuple[str, dict[str, str]]:
    """Name and values of a metadata record."""
    if length > MAX_ATTACHMENT_BYTES:
        raise damaged(mcap.path, offset, f"a metadata record of {length} bytes, more than 512 MiB")
    record = memoryview(mcap.read_exactly(offset, length, "a metadata record"))
    opcode, cursor = Cursor(record, mcap.path, offset).record()
    if opcode != 12:
        raise damaged(mcap.path, offset, "no metadata record where the index has one")
    name = cursor.text()
    return name, cursor.mapping()
