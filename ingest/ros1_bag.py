"""A ROS 1 bag as a source of messages: by log time, as recorded where times are equal, in bounded memory."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Final

from scpf.ingest.bag_source import BagChannel, BagMessage
from scpf.ingest.ros1_chunks import MAX_CHUNK_BYTES, Connection, Records, read_records, unpack_chunk
from scpf.ingest.ros1_index import Chunk, walk
from scpf.ingest.topics import LATCHED_QOS
from scpf.models.errors import DamagedError

HELD_BYTES: Final = 96 << 20
HELD_CHUNKS: Final = 256
"""Unpacked chunks whose times overlap are held up to these; beyond them, order gives way to memory and time.
Readers of MCAP sort by log time in any case."""
MAX_LOSSES: Final = 200
COPIED_BYTES: Final = 1 << 16
"""A message smaller than this is copied out of its chunk: a view would keep the whole chunk in memory."""

_Held = tuple[int, int, int, int, int]
"""Log time (ns), chunk (in order), first and last byte, connection: sorts as recorded where times are equal."""


class Ros1Bag:
    """A ROS 1 bag, opened for reading; ``stack`` closes it. Raises DamagedError for a file that is none."""

    def __init__(self, path: Path, stack: ExitStack) -> None:
        try:
            self._file = stack.enter_context(path.open("rb"))
        except OSError as error:
            raise DamagedError(f"{path}: cannot be opened ({error.strerror})") from error
        self._path = path
        index = walk(self._file, path)
        self.losses = index.losses
        self.notes: list[str] = []
        self._said: set[str] = set(self.losses)
        connections = index.connections
        for chunk in index.chunks:
            # Connections stand at the end of a bag; without an end, in the chunk where they come first.
            if not chunk.indexed or not chunk.counts.keys() <= connections.keys():
                self._survey(chunk, connections)
        self._chunks = sorted(
            (chunk for chunk in index.chunks if chunk.end_ns >= 0), key=lambda c: (c.start_ns, c.position)
        )
        counts: dict[int, int] = {}
        for chunk in self._chunks:
            for key, count in chunk.counts.items():
                counts[key] = counts.get(key, 0) + count
        unknown = sum(count for key, count in counts.items() if key not in connections)
        if unknown:
            self._lose(f"{unknown} messages of connections that the bag does not describe")
        self._numbers = {key: k for k, key in enumerate(connections)}
        self.channels = [
            _channel(connection, max(counts.get(key, 0), index.claimed.get(key, 0)))
            for key, connection in connections.items()
        ]
        self.start_ns = self._chunks[0].start_ns if self._chunks else None

    def messages(
        self, wanted: Collection[int], start_ns: int | None, end_ns: int | None
    ) -> Iterator[BagMessage]:
        """See BagSource."""
        low = -1 if start_ns is None else start_ns
        high = 1 << 64 if end_ns is None else end_ns
        keys = {key: number for key, number in self._numbers.items() if number in wanted}
        chunks = [
            c
            for c in self._chunks
            if c.end_ns >= low and c.start_ns < high and not keys.keys().isdisjoint(c.counts)
        ]
        held: list[_Held] = []
        loaded: dict[int, memoryview] = {}
        for k, chunk in enumerate(chunks):
            data, records = self._read(chunk)
            loaded[k] = data
            held += [
                (stamp, k, start, stop, key)
                for stamp, start, stop, key in records.messages
                if key in keys and low <= stamp < high
            ]
            held.sort()
            ready = len(held)
            few = len(loaded) <= HELD_CHUNKS and sum(map(len, loaded.values())) <= HELD_BYTES
            if k + 1 < len(chunks) and few:
                following = (chunks[k + 1].start_ns, k + 1)
                while ready and held[ready - 1] > following:
                    ready -= 1
            for stamp, owner, start, stop, key in held[:ready]:
                view = loaded[owner][start:stop]
                small = bytes(view) if stop - start < COPIED_BYTES else view
                yield BagMessage(keys[key], stamp, stamp, None, small)
            del held[:ready]
            still = {item[1] for item in held}
            loaded = {owner: data for owner, data in loaded.items() if owner in still}

    def _survey(self, chunk: Chunk, connections: dict[int, Connection]) -> None:
        """What a chunk holds, by unpacking it."""
        _, records = self._read(chunk, compare=False)
        for key, connection in records.connections.items():
            connections.setdefault(key, connection)
        counts: dict[int, int] = {}
        for _, _, _, key in records.messages:
            counts[key] = counts.get(key, 0) + 1
        if chunk.indexed and counts != chunk.counts:
            self._lose(f"byte {chunk.position}: the index of this chunk contradicts it")
        chunk.counts = counts
        times = [place[0] for place in records.messages]
        chunk.start_ns, chunk.end_ns = (min(times), max(times)) if times else (0, -1)

    def _read(self, chunk: Chunk, compare: bool = True) -> tuple[memoryview, Records]:
        """The unpacked chunk and its records; what is wrong with it is said once."""
        if chunk.stored > MAX_CHUNK_BYTES:
            self._lose(
                f"byte {chunk.position}: a chunk of {chunk.stored} bytes, more than 512 MiB, is left out"
            )
            return memoryview(b""), Records()
        self._file.seek(chunk.data)
        stored = self._file.read(chunk.stored)
        data, problem = unpack_chunk(chunk.compression, memoryview(stored), chunk.size)
        records = read_records(data)
        problem = records.problem if chunk.open else problem or records.problem
        if problem:
            self._lose(
                f"byte {chunk.position}: {problem}; {len(records.messages)} messages of this chunk are read"
            )
        if compare and len(records.messages) != sum(chunk.counts.values()):
            text = f"this chunk holds {len(records.messages)} messages, its index has {sum(chunk.counts.values())}"
            self._lose(f"byte {chunk.position}: {text}")
        return data, records

    def _lose(self, text: str) -> None:
        if text in self._said:
            return
        self._said.add(text)
        if len(self._said) <= MAX_LOSSES:
            self.losses.append(text)
        else:
            self.losses[MAX_LOSSES:] = [f"{len(self._said) - MAX_LOSSES} more losses in this bag"]


def _channel(connection: Connection, count: int) -> BagChannel:
    package, _, name = connection.type.partition("/")
    return BagChannel(
        connection.topic,
        f"{package}/msg/{name}" if name and "/" not in name else connection.type,
        "ros1",
        "ros2msg",
        connection.definition,
        connection.md5,
        LATCHED_QOS if connection.latching else "",
        count,
        connection.type,
        connection.caller,
        connection.latching,
    )
