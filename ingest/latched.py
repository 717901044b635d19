"""Latched state: what a listener that joins late is still told, such as calibrations and static transforms."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final

from scpf.ingest.log_messages import Message
from scpf.ingest.mcap_index import Channel
from scpf.ingest.topics import CAMERA_INFO_TOPIC, TF_STATIC_TOPIC
from scpf.models.errors import ScpfError

_ALWAYS: Final = frozenset({TF_STATIC_TOPIC, CAMERA_INFO_TOPIC})
_DURABLE: Final = re.compile(r"durability:\s*(1\b|transient_local)")
"""How rosbag2 writes it, the old way and the new."""


def is_latched(channel: Channel) -> bool:
    """Whether late listeners get the last message of a channel, by its quality of service or its name."""
    return channel.topic in _ALWAYS or bool(_DURABLE.search(channel.metadata.get("offered_qos_profiles", "")))


def latest(records: Iterable[Message]) -> list[Message]:
    """Of messages in order of time, those that still hold: the last of each topic, and of ``/tf_static`` the last
    that speaks of each frame, since several publishers may share it. In order of time."""
    held: dict[tuple[str, str], tuple[int, Message]] = {}
    for number, record in enumerate(records):
        for part in _parts(record):
            held[record.topic, part] = (number, record)
    return [record for _, record in sorted(dict(held.values()).items())]


def _parts(record: Message) -> list[str]:
    if record.topic != TF_STATIC_TOPIC:
        return [""]
    try:
        return [str(item.child_frame_id) for item in record.message.transforms]
    except (ScpfError, AttributeError):  # whoever decodes it is told
        return [f"at {record.stamp_ns}"]
