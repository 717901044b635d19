"""Comparing a conversion with its source, message by message: times, order, counts and content.

Copied messages are compared byte for byte. Rewritten ones are decoded on both sides, each by its own definition and
its own code, and their values compared; ``seq`` of ROS 1's Header is left aside, since ROS 2 has none.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from scpf.ingest.bag_plan import Plan, Route
from scpf.ingest.bag_report import Comparison, ConversionReport
from scpf.ingest.decoding import schema_store
from scpf.ingest.mcap_read import McapFile
from scpf.models.errors import InputError

Bytes = bytes | memoryview
Decode = Callable[[Bytes], Sequence[Bytes]]
Key = tuple[str, str]
"""Topic and type in the output."""
BYTES, CONTENT = "bytes", "decoded content"

_SIZE: Final = struct.Struct("<QQ")
_NO_VALUE: Final = ("__msgtype__", "structure_needs_at_least_one_member")
_TIMES: Final = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")


@dataclass
class Sum:
    """The checksum of a topic: in order, and regardless of it."""

    count: int = 0
    ordered: Any = field(default_factory=hashlib.sha256)
    unordered: int = 0

    def add(self, stamp_ns: int, parts: Iterable[Bytes]) -> None:
        """Add a message."""
        one = hashlib.sha256(stamp_ns.to_bytes(8, "little"))
        for part in parts:
            one.update(part)
        digest = one.digest()
        self.count += 1
        self.ordered.update(digest)
        self.unordered = (self.unordered + int.from_bytes(digest, "little")) % (1 << 256)


def content(message: Any) -> list[bytes]:
    """The values of a decoded message, in the order of its fields, whatever they are called."""
    found: list[bytes] = []
    _collect(message, found)
    return found


def _collect(value: Any, found: list[bytes]) -> None:
    if isinstance(value, np.ndarray):
        found.append(_SIZE.pack(len(value), value.nbytes))
        found.append(value.tobytes())
    elif isinstance(value, str):
        data = value.encode(errors="surrogateescape")
        found.append(_SIZE.pack(len(data), 0))
        found.append(data)
    elif isinstance(value, float):
        found.append(struct.pack("<d", value))
    elif isinstance(value, int):
        found.append(b"%d;" % value)
    elif isinstance(value, list | tuple):
        found.append(_SIZE.pack(len(value), 1))
        for item in value:
            _collect(item, found)
    elif is_dataclass(value):
        kind = getattr(value, "__msgtype__", "")
        for entry in fields(value):
            if entry.name in _NO_VALUE or (kind == "std_msgs/msg/Header" and entry.name == "seq"):
                continue
            inner = getattr(value, entry.name)
            if kind in _TIMES:  # ROS 1 counts seconds without a sign
                inner &= 0xFFFFFFFF
            _collect(inner, found)
    else:
        raise TypeError(f"a field of type {type(value).__name__}")


def sums_of_output(paths: list[Path], rewritten: set[Key], wanted: set[Key]) -> dict[Key, Sum]:
    """The checksums of what was written, read again from the files, all their own checks included."""
    sums: dict[Key, Sum] = {}
    for path in paths:
        with McapFile(path) as file:
            decoders: dict[int, Decode] = {}
            for record in file.messages({topic for topic, _ in wanted}):
                channel = record.channel
                key = (channel.topic, channel.schema.name if channel.schema else "")
                if key not in wanted:
                    continue
                if key not in rewritten:
                    sums.setdefault(key, Sum()).add(record.log_time_ns, [record.data])
                    continue
                if channel.id not in decoders:
                    store = schema_store(channel, path)
                    name = key[1]
                    decoders[channel.id] = lambda raw, s=store, n=name: content(s.deserialize_cdr(raw, n))  # type: ignore[misc]
                try:
                    parts = decoders[channel.id](record.data)
                except (
                    Exception
                ):  # generated code; the source's own message, if it decodes, is now one too many
                    continue
                sums.setdefault(key, Sum()).add(record.log_time_ns, parts)
    return sums


def compare(source: dict[Key, Sum], output: dict[Key, Sum], rewritten: set[Key]) -> list[Comparison]:
    """The comparison, topic by topic."""
    found = []
    for key in sorted(source.keys() | output.keys()):
        mine, theirs = source.get(key, Sum()), output.get(key, Sum())
        compared = CONTENT if key in rewritten else BYTES
        same = mine.ordered.digest() == theirs.ordered.digest()
        if not same and mine.count == theirs.count and mine.unordered == theirs.unordered:
            compared, same = f"{compared}, regardless of order", True
        digest = theirs.ordered.hexdigest()
        found.append(Comparison(*key, compared, mine.count, theirs.count, same, digest))
    return found


def verify(plan: Plan, paths: list[Path], report: ConversionReport) -> None:
    """Compare what was written with the recordings, both read again."""
    rewritten = {route.key for route in plan.routes.values() if route.passage.source_store is not None}
    decoders: dict[Route, Decode] = {}
    failed: dict[str, tuple[int, str]] = {}
    sums: dict[Key, Sum] = {route.key: Sum() for route in plan.routes.values()}
    for route, message in plan.messages():
        try:
            if route not in decoders:
                decoders[route] = _decoder(route, route.key in rewritten)
            if route.report.problem and route.passage.convert is not None:
                route.passage.convert(message.data)  # a message that was left out is said already
            parts = decoders[route](message.data)
        except Exception as error:  # generated code: which exception wrong bytes become depends on the type
            if not route.report.problem:
                count, reason = failed.get(route.report.topic, (0, str(error) or type(error).__name__))
                failed[route.report.topic] = (count + 1, reason)
            continue
        sums[route.key].add(message.log_time_ns, parts)
    report.losses += [
        f"{topic}: {n} messages cannot be compared ({why})" for topic, (n, why) in failed.items()
    ]
    report.comparisons = compare(sums, sums_of_output(paths, rewritten, set(sums)), rewritten)


def _decoder(route: Route, decoded: bool) -> Decode:
    """What is compared of a source's message: its bytes, or its values where the topic was rewritten."""
    way = route.passage
    if not decoded:
        return lambda raw: [raw]
    if way.source_store is not None:
        ros1 = way.source_store()
        return lambda raw: content(ros1.deserialize_ros1(raw, way.type))
    store = way.store
    if store is None:
        raise InputError("nothing decodes its messages")
    return lambda raw: content(store.deserialize_cdr(raw, way.type))
