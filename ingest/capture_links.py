"""What is inside a captured packet: link, network and transport headers of libpcap link types.

Layouts: Ethernet II and 802.1Q/802.1ad tags, Linux cooked v1 and v2, raw IP, BSD loopback (tcpdump's link-layer
header types); IPv4 (RFC 791), IPv6 with its extension headers (RFC 8200), UDP (RFC 768), TCP (RFC 9293).
"""

from __future__ import annotations

import struct
from ipaddress import ip_address
from typing import Final, NamedTuple

_VLAN_TAGS: Final = (0x8100, 0x88A8, 0x9100)
_IPV4, _IPV6 = 0x0800, 0x86DD
_EXTENSIONS: Final = (0, 43, 60)
"""IPv6: hop-by-hop, routing, destination options; 8 bytes a unit after the first."""
UDP, TCP = 17, 6


class Flow(NamedTuple):
    """One direction of a conversation; addresses as the packets have them (4 or 16 bytes)."""

    protocol: int
    source: bytes
    source_port: int
    target: bytes
    target_port: int

    def __str__(self) -> str:
        name = {UDP: "UDP", TCP: "TCP"}[self.protocol]
        ends = (ip_address(self.source), self.source_port, ip_address(self.target), self.target_port)
        return f"{name} {ends[0]}:{ends[1]} → {ends[2]}:{ends[3]}"


class Segment(NamedTuple):
    """A datagram or TCP segment. ``missing``: bytes that the capture cut off its end."""

    flow: Flow
    payload: bytes
    missing: int
    sequence: int
    """TCP: the number of the first byte of the payload."""
    begins: bool
    """TCP: SYN, the begin of a connection."""


def dissect(link_type: int, packet: bytes) -> Segment | str:
    """The segment inside a packet, or why there is none. Never raises: headers that break off are a reason."""
    try:
        found = _network(link_type, packet)
        return found if isinstance(found, str) else _transport(*found)
    except (struct.error, IndexError):
        return "packet cut off in its headers"


def _network(link_type: int, packet: bytes) -> tuple[int, bytes] | str:
    """EtherType and the network packet."""
    if link_type == 1:
        kind, start = _u16(packet, 12), 14
        while kind in _VLAN_TAGS:
            kind, start = _u16(packet, start + 2), start + 4
        return kind, packet[start:]
    if link_type == 113:  # Linux cooked
        return _u16(packet, 14), packet[16:]
    if link_type == 276:  # Linux cooked, version 2
        return _u16(packet, 0), packet[20:]
    if link_type in (12, 14, 101, 228, 229):  # raw IP
        return _by_version(packet)
    if link_type in (0, 108):  # loopback: four bytes of address family in the writer's byte order
        return _by_version(packet[4:])
    return f"link type {link_type} is not known"


def _by_version(packet: bytes) -> tuple[int, bytes]:
    return (_IPV4 if packet[0] >> 4 == 4 else _IPV6), packet


def _u16(data: bytes, offset: int) -> int:
    (value,) = struct.unpack_from(">H", data, offset)
    return int(value)


def _transport(kind: int, packet: bytes) -> Segment | str:
    if kind == _IPV4:
        header, total, fragment = (packet[0] & 15) * 4, _u16(packet, 2), _u16(packet, 6)
        if packet[0] >> 4 != 4 or header < 20:
            return "not IPv4, though it says so"
        if fragment & 0x3FFF:  # more fragments follow, or this is not the first
            return "IP fragment"
        # A total length of 0: the network card cut this packet up later (segmentation offload).
        length = total or len(packet)
        source, target = packet[12:16], packet[16:20]
        protocol = packet[9]
    elif kind == _IPV6:
        if packet[0] >> 4 != 6:
            return "not IPv6, though it says so"
        header, length, protocol = 40, 40 + _u16(packet, 4), packet[6]
        source, target = packet[8:24], packet[24:40]
        while protocol in _EXTENSIONS:
            protocol, header = packet[header], header + (packet[header + 1] + 1) * 8
        if protocol == 44:
            return "IP fragment"
    else:
        return "not IP"
    body = packet[header:length]
    if protocol == UDP:
        source_port, target_port, size, _checksum = struct.unpack_from(">HHHH", body)
        if size < 8:
            return "UDP length below 8"
        flow = Flow(UDP, source, source_port, target, target_port)
        return Segment(flow, body[8:size], max(size - len(body), 0), 0, False)
    if protocol == TCP:
        source_port, target_port, sequence, _ack, offset, flags = struct.unpack_from(">HHIIBB", body)
        start = (offset >> 4) * 4
        if start < 20:
            return "TCP header below 20 bytes"
        begins = bool(flags & 2)
        flow = Flow(TCP, source, source_port, target, target_port)
        missing = max(length - header - max(len(body), start), 0)
        return Segment(flow, body[start:], missing, sequence + begins, begins)
    return "neither UDP nor TCP"
