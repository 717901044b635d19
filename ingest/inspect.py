"""What a log holds: topics, counts, rates and gaps, attachments, metadata."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from scpf.ingest.drive_log import FRAME_METADATA, MAP_ATTACHMENT, DriveLog, Message
from scpf.models.errors import ScpfError


@dataclass
class TopicInfo:
    """A topic by its log times (ns). Rate and gap are 0 for fewer than two messages, times None for none."""

    topic: str
    type: str
    encoding: str
    count: int
    size_bytes: int = 0
    first_ns: int | None = None
    last_ns: int | None = None
    rate_hz: float = 0.0
    largest_gap_s: float = 0.0
    largest_gap_at_ns: int | None = None


@dataclass
class LogInfo:
    """What a log holds. ``findings``: everything that was found wrong, each in one line."""

    path: str
    size_bytes: int
    profile: str
    library: str
    start_ns: int
    end_ns: int
    messages: int
    topics: list[TopicInfo] = field(default_factory=list)
    attachments: dict[str, int] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    landmarks: int | None = None
    camera: str = ""
    origin: tuple[float, float, float] | None = None
    findings: list[str] = field(default_factory=list)

    @property
    def duration_s(self) -> float:
        """From the first to the last message."""
        return (self.end_ns - self.start_ns) * 1e-9


def inspect(path: Path, progress: Callable[[int, int], None] | None = None) -> LogInfo:
    """Read a whole log, checking every chunk, attachment and record that a replay needs.

    Damage inside the log becomes a finding, so that one bad chunk does not hide the rest. Raises DamagedError
    for a file that has no index, or is no MCAP file.
    """
    with DriveLog(path) as log:
        info = LogInfo(
            str(path), path.stat().st_size, log.profile, log.library, log.start_ns, log.end_ns,
            sum(channel.count for channel in log.channels.values()),
        )  # fmt: skip
        _messages(log, info, progress)
        for what in (_attachments, _metadata, _map, _camera, _trajectory):
            try:
                what(log, info)
            except ScpfError as error:
                if error.message not in info.findings:
                    info.findings.append(error.message)
    return info


def _messages(log: DriveLog, info: LogInfo, progress: Callable[[int, int], None] | None) -> None:
    done = 0
    for topic, channel in sorted(log.channels.items()):
        stamps: list[int] = []
        size = 0
        try:
            for record in log.messages([topic]):
                if not stamps:
                    _decodes(record, info)
                stamps.append(record.stamp_ns)
                size += len(record.raw)
                done += 1
                if progress is not None:
                    progress(done, info.messages)
        except ScpfError as error:
            info.findings.append(f"{topic}: {error.message}")
        row = TopicInfo(topic, channel.type, channel.encoding, len(stamps), size)
        if len(stamps) != channel.count:
            info.findings.append(
                f"{topic}: the index counts {channel.count} messages, {len(stamps)} can be read"
            )
        if stamps:
            row.first_ns, row.last_ns = stamps[0], stamps[-1]
        if len(stamps) > 1 and stamps[-1] > stamps[0]:
            gaps = np.diff(np.array(stamps, dtype=np.uint64).astype(np.int64))
            widest = int(np.argmax(gaps))
            row.rate_hz = (len(stamps) - 1) / ((stamps[-1] - stamps[0]) * 1e-9)
            row.largest_gap_s = float(gaps[widest]) * 1e-9
            row.largest_gap_at_ns = stamps[widest]
        info.topics.append(row)


def _decodes(record: Message, info: LogInfo) -> None:
    """Whether the first message of a topic is what its schema says; other encodings than CDR are not ours to judge."""
    if record.encoding == "cdr":
        try:
            _ = record.message
        except ScpfError as error:
            info.findings.append(error.message)


def _attachments(log: DriveLog, info: LogInfo) -> None:
    info.attachments = {name: len(data) for name, data in log.attachments().items()}


def _metadata(log: DriveLog, info: LogInfo) -> None:
    info.metadata = log.metadata()
    origin = log.origin() if FRAME_METADATA in info.metadata or MAP_ATTACHMENT in info.attachments else None
    info.origin = (origin[0], origin[1], origin[2]) if origin is not None else None


def _map(log: DriveLog, info: LogInfo) -> None:
    road_map = log.road_map()
    info.landmarks = len(road_map.landmarks) if road_map is not None else None


def _camera(log: DriveLog, info: LogInfo) -> None:
    camera = log.camera()
    if camera is not None:
        focal = f"{camera.matrix[0, 0]:.1f}, {camera.matrix[1, 1]:.1f}"
        info.camera = f"{camera.width_px}×{camera.height_px} px, focal {focal} px, {camera.distortion_model}"


def _trajectory(log: DriveLog, info: LogInfo) -> None:
    log.trajectory()
