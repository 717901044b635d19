"""What the examination of a log needs to know of each topic, gathered in one pass over the log."""

from __future__ import annotations

import io
import zlib
from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any, Final

from scpf.ingest.drive_log import DriveLog, Message
from scpf.models.errors import ScpfError

IMAGE_TYPE: Final = "sensor_msgs/msg/CompressedImage"


@dataclass
class TopicFacts:
    """A topic in the order of its log times (ns). The lists are of one length, but for what cannot be decoded."""

    topic: str
    type: str
    log_ns: list[int] = field(default_factory=list)
    sensor_ns: list[int] = field(default_factory=list)
    sequences: list[int] = field(default_factory=list)
    headed: bool = False
    """Whether the messages have a header, and so a time of their own."""
    undecodable: int = 0
    problem: str = ""
    """Why the first of them cannot be decoded."""
    damage: str = ""
    """What ended the reading of the topic."""
    checksums: list[int] = field(default_factory=list)
    sizes_px: Counter[tuple[int, int]] = field(default_factory=Counter)
    unreadable: list[tuple[int, str]] = field(default_factory=list)
    """Time and reason of each image that is none."""


def gather(
    log: DriveLog, deep: bool, progress: Callable[[int, int], None] | None = None
) -> dict[str, TopicFacts]:
    """Facts of every topic. ``deep`` decodes every image, otherwise only its header is read.

    Where a chunk is damaged, each topic is read by itself, so that the others are known whole.
    """
    try:
        return _gather(log, None, deep, progress)
    except ScpfError:
        facts: dict[str, TopicFacts] = {}
        for topic in log.channels:
            facts |= _gather(log, [topic], deep, progress, keep_going=True)
        return facts


def _gather(
    log: DriveLog,
    topics: Collection[str] | None,
    deep: bool,
    progress: Callable[[int, int], None] | None,
    keep_going: bool = False,
) -> dict[str, TopicFacts]:
    chosen = log.channels if topics is None else topics
    facts = {topic: TopicFacts(topic, log.channels[topic].type) for topic in chosen}
    total = sum(channel.count for channel in log.channels.values())
    try:
        for done, record in enumerate(log.messages(topics), 1):
            _add(facts[record.topic], record, deep)
            if progress is not None:
                progress(done, total)
    except ScpfError as error:
        if not keep_going:
            raise
        for fact in facts.values():
            fact.damage = error.message
    return facts


def _add(fact: TopicFacts, record: Message, deep: bool) -> None:
    fact.log_ns.append(record.stamp_ns)
    fact.sequences.append(record.sequence)
    if record.encoding != "cdr":
        return
    try:
        message = record.message
        fact.sensor_ns.append(record.sensor_ns)
    except ScpfError as error:
        fact.undecodable += 1
        fact.problem = fact.problem or error.message
        return
    fact.headed = fact.headed or hasattr(message, "header")
    if fact.type == IMAGE_TYPE:
        _image(fact, record, message, deep)


def _image(fact: TopicFacts, record: Message, message: Any, deep: bool) -> None:
    data = getattr(message, "data", b"")
    fact.checksums.append(zlib.crc32(data))
    try:
        fact.sizes_px[image_size(data, deep)] += 1
    except ValueError as error:
        fact.unreadable.append((record.stamp_ns, str(error)))


def image_size(data: Any, deep: bool) -> tuple[int, int]:
    """Width and height of JPEG or PNG bytes, by the header, or ``deep`` by decoding all of it; ValueError for none."""
    from PIL import Image

    try:
        with Image.open(io.BytesIO(data), formats=("JPEG", "PNG")) as image:
            if deep:
                image.load()
            return image.size
    except Exception as error:  # Pillow's decoders raise what they like
        raise ValueError(
            f"{type(error).__name__}: {error}".replace("<_io.BytesIO object at ", "(")
        ) from error
