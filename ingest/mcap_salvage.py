"""Going through a damaged MCAP file: where its records are, which chunks may be believed, and what lies between."""

from __future__ import annotations

from collections.abc import Callable

from scpf.ingest.mcap_scan import Record, Region, Scanner
from scpf.ingest.mcap_summary import MAGIC
from scpf.ingest.mcap_unpack import Budget, Unpacked, read_head, unpack
from scpf.ingest.recover_contents import Contents

_CHUNK, _ATTACHMENT = 6, 9


class Salvage:
    """Takes every record of a file's ``region`` that is one to ``contents``."""

    def __init__(
        self,
        region: Region,
        contents: Contents,
        *,
        keep_damaged: bool,
        progress: Callable[[int, int], None] | None,
    ) -> None:
        self._region, self._contents, self._report = region, contents, contents.report
        self._keep_damaged, self._progress = keep_damaged, progress
        self._budget = Budget(region.length)

    def run(self, start: int) -> None:
        """Go through the whole file from ``start`` on, and settle the account."""
        self._walk(self._region, start, None)
        self._contents.settle()
        if self._progress is not None:
            self._progress(self._region.length, self._region.length)

    def _walk(self, region: Region, at: int, chunk: Record | None) -> None:
        """Take every record of a region: of the file, or of the unpacked ``chunk``."""
        scanner = Scanner(region, in_chunk=chunk is not None)
        while at < region.length:
            if chunk is None and self._progress is not None:
                self._progress(at, region.length)
            record = scanner.record(at)
            if record is None:
                at = self._skip(scanner, at, chunk)
                continue
            drop: Callable[[], None] | None = None
            if chunk is None and record.opcode in (_CHUNK, _ATTACHMENT):
                drop = self._take_checked(record)
                if drop is None:
                    at = record.end
                    continue
            if not scanner.follows(record.end):
                # Either this record's length lies, and others begin within it, or the next one is damaged.
                resume = scanner.next_record(at + 1, self._contents.channels)
                if resume < record.end:
                    what = "a record declares a length that it does not have"
                    self._contents.lose(at, resume - at, what, chunk)
                    at = resume
                    continue
            if drop is not None:
                drop()
            else:
                self._contents.take(region, record, chunk)
            at = record.end

    def _skip(self, scanner: Scanner, at: int, chunk: Record | None) -> int:
        """Where to go on after a place that is no record."""
        region = scanner.region
        if chunk is None and region.read(at, len(MAGIC)) == MAGIC:
            return at + len(MAGIC)
        if chunk is None and region.length - at >= 49 and region.read(at, 1)[0] == _CHUNK:
            inside = self._cut_chunk(scanner, at)
            if inside is not None:
                return inside
        resume = scanner.next_record(at + 1, self._contents.channels)
        cut = resume == region.length and chunk is None
        self._contents.lose(at, resume - at, "cut short, or not a record" if cut else "not a record", chunk)
        return resume

    def _cut_chunk(self, scanner: Scanner, at: int) -> int | None:
        """A chunk that reaches past the end: what can be unpacked of it is taken. Of one that is not packed, where
        its records begin: they are gone through as if they were the file's own."""
        record = Record(_CHUNK, at, at + 9, self._region.length + 1)
        head = read_head(self._region, record)
        self._contents.begin_chunk()
        if head.compression == "" and scanner.record(head.data) is not None:
            self._report.chunks += 1
            return head.data
        if head.compression in ("zstd", "lz4") and head.stored > 0:
            unpacked = unpack(self._region, head, self._budget)
            if unpacked.usable:
                self._report.chunks += 1
                self._take_unverified(record, unpacked)
        return None

    def _take_checked(self, record: Record) -> Callable[[], None] | None:
        """Take a chunk or an attachment that is as its checksum says; else what to do if it is really one."""
        if record.opcode == _ATTACHMENT:
            taken = self._contents.take_attachment(self._region, record)
            return None if taken else lambda: self._contents.drop_attachment(record)
        unpacked = unpack(self._region, read_head(self._region, record), self._budget)
        if not unpacked.usable:
            return lambda: self._drop_chunk(record, unpacked)
        self._contents.begin_chunk()
        self._report.chunks += 1
        self._walk(unpacked.records, 0, record)
        return None

    def _drop_chunk(self, record: Record, unpacked: Unpacked) -> None:
        """Leave out a chunk that fails its check, or take it in spite of it where that is wanted."""
        self._contents.begin_chunk()
        self._report.chunks += 1
        if self._keep_damaged and unpacked.records.length:
            self._take_unverified(record, unpacked)
            self._report.damage(record.start, 0, f"a chunk {unpacked.problem}; its messages are kept")
        else:
            self._report.chunks_lost += 1
            self._report.damage(record.start, record.end - record.start, f"a chunk {unpacked.problem}")

    def _take_unverified(self, record: Record, unpacked: Unpacked) -> None:
        before = self._contents.taken.total()
        self._walk(unpacked.records, 0, record)
        self._report.unverified += self._contents.taken.total() - before
