"""The plan of a conversion: which channels of which recording are wanted, and how each passes into the output."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from scpf.ingest.bag_choice import TopicChoice
from scpf.ingest.bag_output import BagOutput, OutChannel
from scpf.ingest.bag_report import ConversionReport, Options, TopicReport
from scpf.ingest.bag_source import BagMessage, BagSource
from scpf.ingest.bag_types import Passage, passage
from scpf.ingest.topics import IMAGE_TOPIC
from scpf.models.errors import InputError


@dataclass(eq=False)
class Route:
    """Where the messages of one input channel go."""

    report: TopicReport
    passage: Passage
    topic: str
    """In the output."""
    channel: OutChannel | None = None

    @property
    def key(self) -> tuple[str, str]:
        """Topic and type in the output."""
        return self.topic, self.passage.type


@dataclass
class Plan:
    """``wanted``: the channels of each source that are converted; ``routes``: by source and channel."""

    sources: Sequence[BagSource]
    wanted: list[set[int]]
    routes: dict[tuple[int, int], Route]
    low_ns: int | None
    high_ns: int | None

    @property
    def ranged(self) -> bool:
        """Whether only a part of the time is wanted."""
        return self.low_ns is not None or self.high_ns is not None

    def open_channels(self, out: BagOutput, images: Iterable[str]) -> None:
        """Make the output's channels; publishers of one topic, type and quality of service share one.

        ``images``: topics of encoded images that a mapping gives the drive log's name.
        """
        renamed = set(images)
        made: dict[tuple[object, ...], OutChannel] = {}
        for route in self.routes.values():
            way = route.passage
            metadata: Mapping[str, str] = way.metadata
            if route.topic in renamed and route.topic != IMAGE_TOPIC:
                metadata = {**metadata, "source_topic": route.topic}
                route.topic = route.report.renamed_to = IMAGE_TOPIC
            items = tuple(metadata.items())
            key = (route.topic, way.type, way.definition, way.encoding, items)
            if key not in made:
                made[key] = out.add_channel(
                    OutChannel(
                        route.topic, way.type, way.definition or b"", way.encoding, way.schema_encoding, items
                    )
                )
            route.channel = made[key]

    def messages(self) -> Iterator[tuple[Route, BagMessage]]:
        """All wanted messages, by log time, then by input."""
        numbers = [k for k, wanted in enumerate(self.wanted) if wanted]
        streams = [self.sources[k].messages(self.wanted[k], self.low_ns, self.high_ns) for k in numbers]
        if len(streams) == 1:  # the frequent case, without the cost of merging
            routes = {number: route for (_, number), route in self.routes.items()}
            for message in streams[0]:
                yield routes[message.channel], message
            return
        numbered = [_numbered(k, stream) for k, stream in zip(numbers, streams, strict=True)]
        for _, k, message in heapq.merge(*numbered, key=lambda item: item[:2]):
            yield self.routes[k, message.channel], message


def _numbered(source: int, messages: Iterator[BagMessage]) -> Iterator[tuple[int, int, BagMessage]]:
    for message in messages:
        yield message.log_time_ns, source, message


def make_plan(sources: Sequence[BagSource], options: Options, report: ConversionReport) -> Plan:
    """Choose topics and find their passages. Raises InputError where no topic matches, or none can be converted."""
    choice = TopicChoice(options.include, options.exclude)
    topics = sorted({channel.topic for source in sources for channel in source.channels})
    chosen = [[k for k, channel in enumerate(source.channels) if choice(channel.topic)] for source in sources]
    if not any(chosen) and (topics or options.include):
        raise InputError(f"no topic matches {choice}", f"topics: {', '.join(topics) or 'none'}")
    report.left_out = [topic for topic in topics if not choice(topic)]
    report.notes += [f"no topic matches {pattern}" for pattern in choice.unmatched(topics)]
    routes: dict[tuple[int, int], Route] = {}
    for k, (source, numbers) in enumerate(zip(sources, chosen, strict=True)):
        for number in numbers:
            route = _route(source, number, options, report)
            if route is not None:
                routes[k, number] = route
    if any(chosen) and not routes:
        reasons = "; ".join(f"{topic.topic}: {topic.problem}" for topic in report.topics.values())
        hint = "only ROS messages become a drive log; other images go through `scpf ingest` as files"
        raise InputError(f"none of {len(report.topics)} topics can be converted: {reasons}", hint)
    first_ns = min((source.start_ns for source in sources if source.start_ns is not None), default=0)
    low = None if options.start_s is None else first_ns + round(options.start_s * 1e9)
    high = None if options.end_s is None else first_ns + round(options.end_s * 1e9)
    wanted = [{number for at, number in routes if at == k} for k in range(len(sources))]
    return Plan(sources, wanted, routes, low, high)


def _route(source: BagSource, number: int, options: Options, report: ConversionReport) -> Route | None:
    channel = source.channels[number]
    topic = report.topics.setdefault(channel.topic, TopicReport(channel.topic, channel.type))
    topic.counted += channel.count
    try:
        first = None
        if channel.encoding == "cdr" and options.encoding == "ros2":
            first = next((message.data for message in source.messages({number}, None, None)), None)
        found = passage(channel, first, options.encoding)
    except InputError as error:
        topic.problem = f"{channel.count} messages left out: {error.message}"
        return None
    note = f"{channel.topic}: {found.note}"
    if found.note and note not in report.notes:
        report.notes.append(note)
    topic.type = found.type
    return Route(topic, found, channel.topic)
