"""What the records of a damaged MCAP file say, taken over into a new file, and the account of what is missing."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from scpf.ingest.mcap_index import Channel, Cursor, Schema
from scpf.ingest.mcap_read import LATEST_NS
from scpf.ingest.mcap_scan import Record, Region
from scpf.ingest.mcap_summary import MAGIC
from scpf.ingest.mcap_unpack import BLOCK
from scpf.ingest.mcap_write import McapWriter
from scpf.ingest.recover_report import RecoveryReport, TopicRecovery
from scpf.ingest.topics import IMAGE_TYPES
from scpf.models.errors import DamagedError

MAX_CHANNELS: Final = 65_535
MAX_NAME_BYTES: Final = 1 << 16
MAX_DEFINITIONS_BYTES: Final = 24 << 20
"""Of topics and types in all, read or written; the index of the new file holds them all."""


class Contents:
    """Takes records over into ``writer`` and keeps the account in ``report``. ``channels``: known so far, by id."""

    def __init__(self, path: Path, writer: McapWriter, report: RecoveryReport) -> None:
        self.channels: dict[int, Channel] = {}
        self.report = report
        self.taken: Counter[int] = Counter()
        self._path, self._writer = path, writer
        self._schemas: dict[int, Schema] = {}
        self._defined: set[int] = set()
        self._definitions_bytes = 0
        self._outputs: dict[tuple[object, ...], int] = {}
        self._missing: Counter[int] = Counter()
        self._since_chunk: Counter[int] = Counter()
        self._after_index = False
        self._stated: dict[int, int] | None = None
        self._attachments_stated: list[str] = []
        self._metadata_stated = 0

    def begin_chunk(self) -> None:
        """The messages from here on are what the next message index is about."""
        self._since_chunk.clear()
        self._after_index = False

    def take(self, region: Region, record: Record, chunk: Record | None) -> None:
        """Take one record, of the file or of a ``chunk`` of it; one that cannot be read is counted as lost."""
        try:
            if record.opcode == 5:
                self._message(region, record, chunk)
            elif record.opcode == 7:
                self._message_index(region, record)
            else:
                if self._after_index:
                    self.begin_chunk()
                self._describe(region, record)
        except (DamagedError, struct.error, ValueError) as error:
            self.lose(
                record.start, record.end - record.start, f"a record that cannot be read ({error})", chunk
            )

    def lose(self, at: int, length: int, what: str, chunk: Record | None) -> None:
        """Note bytes of the file, or of a ``chunk`` of it, as lost."""
        if chunk is None:
            self.report.damage(at, length, what)
        else:
            self.report.damage(chunk.start, length, f"byte {at} of the records of this chunk: {what}")

    def take_attachment(self, region: Region, record: Record) -> bool:
        """Take an attachment that is as its checksum says; False, and nothing taken, for another."""
        body = region.part(record.body, record.length)
        try:
            cursor = Cursor(body.read(0, BLOCK), self._path, record.start)
            time_ns, create_time_ns = cursor.unpack("<QQ")
            name, media_type = cursor.text(), cursor.text()
            (size,) = cursor.unpack("<Q")
        except DamagedError:
            return False
        start = cursor.position
        if start + size + 4 > body.length or len(name) + len(media_type) > MAX_NAME_BYTES:
            return False
        crc = zlib.crc32(body.read(0, start))
        for block in _blocks(body, start, size):
            crc = zlib.crc32(block, crc)
        stated = int.from_bytes(body.read(start + size, 4), "little")
        if stated not in (0, crc):
            return False
        blocks = _blocks(body, start, size)
        self._writer.add_attachment_blocks(name, media_type, size, blocks, time_ns, create_time_ns)
        self.report.attachments.append(name)
        return True

    def drop_attachment(self, record: Record) -> None:
        """Leave out an attachment that fails its checksum."""
        self.report.damage(record.start, record.end - record.start, "an attachment fails its checksum")

    def settle(self) -> None:
        """Compare with what the file states about itself."""
        report = self.report
        missing = self._missing
        if self._stated is not None:
            missing = Counter({key: count - self.taken[key] for key, count in self._stated.items()})
            report.lost_known = True
        for key, count in missing.items():
            if count > 0:
                channel = self.channels.get(key)
                name = f"(channel {key}, not described)" if channel is None else channel.topic
                self._row(name, channel.schema.name if channel and channel.schema else "").lost += count
        if self._stated is None:
            report.lost_known = report.complete and not report.damages
        elif report.messages_lost and not report.damages:
            report.damage(0, 0, f"the index counts {report.messages_lost} messages more than there are")
        report.attachments_lost = list(
            (Counter(self._attachments_stated) - Counter(report.attachments)).elements()
        )
        report.metadata_lost = max(0, self._metadata_stated - len(report.metadata))

    def _describe(self, region: Region, record: Record) -> None:
        """Records that say something about the file."""
        if record.opcode in (1, 8, 14, 15):
            return  # written anew
        if record.opcode == 2:
            end = region.read(record.end, len(MAGIC) + 1)
            self.report.complete = self.report.complete or end == MAGIC
            return
        if record.opcode >= 0x80:
            text = f"a record of kind {record.opcode}, which the format leaves to others, is not taken over"
            self.report.damage(record.start, record.end - record.start, text)
            return
        cursor = Cursor(region.read(record.body, record.length), self._path, record.start)
        if record.opcode == 3:
            (schema_id,) = cursor.unpack("<H")
            name, encoding = cursor.text(), cursor.text()
            schema = Schema(name, encoding, bytes(cursor.take(cursor.unpack("<I")[0])))
            if self._schemas.get(schema_id) != schema:  # most are repeated in every chunk
                self._define(record.length)
                self._schemas[schema_id] = schema
        elif record.opcode == 4:
            channel_id, schema_id = cursor.unpack("<HH")
            known = self.channels.get(channel_id)
            topic, encoding, metadata = cursor.text(), cursor.text(), cursor.mapping()
            found = self._schemas.get(schema_id) or (known.schema if known and known.topic == topic else None)
            if schema_id and found is None:
                self.report.damage(record.start, 0, f"the message type of {topic!r} is lost")
            if known is not None and known.topic != topic and channel_id in self._defined:
                text = f"channel {channel_id}, {known.topic!r} so far, is {topic!r} from here on"
                self.report.damage(record.start, 0, text)
            self._defined.add(channel_id)
            channel = Channel(channel_id, topic, encoding, found, metadata)
            if known != channel:
                self._define(record.length)
                self.channels[channel_id] = channel
        elif record.opcode == 10:
            cursor.unpack("<QQQQQ")
            self._attachments_stated.append(cursor.text())
        elif record.opcode == 11:
            cursor.unpack("<QHIIIIQQ")
            inner = cursor.take(cursor.unpack("<I")[0] // 10 * 10)
            self._stated = dict(struct.iter_unpack("<HQ", inner))
        elif record.opcode == 12:
            name, values = cursor.text(), cursor.mapping()
            if len(name) > MAX_NAME_BYTES:
                raise ValueError(f"a name of {len(name)} characters")
            self._writer.add_metadata(name, values)
            self.report.metadata.append(name)
        elif record.opcode == 13:
            self._metadata_stated += 1

    def _message(self, region: Region, record: Record, chunk: Record | None) -> None:
        head = region.read(record.body, 22)
        channel_id, sequence, log_time_ns, publish_time_ns = struct.unpack("<HIQQ", head)
        channel = self.channels.get(channel_id)
        if channel is None:
            self._missing[channel_id] += 1
            self._since_chunk[channel_id] += 1
            what = f"a message of channel {channel_id}, which is not described"
            self.lose(record.start, record.end - record.start, what, chunk)
            return
        if log_time_ns > LATEST_NS:
            raise ValueError(f"a message at {log_time_ns} ns, after the year 2262")
        output = self._output(channel)
        # A copy: a view would keep the whole unpacked chunk in memory until the writer's own is full.
        data = bytes(region.read(record.body + 22, record.length - 22))
        self._writer.add_message(output, log_time_ns, data, publish_time_ns, sequence)
        self._row(channel.topic, channel.schema.name if channel.schema else "").recovered += 1
        self.taken[channel_id] += 1
        self._since_chunk[channel_id] += 1
        if chunk is None and self.report.chunks:
            # Out of a plain chunk that is cut or damaged at its head: its checksum cannot be used.
            self.report.unverified += 1

    def _define(self, size: int) -> None:
        self._definitions_bytes += size
        if self._definitions_bytes > MAX_DEFINITIONS_BYTES:
            raise ValueError("more than 24 MiB of definitions")

    def _output(self, channel: Channel) -> int:
        schema = channel.schema or Schema("", "", b"")
        key = (channel.topic, channel.encoding, schema, tuple(sorted(channel.metadata.items())))
        if key not in self._outputs:
            if len(self._outputs) >= MAX_CHANNELS:
                raise DamagedError("more than 65535 different channels")
            self._define(len(schema.data) + len(channel.topic))
            self._outputs[key] = self._writer.add_channel(
                channel.topic,
                schema.name,
                schema.data,
                stream="image" if schema.name in IMAGE_TYPES else "small",
                message_encoding=channel.encoding,
                schema_encoding=schema.encoding,
                metadata=channel.metadata,
            )
        return self._outputs[key]

    def _message_index(self, region: Region, record: Record) -> None:
        """After each chunk the file says how many messages of each channel it holds."""
        channel_id, size = struct.unpack("<HI", region.read(record.body, 6))
        short = size // 16 - self._since_chunk[channel_id]
        if short > 0:
            self._missing[channel_id] += short
        self._after_index = True

    def _row(self, topic: str, type_name: str) -> TopicRecovery:
        return self.report.topics.setdefault(topic, TopicRecovery(topic, type_name))


def _blocks(region: Region, start: int, size: int) -> Iterator[memoryview]:
    for offset in range(start, start + size, BLOCK):
        yield region.read(offset, min(BLOCK, start + size - offset))
