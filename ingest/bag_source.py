"""What a recording is to the conversion, whatever its format: channels, and messages in order."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol


@dataclass(frozen=True)
class BagChannel:
    """A topic of a recording: ``type`` as package/msg/Name, ``encoding`` ros1, cdr or what the file says."""

    topic: str
    type: str
    encoding: str
    definition_format: str
    """``ros2msg`` (also for ROS 1), ``ros2idl``, or empty: the recording does not define its types."""
    definition: bytes
    """As the recording has it."""
    md5: str
    qos: str
    count: int
    native_type: str = ""
    """ROS 1 only: the type as the bag names it, package/Name."""
    caller: str = ""
    """ROS 1 only: the node that published."""
    latching: bool = False
    metadata: tuple[tuple[str, str], ...] = ()
    """Further notes of an MCAP channel."""


class BagMessage(NamedTuple):
    """A message: the number of its channel in the source, times (ns), ``sequence`` where the recording has one."""

    channel: int
    log_time_ns: int
    publish_time_ns: int
    sequence: int | None
    data: bytes | memoryview


class BagSource(Protocol):
    """An open recording. ``start_ns``: the first message's log time, None without messages.

    ``losses``: what of it cannot be read; complete only after its messages were read.
    """

    channels: list[BagChannel]
    start_ns: int | None
    losses: list[str]

    def messages(
        self, wanted: Collection[int], start_ns: int | None, end_ns: int | None
    ) -> Iterator[BagMessage]:
        """The messages of the wanted channels, start ≤ log time < end, by log time, else as recorded."""
        ...
