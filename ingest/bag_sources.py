"""Opening recordings: ROS 1 bags, rosbag2 folders, .db3 and MCAP files, all with the same few methods."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Final

from scpf.ingest.bag_source import BagChannel, BagMessage, BagSource
from scpf.ingest.mcap_files import read_attachment, read_metadata
from scpf.ingest.mcap_read import McapFile
from scpf.ingest.ros1_bag import COPIED_BYTES, Ros1Bag
from scpf.ingest.rosbag2_db3 import Db3
from scpf.ingest.rosbag2_zstd import Unpacked, compression_of, unpack_file
from scpf.ingest.topics import LATCHED_QOS
from scpf.models.errors import InputError

_ENDINGS: Final = (".bag", ".mcap", ".db3", ".active", ".zstd")
_KNOWN: Final = "known: ROS 1 .bag and .bag.active, rosbag2 folders, .db3 and .mcap files"
_FORMATS: Final = {"ros2msg": "ros2msg", "ros1msg": "ros2msg", "ros2idl": "ros2idl"}


def open_sources(path: Path, stack: ExitStack) -> list[tuple[str, BagSource]]:
    """The recordings of a file or a folder, with their names; ``stack`` closes them.

    Raises InputError, or DamagedError.
    """
    if not path.exists():
        raise InputError(f"{path} does not exist")
    if path.is_file():
        if path.suffix not in _ENDINGS:
            raise InputError(f"{path} is not a recording of a known kind", _KNOWN)
        return [(path.name, _open_file(path, stack))]
    # The files of a rosbag2 folder are read without its metadata.yaml, which knows less than they do. Only
    # compression needs it.
    by_message = compression_of(path) == "message"
    files = sorted((file for file in path.iterdir() if file.suffix in _ENDINGS), key=_natural)
    packed = {file.with_suffix("") for file in files if file.suffix == ".zstd"}
    files = [file for file in files if file.suffix == ".zstd" or file not in packed]
    if not files:
        raise InputError(f"{path} holds no recording", _KNOWN)
    sources = [(file.name, _open_file(file, stack)) for file in files]
    return [(name, Unpacked(source)) for name, source in sources] if by_message else sources


def _open_file(path: Path, stack: ExitStack) -> BagSource:
    if path.suffix == ".zstd":
        path = unpack_file(path, stack)
    if path.suffix == ".mcap":
        return Mcap(path, stack)
    return Db3(path, stack) if path.suffix == ".db3" else Ros1Bag(path, stack)


def _natural(path: Path) -> list[tuple[int, str]]:
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"([0-9]+)", path.name)]


class _Recording(McapFile):
    """An MCAP file of which no chunk stays in memory once it has been read."""

    def drop_cache(self) -> None:
        """Forget the chunks that were read last."""
        self._cache.clear()


class Mcap:
    """An MCAP file, through our own reader, which keeps publish times and sequence numbers."""

    def __init__(self, path: Path, stack: ExitStack) -> None:
        self._file = _Recording(path)
        stack.enter_context(self._file)
        self.losses: list[str] = []
        index = self._file.index
        self._numbers: dict[int, int] = {}
        self.channels: list[BagChannel] = []
        counts = self._file.counts()
        for channel in index.channels.values():
            schema = channel.schema
            ros1 = channel.encoding == "ros1"
            latching = channel.metadata.get("latching", "").lower() in ("1", "true")
            self._numbers[channel.id] = len(self.channels)
            self.channels.append(
                BagChannel(
                    channel.topic,
                    _full_name(schema.name) if schema else "",
                    channel.encoding or "unnamed",
                    _FORMATS.get(schema.encoding, schema.encoding) if schema else "",
                    schema.data if schema else b"",
                    channel.metadata.get("md5sum", "") if ros1 else "",
                    channel.metadata.get("offered_qos_profiles", "")
                    or (LATCHED_QOS if latching and ros1 else ""),
                    counts.get(channel.id, 0),
                    schema.name if schema and ros1 else "",
                    channel.metadata.get("callerid", ""),
                    latching,
                    () if ros1 else tuple(channel.metadata.items()),
                )
            )
        self.start_ns = index.span_ns[0] if index.span_ns is not None else None

    def messages(
        self, wanted: Collection[int], start_ns: int | None, end_ns: int | None
    ) -> Iterator[BagMessage]:
        """See BagSource."""
        topics = {self.channels[number].topic for number in wanted}
        try:
            for record in self._file.messages(topics, start_ns, end_ns):
                number = self._numbers[record.channel.id]
                if number in wanted:
                    # As in Ros1Bag: a view of a small message would keep its whole chunk in memory.
                    data = bytes(record.data) if len(record.data) < COPIED_BYTES else record.data
                    yield BagMessage(
                        number, record.log_time_ns, record.publish_time_ns, record.sequence, data
                    )
        finally:
            # A folder may hold hundreds of files, all open: one that has been read must not keep its chunks.
            self._file.drop_cache()

    def attachments(self) -> Iterator[tuple[str, str, bytes]]:
        """Name, media type and content of each attachment. DamagedError for one that fails a check."""
        for entry in self._file.index.attachments:
            yield entry.name, entry.media_type, read_attachment(self._file, entry)

    def metadata(self) -> Iterator[tuple[str, dict[str, str]]]:
        """The metadata records."""
        for place in self._file.index.metadata:
            yield read_metadata(self._file, *place)


def _full_name(name: str) -> str:
    """package/msg/Name, also of a ROS 1 name package/Name."""
    parts = name.split("/")
    return f"{parts[0]}/msg/{parts[1]}" if len(parts) == 2 else name
