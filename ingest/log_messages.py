"""What a drive log hands out: a channel's summary, a message, an encoded image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from scpf.ingest.decoding import Decoder
from scpf.ingest.mcap_read import RawMessage
from scpf.ingest.messages import from_time


@dataclass(frozen=True)
class ChannelInfo:
    """What a log holds of one topic. ``encoding`` is that of the messages: cdr, json, ros1, …"""

    type: str
    encoding: str
    count: int


class Message:
    """One message. ``stamp_ns``: log time; ``raw``: the stored bytes; ``message``: decoded when asked for."""

    __slots__ = (
        "_channel",
        "_decoded",
        "_decoder",
        "publish_time_ns",
        "raw",
        "sequence",
        "stamp_ns",
        "topic",
    )

    def __init__(self, record: RawMessage, decoder: Decoder) -> None:
        self.topic = record.channel.topic
        self.stamp_ns = record.log_time_ns
        self.publish_time_ns = record.publish_time_ns
        self.sequence = record.sequence
        self.raw = record.data
        self._channel = record.channel
        self._decoder = decoder
        self._decoded: Any = None

    @property
    def encoding(self) -> str:
        """How the message is encoded; empty for CDR of a type that the file does not define."""
        schema = self._channel.schema
        return self._channel.encoding if schema is None or schema.encoding else ""

    @property
    def message(self) -> Any:
        """The message as a rosbags dataclass; its arrays are views of ``raw``. Raises as Decoder does."""
        if self._decoded is None:
            place = f"{self.topic} at {self.stamp_ns} ns"
            self._decoded = self._decoder.decode(self._channel, self.raw, place)
        return self._decoded

    @property
    def sensor_ns(self) -> int:
        """The header's stamp; the log time where there is no such header, or nobody filled it in."""
        stamp = getattr(getattr(self.message, "header", None), "stamp", None)
        if not (
            isinstance(getattr(stamp, "sec", None), int) and isinstance(getattr(stamp, "nanosec", None), int)
        ):
            return self.stamp_ns
        return from_time(stamp) or self.stamp_ns


class EncodedImage(NamedTuple):
    """An image as stored: ``format`` as the message states it (``jpeg``, ``png``, …)."""

    stamp_ns: int
    data: memoryview
    format: str
