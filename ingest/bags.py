"""ROS bags to MCAP: ROS 1 bags, rosbag2 recordings and MCAP files become one MCAP of ROS 2 messages (CDR)."""

from __future__ import annotations

import contextlib
import heapq
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple

from scpf.ingest.bag_sources import BagMessage, BagSource, open_sources
from scpf.ingest.bag_types import Passage, header_sequence, passage
from scpf.ingest.drive_log import DriveLogWriter
from scpf.ingest.topics import IMAGE_TYPES
from scpf.models.errors import InputError, UsageError


@dataclass
class TopicReport:
    """What became of a topic. ``counted``: messages that the recording claims; ``problem``: why some are lost."""

    topic: str
    type: str
    counted: int = 0
    read: int = 0
    written: int = 0
    problem: str = ""


@dataclass
class ConversionReport:
    """What a conversion did. ``left_out``: topics that the caller's globs leave out."""

    path: str
    topics: dict[str, TopicReport] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def messages(self) -> int:
        """Messages written."""
        return sum(topic.written for topic in self.topics.values())

    @property
    def lossless(self) -> bool:
        """Whether everything that was asked for is in the output."""
        return not any(topic.problem for topic in self.topics.values())


class _Route(NamedTuple):
    """Where the messages of one input channel go."""

    report: TopicReport
    passage: Passage
    channel: int


