"""What bags are read from: ROS 1 bags, rosbag2 recordings, MCAP files, all with the same few methods."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol

from scpf.ingest.mcap_read import McapFile
from scpf.ingest.ros1_chunks import bound_chunks
from scpf.ingest.topics import LATCHED_QOS
from scpf.models.errors import DamagedError, InputError

_ENDINGS: Final = (".bag", ".mcap", ".db3")
_KNOWN: Final = "known: ROS 1 .bag, rosbag2 folders, .db3 and .mcap files"


@dataclass(frozen=True)
class BagChannel:
    """A topic of a recording: ``type`` as package/msg/Name, ``encoding`` ros1, cdr or what the file says."""

    topic: str
    type: str
    encoding: str
    definition_format: str
    """``ros2msg`` (also for ROS 1), ``ros2idl``, or empty: the recording does not define its types."""
    definition: str
    md5: str
    qos: str
    count: int


class BagMessage(NamedTuple):
    """A message: the number of its channel in the source, times (ns), ``sequence`` where the recording has one."""

    channel: int
    log_time_ns: int
    publish_time_ns: int
    sequence: int | None
    data: bytes | memoryview


class BagSource(Protocol):
    """An open recording. ``start_ns``: the first message's log time, None without messages."""

    channels: list[BagChannel]
    start_ns: int | None

    def messages(
        self, wanted: Collection[int], start_ns: int | None, end_ns: int | None
    ) -> Iterator[BagMessage]:
        """The messages of the wanted channels, start ≤ log time < end, by log time, else as recorded."""
        ...


def open_sources(path: Path, stack: ExitStack) -> list[BagSource]:
    """The recordings of a file or a folder, closed by ``stack``. Raises InputError, or DamagedError."""
    if not path.exists():
        raise InputError(f"{path} does not exist")
    if path.is_file():
        if path.suffix not in _ENDINGS:
            raise InputError(f"{path} is not a recording of a known kind", _KNOWN)
        return [_open_file(path, stack)]
    # The files of a rosbag2 folder are read without its metadata.yaml, which knows less than they do, and where
    # the two disagree rosbags yields nothing. Only compression needs it.
    metadata = path / "metadata.yaml"
    if metadata.exists() and re.search(
        r"^\s*compression_mode:\s*[\"']?(file|message)", _head(metadata), re.M | re.I
    ):
        return [_Rosbags(path, stack, 2)]
    files = sorted((file for file in path.iterdir() if file.suffix in _ENDINGS), key=_natural)
    if not files:
        raise InputError(f"{path} holds no recording", _KNOWN)
    return [_open_file(file, stack) for file in files]


def _open_file(path: Path, stack: ExitStack) -> BagSource:
    if path.suffix == ".mcap":
        return _Mcap(path, stack)
    return _Rosbags(path, stack, 1 if path.suffix == ".bag" else 2)


def _head(path: Path) -> str:
    with path.open(encoding="utf-8", errors="replace") as file:
        return file.read(16 << 20)


def _natural(path: Path) -> list[tuple[int, str]]:
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", path.name)]


class _Mcap:
    """An MCAP file, through our own reader, which keeps publish times and sequence numbers."""

    def __init__(self, path: Path, stack: ExitStack) -> None:
        self._file = stack.enter_context(McapFile(path))
        index = self._file.index
        self._numbers: dict[int, int] = {}
        self.channels: list[BagChannel] = []
        counts = self._file.counts()
        for channel in index.channels.values():
            schema = channel.schema
            encoding = {"ros2msg": "ros2msg", "ros1msg": "ros2msg", "ros2idl": "ros2idl"}
            self._numbers[channel.id] = len(self.channels)
            self.channels.append(
                BagChannel(
                    channel.topic,
                    _full_name(schema.name) if schema else "",
                    channel.encoding or "unnamed",
                    encoding.get(schema.encoding, schema.encoding) if schema else "",
                    schema.data.decode(errors="replace") if schema else "",
                    channel.metadata.get("md5sum", ""),
                    channel.metadata.get("offered_qos_profiles", ""),
                    counts.get(channel.id, 0),
                )
            )
        self.start_ns = index.span_ns[0] if index.span_ns is not None else None

    def messages(
        self, wanted: Collection[int], start_ns: int | None, end_ns: int | None
    ) -> Iterator[BagMessage]:
        """See BagSource."""
        topics = {self.channels[number].topic for number in wanted}
        for record in self._file.messages(topics, start_ns, end_ns):
            number = self._numbers[record.channel.id]
            if number in wanted:
                yield BagMessage(
                    number, record.log_time_ns, record.publish_time_ns, record.sequence, record.data
                )


class _Rosbags:
    """A ROS 1 bag, or a rosbag2 SQLite recording, through rosbags."""

    def __init__(self, path: Path, stack: ExitStack, version: int) -> None:
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2

        self._path = path
        self._ros1 = version == 1
        try:
            self._reader: Any = Reader1(path) if version == 1 else Reader2(path)
            stack.enter_context(self._reader)
        except Exception as error:  # rosbags raises what its parsers raise: KeyError, sqlite errors, …
            raise self._damaged(error) from error
        if self._ros1:
            bound_chunks(self._reader)
        self._connections = list(self._reader.connections)
        self.channels = [self._describe(connection) for connection in self._connections]
        self.start_ns = int(self._reader.start_time) if self._reader.message_count else None

    def messages(
        self, wanted: Collection[int], start_ns: int | None, end_ns: int | None
    ) -> Iterator[BagMessage]:
        """See BagSource."""
        chosen = [self._connections[number] for number in sorted(wanted)]
        numbers = {(c.id, c.topic): k for k, c in enumerate(self._connections)}
        if not chosen:
            return
        records = self._reader.messages(chosen, start_ns, end_ns)
        while True:
            try:
                connection, time_ns, data = next(records)
            except StopIteration:
                return
            except Exception as error:
                raise self._damaged(error) from error
            # Neither format keeps the time of publishing.
            yield BagMessage(numbers[connection.id, connection.topic], time_ns, time_ns, None, data)

    def _describe(self, connection: Any) -> BagChannel:
        from rosbags.interfaces import MessageDefinitionFormat as Format
        from rosbags.rosbag2.metadata import dump_qos_v8

        formats = {Format.MSG: "ros2msg", Format.IDL: "ros2idl", Format.NONE: ""}
        if self._ros1:
            encoding, qos = "ros1", LATCHED_QOS if connection.ext.latching else ""
        else:
            encoding = connection.ext.serialization_format
            profiles = connection.ext.offered_qos_profiles
            qos = dump_qos_v8(profiles) if profiles else ""
        definition = connection.msgdef
        return BagChannel(
            connection.topic,
            connection.msgtype,
            encoding,
            formats[definition.format],
            definition.data,
            connection.digest if self._ros1 else "",
            qos,
            connection.msgcount,
        )

    def _damaged(self, error: Exception) -> DamagedError:
        reason = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        return DamagedError(f"{self._path}: {reason}", "the readable part may be saved with `scpf recover`")


def _full_name(name: str) -> str:
    """package/msg/Name, also of a ROS 1 name package/Name."""
    parts = name.split("/")
    return f"{parts[0]}/msg/{parts[1]}" if len(parts) == 2 else name
