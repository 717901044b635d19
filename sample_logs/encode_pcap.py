"""Network captures of UDP: libpcap, link type Ethernet, nanosecond times (tcpdump's file format)."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator

from scpf.sample_logs.encode_grp import UDP_PORT, Datagram

NANOSECOND_MAGIC, ETHERNET, SNAPSHOT_BYTES = 0xA1B23C4D, 1, 65_535
SENDER_MAC, EVERYONE_MAC = bytes.fromhex("0017470203aa"), b"\xff" * 6
SENDER_IP, EVERYONE_IP = bytes([192, 168, 53, 100]), bytes([192, 168, 53, 255])
IPV4, UDP, HOPS = 0x0800, 17, 64
SENDER_PORT = 1061
ON_THE_WIRE_NS = 120_000
"""From the moment that a message is about until it is captured."""


def pcap(datagrams: Iterable[Datagram], port: int = UDP_PORT) -> Iterator[bytes]:
    """The pieces of a capture of broadcast datagrams: its header, then a packet a piece."""
    yield struct.pack("<IHHiIII", NANOSECOND_MAGIC, 2, 4, 0, 0, SNAPSHOT_BYTES, ETHERNET)
    for number, (stamp_ns, payload) in enumerate(datagrams):
        packet = _ethernet(_ipv4(_udp(payload, port), number))
        seconds, fraction = divmod(stamp_ns + ON_THE_WIRE_NS, 10**9)
        yield struct.pack("<IIII", seconds, fraction, len(packet), len(packet)) + packet


def _ethernet(content: bytes) -> bytes:
    return EVERYONE_MAC + SENDER_MAC + struct.pack(">H", IPV4) + content


def _ipv4(content: bytes, number: int) -> bytes:
    """An IPv4 packet (RFC 791), its header's checksum filled in."""
    head = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(content), number % 65536, 0, HOPS, UDP, 0)
    head += SENDER_IP + EVERYONE_IP
    return head[:10] + struct.pack(">H", _internet_checksum(head)) + head[12:] + content


def _udp(payload: bytes, port: int) -> bytes:
    """A UDP datagram (RFC 768) with its checksum, which covers the addresses, too."""
    size = 8 + len(payload)
    head = struct.pack(">HHHH", SENDER_PORT, port, size, 0)
    pseudo = SENDER_IP + EVERYONE_IP + struct.pack(">BBH", 0, UDP, size)
    checksum = _internet_checksum(pseudo + head + payload) or 0xFFFF
    return head[:6] + struct.pack(">H", checksum) + payload


def _internet_checksum(content: bytes) -> int:
    """The ones' complement sum of RFC 1071."""
    content += bytes(len(content) % 2)
    total: int = sum(struct.unpack(f">{len(content) // 2}H", content))
    while total > 0xFFFF:
        total = (total & 0xFFFF) + (total >> 16)
    return ~total & 0xFFFF