def convert(
    inputs: Sequence[Path],
    output: Path,
    *,
    include: Sequence[str] = (),
    exclude: Sequence[str] = (),
    start_s: float | None = None,
    end_s: float | None = None,
    overwrite: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> ConversionReport:
    """Convert recordings, merged by log time, to the MCAP ``output`` (profile ros2, ros2msg, CDR).

    ``include`` (all topics, where empty) and ``exclude`` are globs such as ``/camera/*``. ``start_s`` and
    ``end_s`` keep a part, in seconds after the first message. Log times, order and counts are kept; publish
    times and sequence numbers too where the input has them (MCAP; ``seq`` of ROS 1 headers).

    A topic that cannot be converted is left out, with its reason in the report. Raises InputError where no
    topic matches, or none can be converted, and DamagedError for a recording that cannot be read to its end:
    what was written stays in ``output``.partial.
    """
    if not inputs:
        raise UsageError("no recording to convert")
    report = ConversionReport(str(output))
    with ExitStack() as stack:
        sources = [source for path in inputs for source in open_sources(path, stack)]
        chosen = [_choose(source, include, exclude, report) for source in sources]
        topics = {channel.topic for source in sources for channel in source.channels}
        if not any(chosen) and (topics or include):
            hint = f"topics: {', '.join(sorted(topics)) or 'none'}"
            raise InputError(f"no topic matches {' '.join(include) or 'what --exclude leaves'}", hint)
        for glob in (*include, *exclude):
            if not any(fnmatchcase(topic, glob) for topic in topics):
                report.notes.append(f"no topic matches {glob}")
        passages = [
            {number: found for number in numbers if (found := _passage(source, number, report))}
            for source, numbers in zip(sources, chosen, strict=True)
        ]
        if any(chosen) and not any(passages):
            reasons = "; ".join(f"{topic.topic}: {topic.problem}" for topic in report.topics.values())
            hint = "only ROS messages become a drive log; other images go through `scpf ingest` as files"
            raise InputError(f"none of {len(report.topics)} topics can be converted: {reasons}", hint)
        first_ns = min((source.start_ns for source in sources if source.start_ns is not None), default=0)
        low = None if start_s is None else first_ns + round(start_s * 1e9)
        high = None if end_s is None else first_ns + round(end_s * 1e9)
        with DriveLogWriter(output, overwrite=overwrite) as log:
            routes = _routes(log, sources, passages, report)
            streams = [
                _numbered(k, source.messages(set(found), low, high))
                for k, (source, found) in enumerate(zip(sources, passages, strict=True))
            ]
            _copy(log, streams, routes, progress, sum(topic.counted for topic in report.topics.values()))
            log.metadata(
                "scpf_conversion", {"inputs": ", ".join(path.name for path in inputs), **_lost(report)}
            )
    if low is None and high is None:
        for topic in report.topics.values():
            if topic.read != topic.counted and not topic.problem:
                topic.problem = f"the recording counts {topic.counted} messages and holds {topic.read}"
    return report


def _choose(
    source: BagSource, include: Sequence[str], exclude: Sequence[str], report: ConversionReport
) -> list[int]:
    """The channels that the globs leave."""
    numbers = []
    for number, channel in enumerate(source.channels):
        wanted = not include or any(fnmatchcase(channel.topic, glob) for glob in include)
        if wanted and not any(fnmatchcase(channel.topic, glob) for glob in exclude):
            numbers.append(number)
        elif channel.topic not in report.left_out:
            report.left_out.append(channel.topic)
    return numbers


def _passage(source: BagSource, number: int, report: ConversionReport) -> Passage | None:
    channel = source.channels[number]
    topic = report.topics.setdefault(channel.topic, TopicReport(channel.topic, channel.type))
    topic.counted += channel.count
    try:
        first = None
        if channel.encoding == "cdr":
            first = next((message.data for message in source.messages({number}, None, None)), None)
        found = passage(channel, first)
        if found.note:
            report.notes.append(f"{channel.topic}: {found.note}")
        return found
    except InputError as error:
        topic.problem = f"{channel.count} messages left out: {error.message}"
        return None


def _routes(
    log: DriveLogWriter,
    sources: list[BagSource],
    passages: list[dict[int, Passage]],
    report: ConversionReport,
) -> dict[tuple[int, int], _Route]:
    """Register the output's channels; publishers of one topic and type share one."""
    channels: dict[tuple[str, str, bytes | None, str], int] = {}
    routes = {}
    for k, (source, found) in enumerate(zip(sources, passages, strict=True)):
        for number, way in found.items():
            channel = source.channels[number]
            key = (channel.topic, way.type, way.definition, channel.qos)
            if key not in channels:
                stream = "image" if way.type in IMAGE_TYPES else "small"
                qos = {"offered_qos_profiles": channel.qos}
                channels[key] = log.mcap.add_channel(
                    channel.topic,
                    way.type,
                    way.definition or b"",
                    stream=stream,
                    schema_encoding="" if way.definition is None else "ros2msg",
                    metadata=qos,
                )
            topic = report.topics[channel.topic]
            topic.type = way.type
            routes[k, number] = _Route(topic, way, channels[key])
    return routes


def _numbered(source: int, messages: Iterator[BagMessage]) -> Iterator[tuple[int, int, BagMessage]]:
    for message in messages:
        yield message.log_time_ns, source, message


def _copy(
    log: DriveLogWriter,
    streams: list[Iterator[tuple[int, int, BagMessage]]],
    routes: dict[tuple[int, int], _Route],
    progress: Callable[[int, int], None] | None,
    total: int,
) -> None:
    sequences: dict[int, int] = {}
    done = 0
    for _, source, message in heapq.merge(*streams, key=lambda item: item[:2]):
        done += 1
        if progress is not None:
            progress(done, total)
        route = routes[source, message.channel]
        topic = route.report
        topic.read += 1
        try:
            data = route.passage.convert(message.data)
        except InputError as error:
            lost = topic.read - topic.written
            topic.problem = f"{lost} messages left out, the last at {message.log_time_ns} ns: {error.message}"
            continue
        sequence = sequences.get(route.channel, 0)
        sequences[route.channel] = sequence + 1
        if message.sequence is not None:
            sequence = message.sequence
        elif route.passage.counted_header:
            sequence = header_sequence(message.data)
        log.mcap.add_message(route.channel, message.log_time_ns, data, message.publish_time_ns, sequence)
        topic.written += 1


def _lost(report: ConversionReport) -> dict[str, str]:
    """What the output's metadata say was lost, by topic."""
    with contextlib.suppress(KeyError):
        return {f"lost {topic.topic}": topic.problem for topic in report.topics.values() if topic.problem}
    return {}
