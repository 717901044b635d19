"""Network captures: libpcap (µs and ns, both byte orders) and pcapng, with their UDP and TCP streams in order.

A capture is read twice: once for what flows there are, once for the one that is wanted. Every length is checked
against the file before it is used; a record that breaks off ends the capture and is counted.
"""

from __future__ import annotations

import mmap
import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from scpf.ingest.capture_links import TCP, Flow, Segment, dissect

Buffer = bytes | mmap.mmap

MAGICS: Final = {
    b"\xd4\xc3\xb2\xa1": ("<", 1_000),
    b"\xa1\xb2\xc3\xd4": (">", 1_000),
    b"\x4d\x3c\xb2\xa1": ("<", 1),
    b"\xa1\xb2\x3c\x4d": (">", 1),
}
"""Byte order, and nanoseconds a unit of the second time field."""
PCAPNG_MAGIC: Final = b"\x0a\x0d\x0d\x0a"
MAX_PACKET_BYTES: Final = 1 << 18
HEAD_BYTES: Final = 1 << 16
MAX_FLOWS: Final = 4096
"""A capture with more conversations is a network's, not a drive's; further ones are counted, not listed."""


class Packet(NamedTuple):
    """A captured packet: ``unix_ns`` 0 where the capture has no time."""

    link_type: int
    unix_ns: int
    data: bytes


@dataclass
class FlowSummary:
    """One direction of a conversation: its payload bytes, and the first of them."""

    payload_bytes: int = 0
    head: bytearray = field(default_factory=bytearray)


@dataclass
class Capture:
    """What a capture holds. ``odd``: reason → packets without a payload that could be read."""

    flows: dict[Flow, FlowSummary] = field(default_factory=dict)
    first_unix_ns: int = 0
    odd: Counter[str] = field(default_factory=Counter)


class Stream(NamedTuple):
    """The bytes of one flow in order. ``missing_bytes``: lost, or cut off by the capture."""

    data: bytes
    missing_bytes: int
    repeated_bytes: int


def is_capture(head: bytes) -> bool:
    """Whether a file that begins so is a capture."""
    return head[:4] in MAGICS or head[:4] == PCAPNG_MAGIC


def survey(data: Buffer) -> Capture:
    """The flows of a capture."""
    capture = Capture()
    for packet in packets(data, capture.odd):
        capture.first_unix_ns = capture.first_unix_ns or packet.unix_ns
        segment = dissect(packet.link_type, packet.data)
        if isinstance(segment, str):
            capture.odd[segment] += 1
            continue
        if segment.flow not in capture.flows and len(capture.flows) >= MAX_FLOWS:
            capture.odd["packet of one flow too many"] += 1
            continue
        summary = capture.flows.setdefault(segment.flow, FlowSummary())
        summary.payload_bytes += len(segment.payload)
        if len(summary.head) < HEAD_BYTES:
            summary.head += segment.payload
    return capture


def extract(data: Buffer, flow: Flow) -> Stream:
    """The bytes of a flow: datagrams one after the other, TCP segments by their sequence numbers."""
    found = (dissect(packet.link_type, packet.data) for packet in packets(data, Counter()))
    segments = (segment for segment in found if isinstance(segment, Segment) and segment.flow == flow)
    if flow.protocol == TCP:
        return _reassembled(segments)
    joined, missing = bytearray(), 0
    for segment in segments:
        joined += segment.payload
        missing += segment.missing
    return Stream(bytes(joined), missing, 0)


def _reassembled(segments: Iterator[Segment]) -> Stream:
    """TCP segments in the order of their bytes; the first copy of repeated bytes counts.

    Sequence numbers have 32 bits: each is taken as the one closest to the last. A new SYN begins a new stream.
    """
    connections: list[list[tuple[int, bytes]]] = [[]]
    last: int | None = None
    first_number: int | None = None
    for segment in segments:
        if segment.begins and segment.sequence != first_number:
            connections.append([])
            last, first_number = None, segment.sequence
        if last is None:
            last = segment.sequence
        number = last + ((segment.sequence - last + 2**31) % 2**32) - 2**31
        if segment.payload:
            connections[-1].append((number, segment.payload))
            last = number
    joined, missing, repeated = bytearray(), 0, 0
    for connection in connections:
        end = min((number for number, _ in connection), default=0)
        for number, payload in sorted(connection, key=lambda part: part[0]):
            missing += max(number - end, 0)
            overlap = min(max(end - number, 0), len(payload))
            repeated += overlap
            joined += payload[overlap:]
            end = max(end, number + len(payload))
    return Stream(bytes(joined), missing, repeated)


