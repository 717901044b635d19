"""What a conversion was asked for, and what it did."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from scpf.ingest.bag_output import Compression, Split
from scpf.models.errors import UsageError

if TYPE_CHECKING:
    from scpf.models.geodesy import Origin

Encoding = Literal["ros2", "ros1"]


@dataclass(frozen=True)
class Options:
    """What a conversion is asked for.

    ``include`` (all topics, where empty) and ``exclude`` are globs, or regular expressions after ``re:``.
    ``start_s`` and ``end_s`` keep a part, in seconds after the first message. ``mapping`` names a topic mapping
    (a built-in one, a TOML file, ``auto`` or ``none``); ``road_map`` is attached; ``origin`` is that of ``map``.
    """

    encoding: Encoding = "ros2"
    include: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    start_s: float | None = None
    end_s: float | None = None
    split: Split = field(default_factory=Split)
    compression: Compression = "auto"
    mapping: str = "auto"
    road_map: Path | None = None
    origin: Origin | None = None
    verify: bool = False
    overwrite: bool = False

    def __post_init__(self) -> None:
        if self.start_s is not None and self.end_s is not None and not self.start_s < self.end_s:
            raise UsageError(f"--start {self.start_s:g} --end {self.end_s:g}: nothing lies between them")
        if self.encoding == "ros1" and self.mapping not in ("auto", "none"):
            raise UsageError("a topic mapping needs ROS 2 messages", "leave out --encoding ros1")


@dataclass
class TopicReport:
    """What became of a topic. ``counted``: messages that the recording claims; ``problem``: why some are lost."""

    topic: str
    type: str
    counted: int = 0
    read: int = 0
    written: int = 0
    problem: str = ""
    renamed_to: str = ""


@dataclass
class Comparison:
    """A topic of the output against its source. ``sha256``: over times and payloads, in order."""

    topic: str
    type: str
    compared: str
    """``bytes``, or ``decoded content``: the values of all fields but ROS 1's ``seq``, decoded on both sides."""
    source: int
    output: int
    equal: bool
    sha256: str


@dataclass
class ConversionReport:
    """What a conversion did. ``left_out``: topics that the caller leaves out; ``losses``: what cannot be read."""

    path: str
    paths: list[str] = field(default_factory=list)
    encoding: str = "ros2"
    topics: dict[str, TopicReport] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    losses: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    mapping: str = ""
    derived: dict[str, int] = field(default_factory=dict)
    """Messages that the mapping made, by topic."""
    comparisons: list[Comparison] | None = None
    """None where nothing was verified."""

    @property
    def messages(self) -> int:
        """Messages written, those of the mapping left aside."""
        return sum(topic.written for topic in self.topics.values())

    @property
    def verified(self) -> bool | None:
        """Whether the output equals its source; None where that was not looked at."""
        return None if self.comparisons is None else all(found.equal for found in self.comparisons)

    @property
    def lossless(self) -> bool:
        """Whether everything that was asked for is in the output."""
        problems = any(topic.problem for topic in self.topics.values())
        return not problems and not self.losses and self.verified is not False
