"""Network captures, built packet by packet."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
from packet_encoders import ethernet, ipv4, ipv6, pcap, pcapng, tcp, udp

from scpf.ingest import pcap as reader
from scpf.ingest.capture_links import TCP, UDP

T0 = 1_623_781_800.25
LINKS: dict[str, tuple[int, Callable[[bytes], bytes]]] = {
    "ethernet": (1, ethernet),
    "vlan": (1, lambda network: ethernet(network, vlan=True)),
    "cooked": (113, lambda network: b"\0" * 14 + b"\x08\x00" + network),
    "cooked2": (276, lambda network: b"\x08\x00" + b"\0" * 18 + network),
    "raw": (101, lambda network: network),
    "loopback": (0, lambda network: b"\x02\0\0\0" + network),
}


def _only(data: bytes) -> reader.Stream:
    capture = reader.survey(data)
    assert len(capture.flows) == 1, capture.odd
    return reader.extract(data, next(iter(capture.flows)))


@pytest.mark.parametrize("link", LINKS)
def test_datagrams_of_every_link_type(link: str) -> None:
    number, wrap = LINKS[link]
    data = pcap([(T0 + k, wrap(ipv4(UDP, udp(f"part{k} ".encode())))) for k in range(3)], link=number)
    assert _only(data) == reader.Stream(b"part0 part1 part2 ", 0, 0)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("magic", [0xA1B2C3D4, 0xA1B23C4D])
def test_both_byte_orders_and_resolutions(order: str, magic: int) -> None:
    data = pcap([(T0, ethernet(ipv4(UDP, udp(b"x"))))], order=order, magic=magic)
    assert reader.survey(data).first_unix_ns == 1_623_781_800_250_000_000


@pytest.mark.parametrize("order", ["<", ">"])
def test_pcapng(order: str) -> None:
    data = pcapng([(T0 + k, ethernet(ipv4(UDP, udp(b"abc")))) for k in range(2)], order=order)
    assert _only(data).data == b"abcabc"
    assert reader.survey(data).first_unix_ns == 1_623_781_800_250_000_000


@pytest.mark.parametrize("options", [False, True])
def test_ipv6(options: bool) -> None:
    data = pcap([(T0, ethernet(ipv6(UDP, udp(b"six"), options), kind=0x86DD))])
    assert _only(data).data == b"six"
    assert "2020:" in str(next(iter(reader.survey(data).flows)))


def test_padding_of_short_ethernet_frames_is_no_payload() -> None:
    assert _only(pcap([(T0, ethernet(ipv4(UDP, udp(b"x"))) + b"\0" * 20)])).data == b"x"


def _tcp(*segments: tuple[int, bytes]) -> bytes:
    return pcap([(T0, ethernet(ipv4(TCP, tcp(number, payload)))) for number, payload in segments])


def test_segments_out_of_order_and_sent_again() -> None:
    data = _tcp((100, b"abc"), (106, b"ghi"), (103, b"def"), (103, b"def"), (105, b"fghijk"))
    assert _only(data) == reader.Stream(b"abcdefghijk", 0, 7)


def test_sequence_numbers_run_over_their_32_bits() -> None:
    assert _only(_tcp((2**32 - 2, b"abcd"), (6, b"ijk"), (2, b"efgh"))) == reader.Stream(b"abcdefghijk", 0, 0)


def test_lost_segments_are_counted() -> None:
    assert _only(_tcp((100, b"abc"), (110, b"klm"))) == reader.Stream(b"abcklm", 7, 0)


def test_a_wild_sequence_number_allocates_nothing() -> None:
    stream = _only(_tcp((100, b"abc"), (100 + 2**31 - 5, b"xyz"), (103, b"def")))
    assert stream.data == b"abcdefxyz"
    assert stream.missing_bytes == 2**31 - 5 - 6


def test_a_new_connection_of_the_same_ports_begins_anew() -> None:
    packets = [tcp(1000, b"", 2), tcp(1001, b"one"), tcp(50, b"", 2), tcp(51, b"two")]
    data = pcap([(T0, ethernet(ipv4(TCP, packet))) for packet in packets])
    assert _only(data) == reader.Stream(b"onetwo", 0, 0)


def test_packets_that_the_capture_cut_short() -> None:
    packet = ethernet(ipv4(UDP, udp(b"abcdef")))
    whole = pcap([(T0, packet)])
    short = whole[:24] + struct.pack("<IIII", 0, 0, len(packet) - 2, len(packet)) + packet[:-2]
    assert _only(short) == reader.Stream(b"abcd", 2, 0)
    in_headers = whole[:24] + struct.pack("<IIII", 0, 0, 20, len(packet)) + packet[:20]
    assert reader.survey(in_headers).odd == Counter({"packet cut off in its headers": 1})


def test_a_capture_that_breaks_off() -> None:
    packet = ethernet(ipv4(UDP, udp(b"abc")))
    data = pcap([(T0, packet), (T0, packet)])
    assert _only(data[:-1]).data == b"abcab"
    assert reader.survey(data[:-1]).odd["capture cut off in a packet"] == 1
    assert reader.survey(data[:30]).odd["capture cut off in a packet"] == 1


def test_a_packet_larger_than_possible_ends_the_capture() -> None:
    data = pcap([(T0, b"")])[:24] + struct.pack("<IIII", 0, 0, 0xFFFFFFFF, 0xFFFFFFFF)
    assert reader.survey(data).odd["capture damaged: a packet larger than 256 KiB"] == 1


def test_what_is_no_stream_is_counted() -> None:
    packets = [
        ethernet(ipv4(UDP, udp(b"abc"), fragment=0x2000)),
        ethernet(b"\0" * 28, kind=0x0806),
        ethernet(ipv4(1, b"ping")),
    ]
    odd = reader.survey(pcap([(T0, packet) for packet in packets])).odd
    assert odd == Counter({"IP fragment": 1, "not IP": 1, "neither UDP nor TCP": 1})


def test_the_real_capture(shared_data: Path) -> None:
    data = (shared_data / "applanix" / "poslv_grp_first40s.pcap").read_bytes()
    capture = reader.survey(data)
    assert [str(flow) for flow in capture.flows] == ["UDP 192.168.2.3:65534 → 192.168.2.255:5600"]
    assert len(_only(data).data) == 132_136 == len(data) - 24 - 121 * (16 + 42)
    assert not capture.odd