def packets(data: Buffer, odd: Counter[str]) -> Iterator[Packet]:
    """The packets of a capture, to the first record that breaks off or lies about its size."""
    head = data[:4]
    if head in MAGICS:
        yield from _pcap(data, *MAGICS[bytes(head)], odd)
    elif head == PCAPNG_MAGIC:
        yield from _pcapng(data, odd)


def _pcap(data: Buffer, order: str, unit_ns: int, odd: Counter[str]) -> Iterator[Packet]:
    if len(data) < 24:
        odd["capture cut off in its header"] += 1
        return
    (link,) = struct.unpack_from(order + "I", data, 20)
    offset = 24
    while offset < len(data):
        if offset + 16 > len(data):
            odd["capture cut off in a packet"] += 1
            return
        seconds, fraction, size, _whole = struct.unpack_from(order + "IIII", data, offset)
        if size > MAX_PACKET_BYTES:
            odd["capture damaged: a packet larger than 256 KiB"] += 1
            return
        if offset + 16 + size > len(data):
            odd["capture cut off in a packet"] += 1
        yield Packet(
            link & 0xFFFF, seconds * 10**9 + fraction * unit_ns, data[offset + 16 : offset + 16 + size]
        )
        offset += 16 + size


def _pcapng(data: Buffer, odd: Counter[str]) -> Iterator[Packet]:
    """Blocks (IETF draft opsawg-pcapng): type, length, body, length; padded to 4 bytes."""
    offset, order = 0, "<"
    interfaces: list[tuple[int, int]] = []
    while offset < len(data):
        if offset + 12 > len(data):
            odd["capture cut off in a block"] += 1
            return
        if data[offset : offset + 4] == PCAPNG_MAGIC:  # a new section: its own byte order and interfaces
            order = ">" if data[offset + 8 : offset + 12] == b"\x1a\x2b\x3c\x4d" else "<"
            interfaces = []
        kind, size = struct.unpack_from(order + "II", data, offset)
        if size < 12 or size % 4 or offset + size > len(data):
            odd["capture cut off or damaged in a block"] += 1
            return
        body = data[offset + 8 : offset + size - 4]
        offset += size
        if kind == 1 and len(body) >= 8 and len(interfaces) < MAX_FLOWS:
            (link,) = struct.unpack_from(order + "H", body)
            interfaces.append((link, _units_per_second(body[8:], order)))
        elif kind in (2, 6) and len(body) >= 20:
            interface, high, low, length, _whole = struct.unpack_from(order + "IIIII", body)
            interface = interface >> 16 if kind == 2 and order == ">" else interface & 0xFFFF
            if interface >= len(interfaces) or length > len(body) - 20:
                odd["packet of an interface that is not described, or longer than its block"] += 1
                continue
            link, units = interfaces[interface]
            yield Packet(link, ((high << 32) + low) * 10**9 // units, body[20 : 20 + length])
        elif kind == 3 and len(body) >= 4 and interfaces:
            yield Packet(interfaces[0][0], 0, body[4:])


def _units_per_second(options: bytes, order: str) -> int:
    """Option 9 of an interface: the resolution of its times, a power of ten, or of two; else microseconds."""
    offset = 0
    while offset + 4 <= len(options):
        code, size = struct.unpack_from(order + "HH", options, offset)
        if code == 9 and size == 1 and offset + 4 < len(options):
            value = options[offset + 4]
            return int((2 if value & 0x80 else 10) ** min(value & 0x7F, 60))
        if code == 0:
            break
        offset += 4 + (size + 3) // 4 * 4
    return 1_000_000
