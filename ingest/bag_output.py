"""The output of a conversion: one MCAP file, or several parts of a size or a duration."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final, Literal

from scpf.ingest.mcap_write import McapWriter
from scpf.ingest.topics import IMAGE_TYPES
from scpf.models.errors import InputError, UsageError

Compression = Literal["auto", "zstd", "none"]
MAX_PARTS: Final = 10_000
"""More parts than this are a mistake in the units."""


@dataclass(frozen=True)
class Split:
    """Where to begin another part: after this many bytes, or seconds; neither: one file."""

    size_bytes: int | None = None
    duration_s: float | None = None

    def __post_init__(self) -> None:
        if self.size_bytes is not None and self.size_bytes < 1 << 16:
            raise UsageError(f"parts of {self.size_bytes} bytes", "the smallest part is 64 kB, such as 64KB")
        if self.duration_s is not None and not self.duration_s > 0:
            raise UsageError(f"parts of {self.duration_s} s", "a duration is positive")

    def __bool__(self) -> bool:
        return self.size_bytes is not None or self.duration_s is not None


@dataclass(frozen=True, eq=False)
class OutChannel:
    """A channel of the output, whichever part it is written to; told apart by identity."""

    topic: str
    type: str
    definition: bytes
    encoding: str = "cdr"
    schema_encoding: str = "ros2msg"
    metadata: tuple[tuple[str, str], ...] = ()

    @property
    def stream(self) -> str:
        """Images get chunks of their own."""
        package, _, name = self.type.rpartition("/")
        full = self.type if "/msg/" in self.type else f"{package}/msg/{name}"
        return "image" if full in IMAGE_TYPES else "small"


class _Writer(McapWriter):
    """The writer of drive logs, with a choice of compression."""

    def __init__(self, output: BinaryIO, profile: str, compression: Compression) -> None:
        from importlib.metadata import version

        super().__init__(output, f"scpf {version('scpf')}", profile)
        if compression != "auto":
            for stream in self._streams.values():
                stream.compression = "zstd" if compression == "zstd" else ""

    @property
    def written_bytes(self) -> int:
        """Bytes in the file, and those that wait for their chunk to end."""
        return self._position + sum(stream.size for stream in self._streams.values())


@dataclass
class _Part:
    path: Path
    file: BinaryIO
    writer: _Writer
    start_ns: int | None = None
    ids: dict[OutChannel, int] = field(default_factory=dict)

    @property
    def partial(self) -> Path:
        return self.path.with_name(self.path.name + ".partial")


class BagOutput:
    """Writes the output. A context manager: each ``NAME.partial`` becomes ``NAME`` when the block ends well.

    After an error the ``.partial`` files stay, closed as well as they can be. Raises InputError for an output
    that exists, unless ``overwrite``.
    """

    def __init__(
        self, path: Path, *, profile: str, compression: Compression, split: Split, overwrite: bool
    ) -> None:
        self._path, self._profile, self._compression = path, profile, compression
        self._split, self._overwrite = split, overwrite
        self._splits, self._ending = bool(split), False
        self._done: list[_Part] = []
        self._part: _Part | None = None
        self._channels: list[OutChannel] = []
        self._sequences: dict[OutChannel, int] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        """Written to each part as it ends."""
        self.attachments: list[tuple[str, str, bytes]] = []
        """Name, media type and content; written to each part as it ends."""
        self.before_end: Callable[[], None] = lambda: None
        """Called when a part is full, before another begins."""

    def __enter__(self) -> BagOutput:
        self._begin()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            with contextlib.suppress(Exception):  # the error on its way says more than a second one
                self._end()
            return
        self._end()
        for part in self._done:
            part.partial.replace(part.path)

    @property
    def paths(self) -> list[Path]:
        """The files, in order of time."""
        return [part.path for part in [*self._done, *([self._part] if self._part else [])]]

    def stale_parts(self) -> list[str]:
        """Files that look like further parts of this output, and are those of an earlier run."""
        if not self._split:
            return []
        shape = re.compile(re.escape(self._path.stem) + r"_[0-9]{3,}" + re.escape(self._path.suffix))
        own = {path.name for path in self.paths}
        folder = self._path.parent
        return sorted(p.name for p in folder.iterdir() if shape.fullmatch(p.name) and p.name not in own)

    def add_channel(self, channel: OutChannel) -> OutChannel:
        """Make a channel known, so that it is in the output even if it stays empty."""
        self._channels.append(channel)
        if self._part is not None:
            self._register(self._part, channel)
        return channel

    def write(
        self,
        channel: OutChannel,
        log_time_ns: int,
        data: bytes | memoryview,
        publish_time_ns: int | None = None,
        sequence: int | None = None,
    ) -> None:
        """Write a message; without a sequence number it gets the next one of its channel."""
        part = self._part
        assert part is not None
        if self._splits and not self._ending and part.start_ns is not None and self._full(part, log_time_ns):
            self._ending = True
            self.before_end()  # may write what belongs to this part
            self._ending = False
            self._end()
            part = self._begin()
        if part.start_ns is None:
            part.start_ns = log_time_ns
        if sequence is None:
            sequence = self._sequences.get(channel, 0)
            self._sequences[channel] = sequence + 1
        number = part.ids.get(channel) or self._register(part, channel)
        published = log_time_ns if publish_time_ns is None else publish_time_ns
        part.writer.add_message(number, log_time_ns, data, published, sequence)

    def _full(self, part: _Part, log_time_ns: int) -> bool:
        size, duration_s = self._split.size_bytes, self._split.duration_s
        if size is not None and part.writer.written_bytes >= size:
            return True
        assert part.start_ns is not None
        return duration_s is not None and log_time_ns - part.start_ns >= duration_s * 1e9

    def _begin(self) -> _Part:
        path = self._path
        if self._split:
            if len(self._done) >= MAX_PARTS:
                raise UsageError(f"more than {MAX_PARTS} parts", "give a larger size or duration")
            path = path.with_name(f"{path.stem}_{len(self._done):03d}{path.suffix}")
        if path.exists() and not self._overwrite:
            raise InputError(f"{path} exists", "choose another name, or give --overwrite")
        partial = path.with_name(path.name + ".partial")
        try:
            file = partial.open("wb")
        except OSError as error:
            hint = "does its folder exist, and may you write there?"
            raise InputError(f"{partial} cannot be written ({error.strerror})", hint) from error
        self._part = _Part(path, file, _Writer(file, self._profile, self._compression))
        if not self._done:
            for channel in self._channels:
                self._register(self._part, channel)
        return self._part

    def _register(self, part: _Part, channel: OutChannel) -> int:
        number = part.writer.add_channel(
            channel.topic,
            channel.type,
            channel.definition,
            stream=channel.stream,
            message_encoding=channel.encoding,
            schema_encoding=channel.schema_encoding,
            metadata=dict(channel.metadata),
        )
        part.ids[channel] = number
        return number

    def _end(self) -> None:
        part, self._part = self._part, None
        if part is None:
            return
        with part.file:
            for name, values in self.metadata.items():
                part.writer.add_metadata(name, values)
            for attachment in self.attachments:
                part.writer.add_attachment(*attachment)
            part.writer.finish()
            os.fsync(part.file.fileno())
        self._done.append(part)

    def describe(self, name: str, values: Mapping[str, str]) -> None:
        """Metadata for every part that has not ended yet."""
        self.metadata[name] = dict(values)
