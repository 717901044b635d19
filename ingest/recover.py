"""Saving what can be read of a damaged MCAP file: cut short, killed while it was written, corrupt, or lying.

The file is read once from its beginning, record by record, without trusting the index at its end; where no record
is, the search goes on to the next certain one. Memory is bounded whatever the file declares.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, Final

from scpf.ingest.drive_log import library_name
from scpf.ingest.mcap_index import FOREIGN, damaged, read_index
from scpf.ingest.mcap_salvage import Salvage
from scpf.ingest.mcap_scan import Region, Scanner
from scpf.ingest.mcap_summary import MAGIC
from scpf.ingest.mcap_write import McapWriter
from scpf.ingest.recover_contents import Contents
from scpf.ingest.recover_report import RecoveryReport
from scpf.models.errors import InputError, ScpfError, UsageError

RECOVERY_METADATA: Final = "scpf_recovery"
_LOOK_FOR_START_BYTES: Final = 1 << 20


def recover(
    source: Path,
    output: Path,
    *,
    keep_damaged: bool = False,
    overwrite: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> RecoveryReport:
    """Write all readable messages, attachments and metadata of ``source`` to the drive log ``output``.

    Messages of a chunk whose checksum fails are left out, since nobody knows which of them is wrong, unless
    ``keep_damaged``. Raises DamagedError for a file that is no MCAP file, or holds nothing that can be read;
    then nothing is written.
    """
    if output.exists():
        if source.exists() and output.samefile(source):
            raise UsageError(f"{output} is the damaged file itself", "give --output another name")
        if not overwrite:
            raise InputError(f"{output} exists", "choose another name, or give --overwrite")
    # Not NAME.partial: that is what a killed writer leaves, and may be the very file to recover.
    unfinished = output.with_name(output.name + ".recovering")
    try:
        with source.open("rb") as file, unfinished.open("wb") as out:
            report = recover_into(file, source, out, keep_damaged=keep_damaged, progress=progress)
            out.flush()
            os.fsync(out.fileno())
        unfinished.replace(output)
    except OSError as error:
        raise InputError(f"{error.filename or f'{source} → {output}'}: {error.strerror or error}") from error
    finally:
        unfinished.unlink(missing_ok=True)
    report.path = str(output)
    return report


def recover_into(
    file: BinaryIO,
    source: Path,
    out: BinaryIO,
    *,
    keep_damaged: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> RecoveryReport:
    """``recover`` from and to open files; ``source`` names the damaged one in messages."""
    size = file.seek(0, os.SEEK_END)
    region = Region(file, 0, size)
    start = _start(region, source)
    report = RecoveryReport("", str(source), size)
    if start:
        report.damage(0, start, "the file does not begin as an MCAP file")
    writer = McapWriter(out, library_name(), _profile(region, start))
    contents = Contents(source, writer, report)
    try:
        index = read_index(file, source)
    except ScpfError:
        pass  # the index is a help, not a condition: its damage is noted where the scan meets it
    else:
        contents.channels.update(index.channels)
    Salvage(region, contents, keep_damaged=keep_damaged, progress=progress).run(start)
    if not (report.messages or report.attachments or report.metadata) and not report.lossless:
        raise damaged(source, 0, "no message, attachment or metadata can be read", "there is nothing to save")
    loss = {
        "bytes": report.lost_bytes,
        "messages": report.messages_lost,
        "messages_known": report.lost_known,
        "topics": {topic.topic: topic.lost for topic in report.topics.values() if topic.lost},
        "attachments": report.attachments_lost,
        "complete": report.complete,
    }
    writer.add_metadata(RECOVERY_METADATA, {"source": source.name, "loss": json.dumps(loss)})
    writer.finish()
    return report


def _start(region: Region, path: Path) -> int:
    """Where the records begin: after the magic bytes, or where a file without them has its first record."""
    head = bytes(region.read(0, 1024))
    if head.startswith(MAGIC):
        return 0
    for magic, (what, remedy) in FOREIGN.items():
        if head.startswith(magic):
            raise damaged(path, 0, f"this is {what}, not an MCAP file", remedy)
    if not head:
        raise damaged(path, 0, "the file is empty", "there is nothing to save")
    begin = region.part(0, _LOOK_FOR_START_BYTES)
    found = Scanner(begin, in_chunk=False).next_record(0, ())
    ends_well = bytes(region.read(max(0, region.length - len(MAGIC)), len(MAGIC))) == MAGIC
    if found == begin.length and not ends_well:
        raise damaged(
            path, 0, "this is not an MCAP file", "a drive log comes from `scpf ingest` or `scpf convert`"
        )
    return found if found < begin.length else 1


def _profile(region: Region, start: int) -> str:
    """The profile that the header states; ``ros2`` where there is none to read."""
    at = start or len(MAGIC)
    record = Scanner(region, in_chunk=False).record(at)
    if record is None or record.opcode != 1:
        return "ros2"
    length = int.from_bytes(region.read(record.body, 4), "little")
    return str(region.read(record.body + 4, length), "utf-8", "replace")
