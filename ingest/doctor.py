"""Examining a log: every finding is collected, each with what to do about it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from scpf.ingest.decoding import schema_store
from scpf.ingest.doctor_contents import CHECKS
from scpf.ingest.doctor_facts import TopicFacts, gather
from scpf.ingest.doctor_times import check_times
from scpf.ingest.drive_log import DriveLog
from scpf.ingest.findings import SEVERITIES, Finding
from scpf.ingest.mcap_files import read_attachment, read_metadata
from scpf.ingest.mcap_read import McapFile
from scpf.models.errors import ScpfError


@dataclass
class Examination:
    """The findings of a log, the worst first. ``deep``: whether every image was decoded."""

    path: str
    messages: int
    topics: int
    deep: bool
    findings: list[Finding] = field(default_factory=list)

    @property
    def fine(self) -> bool:
        """Whether nothing was found but notes."""
        return all(finding.severity == "note" for finding in self.findings)


def examine(
    path: Path, *, deep: bool = False, progress: Callable[[int, int], None] | None = None
) -> Examination:
    """Read a whole log and collect what is wrong with it. Raises DamagedError for a file that cannot be opened."""
    with DriveLog(path) as log:
        counts = [channel.count for channel in log.channels.values()]
        found = Examination(str(path), sum(counts), len(counts), deep)
        facts = gather(log, deep, progress)
        findings = [*_schemas(log, facts, path), *_attachments(path), *_topics(facts, path)]
        for check in CHECKS:
            try:
                findings += check(log, facts)
            except ScpfError as error:
                findings.append(Finding("error", "", error.message, error.hint or _recover(path)))
    known: set[tuple[str, str]] = set()
    messages: set[str] = set()
    for finding in sorted(findings, key=lambda item: SEVERITIES.index(item.severity)):
        # One damaged chunk meets many checks; it is one finding.
        repeated = (finding.about, finding.message) in known or (
            not finding.about and finding.message in messages
        )
        if not repeated:
            found.findings.append(finding)
        known.add((finding.about, finding.message))
        messages.add(finding.message)
    return found


def _topics(facts: dict[str, TopicFacts], path: Path) -> Iterator[Finding]:
    for topic, fact in sorted(facts.items()):
        if fact.damage:
            yield Finding("error", topic, fact.damage, _recover(path))
        if not fact.log_ns and not fact.damage:
            yield Finding("note", topic, "the topic is announced and holds no message", "")
        if fact.undecodable:
            text = f"{fact.undecodable} of {len(fact.log_ns)} messages cannot be decoded: {fact.problem}"
            yield Finding("warning", topic, text, "is the message type the one that was recorded?")
        yield from check_times(fact)


def _schemas(log: DriveLog, facts: dict[str, TopicFacts], path: Path) -> Iterator[Finding]:
    for channel in log.mcap_channels:
        kind = channel.schema.name if channel.schema else "no type"
        if channel.encoding != "cdr":
            text = f"{kind} as {channel.encoding or 'an unnamed encoding'}: kept, but not read"
            yield Finding("note", channel.topic, text, "a replay reads ROS 2 messages (cdr)")
            continue
        try:
            schema_store(channel, path)
        except ScpfError as error:
            yield Finding(
                "warning", channel.topic, error.message, error.hint or "record the message definition, too"
            )
            facts.get(channel.topic, TopicFacts("", "")).undecodable = 0  # said once is enough


def _attachments(path: Path) -> Iterator[Finding]:
    with McapFile(path) as mcap:
        for entry in mcap.index.attachments:
            try:
                read_attachment(mcap, entry)
            except ScpfError as error:
                yield Finding(
                    "error", entry.name, error.message, "attach it again: ingest with the original file"
                )
        for offset, length in mcap.index.metadata:
            try:
                read_metadata(mcap, offset, length)
            except ScpfError as error:
                yield Finding("warning", "metadata", error.message, _recover(path))


def _recover(path: Path) -> str:
    return f"save the rest with `scpf recover {path.name} -o saved.mcap`"
