"""Network packets and captures (pcap, pcapng) for the tests, byte by byte."""

from __future__ import annotations

import struct
from collections.abc import Iterable


def pcap(
    packets: Iterable[tuple[float, bytes]], link: int = 1, order: str = "<", magic: int = 0xA1B2C3D4
) -> bytes:
    """A libpcap file of (Unix s, packet)."""
    out = struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 65535, link)
    unit = 1e9 if magic == 0xA1B23C4D else 1e6
    for unix, packet in packets:
        fraction = round((unix % 1) * unit)
        out += struct.pack(order + "IIII", int(unix), fraction, len(packet), len(packet)) + packet
    return out


def ethernet(network: bytes, vlan: bool = False, kind: int = 0x0800) -> bytes:
    tag = b"\x81\x00\x00\x05" if vlan else b""
    return b"\x01" * 12 + tag + struct.pack(">H", kind) + network


def ipv4(protocol: int, payload: bytes, fragment: int = 0) -> bytes:
    head = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(payload), 7, fragment, 64, protocol, 0)
    return head + bytes([192, 168, 2, 3]) + bytes([192, 168, 2, 255]) + payload


def ipv6(protocol: int, payload: bytes, options: bool = False) -> bytes:
    if options:  # one empty hop-by-hop header
        payload, protocol = bytes([protocol, 0]) + b"\x01\x04\0\0\0\0" + payload, 0
    return struct.pack(">IHBB", 6 << 28, len(payload), protocol, 64) + b"\x20" * 16 + b"\x21" * 16 + payload


def udp(payload: bytes, target: int = 5600) -> bytes:
    return struct.pack(">HHHH", 4000, target, 8 + len(payload), 0) + payload


def tcp(sequence: int, payload: bytes, flags: int = 0x18, source: int = 5017) -> bytes:
    return struct.pack(">HHIIBBHHH", source, 40000, sequence % 2**32, 0, 5 << 4, flags, 8192, 0, 0) + payload


def pcapng(packets: Iterable[tuple[float, bytes]], link: int = 1, order: str = "<") -> bytes:
    """Section, interface with nanoseconds, enhanced packets."""

    def block(kind: int, body: bytes) -> bytes:
        body += b"\0" * (-len(body) % 4)
        size = len(body) + 12
        return struct.pack(order + "II", kind, size) + body + struct.pack(order + "I", size)

    out = block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1))
    out += block(1, struct.pack(order + "HHI", link, 0, 0) + struct.pack(order + "HHB3xHH", 9, 1, 9, 0, 0))
    for unix, packet in packets:
        stamp = int(unix) * 10**9 + round(unix % 1 * 1e9)
        head = struct.pack(order + "IIIII", 0, stamp >> 32, stamp & 0xFFFFFFFF, len(packet), len(packet))
        out += block(6, head + packet)
    return out
