"""``scpf recover``: what can be read of a damaged log becomes a sound one, and the loss is stated."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from scpf.replay.ingest_reports import Counter, plain

if TYPE_CHECKING:
    from scpf.ingest.recover_report import RecoveryReport

MAX_SHOWN = 20


def recover(
    log: Path,
    *,
    output: Annotated[Path, Parameter(alias="-o")],
    keep_damaged: bool = False,
    overwrite: bool = False,
    quiet: Annotated[bool, Parameter(alias="-q")] = False,
    format: Literal["text", "json"] = "text",
) -> int:
    """Save what can be read of a damaged MCAP file: cut short, killed while it was written, corrupt.

    Messages, attachments and metadata go into a new log with an index. Exit code 3: something was lost, or nobody
    can know because the end of the file is missing; what was lost is stated. Exit code 0: nothing was lost.

    Examples:

        scpf recover drive.mcap.partial -o drive.mcap

        scpf recover damaged.mcap -o saved.mcap --keep-damaged --format json

    Parameters
    ----------
    log
        The damaged file; it is not changed.
    output
        The log to write (.mcap).
    keep_damaged
        Also keep the messages of chunks that fail their checksum: some of them are wrong.
    overwrite
        Replace an existing output.
    quiet
        No progress.
    format
        Form of the report on stdout.
    """
    from dataclasses import asdict

    from scpf.ingest.recover import recover as recover_log

    progress = None if quiet else Counter("bytes")
    report = recover_log(log, output, keep_damaged=keep_damaged, overwrite=overwrite, progress=progress)
    if format == "json":
        totals = {"messages": report.messages, "messages_lost": report.messages_lost}
        print(json.dumps({**asdict(report), **totals, "lossless": report.lossless}, indent=1))
    else:
        print_recovery(report)
    return 0 if report.lossless else 3


def print_recovery(report: RecoveryReport) -> None:
    """What was saved and what was lost, topic by topic."""
    lost = "nothing lost" if report.lossless else _loss(report)
    print(f"{report.path}: {report.messages} messages saved, {lost}")
    width = max((len(plain(topic)) for topic in report.topics), default=0)
    for topic in report.topics.values():
        gone = f"{topic.lost:8d} lost" if topic.lost else ""
        print(
            f"  {plain(topic.topic):{width}}  {topic.recovered:8d} saved  {gone:13}  {plain(topic.type)}".rstrip()
        )
    for name in report.attachments:
        print(f"  attachment {plain(name)} saved")
    for name in report.attachments_lost:
        print(f"  attachment {plain(name)} lost")
    if report.metadata_lost:
        print(f"  {report.metadata_lost} records of metadata lost")
    for damage in report.damages[:MAX_SHOWN]:
        size = f", {damage.length_bytes} bytes" if damage.length_bytes else ""
        print(f"  byte {damage.offset}{size}: {plain(damage.what)}")
    more = len(report.damages) - MAX_SHOWN + report.damages_not_listed
    if more > 0:
        print(f"  {more} more damaged places")
    if not report.complete:
        print("  the end of the file is missing: what was to come after it is not known")


def _loss(report: RecoveryReport) -> str:
    count = f"{report.messages_lost} messages"
    if not report.lost_known:
        count = f"at least {count}" if report.messages_lost else "an unknown number of messages"
    lost = f"{count} and {report.lost_bytes} bytes lost"
    if report.chunks_lost:
        lost += f", {report.chunks_lost} of {report.chunks} chunks among them"
    if report.unverified:
        lost += f"; no checksum speaks for {report.unverified} of those saved"
    return lost
