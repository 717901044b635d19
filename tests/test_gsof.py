"""GSOF: an independent encoder (no real capture with values is at hand)."""

from __future__ import annotations

import struct
from datetime import UTC, date, datetime
from pathlib import Path

import numpy as np
import pytest
from applanix_encoders import drive, gsof, gsof_16, gsof_49, gsof_packets, gsof_record
from packet_encoders import ethernet, ipv4, pcap, tcp

from scpf.ingest import gsof as reader
from scpf.ingest.navigation import Navigation
from scpf.ingest.read_report import ReadOptions
from scpf.models.errors import DamagedError


def _read(tmp_path: Path, data: bytes, options: ReadOptions | None = None) -> Navigation:
    (tmp_path / "gsof.bin").write_bytes(data)
    return reader.read(tmp_path / "gsof.bin", options or ReadOptions())


def test_sizes_of_the_layouts() -> None:
    d = drive(1)
    assert len(gsof_49(d, 0)) == 104 == reader._DTYPES[49].itemsize
    assert reader._DTYPES[50].itemsize == 44
    assert reader._DTYPES[16].itemsize == 9
    assert reader._DTYPES[1].itemsize == 10


@pytest.mark.parametrize("page_bytes", [0xF7, 40, 7, 1])
def test_a_drive_comes_back_whatever_the_pages(tmp_path: Path, page_bytes: int) -> None:
    d = drive(20)
    navigation = _read(tmp_path, gsof(d, page_bytes))
    assert navigation.report.lossless
    assert navigation.stamps_ns.tolist() == [round(unix * 1e9 / 1e8) * 10**8 for unix in d.unix_s]
    assert (navigation.latitude_deg == d.latitude).all()
    assert (navigation.height_m == d.height).all()
    north, east, down = d.velocity_ned.T
    np.testing.assert_allclose(navigation.velocity_enu_mps, np.column_stack([east, north, -down]), rtol=1e-7)
    np.testing.assert_allclose(np.degrees(navigation.roll_rad), d.attitude_deg[:, 0], rtol=1e-12)
    np.testing.assert_allclose(np.degrees(navigation.heading_rad), d.attitude_deg[:, 2], rtol=1e-12)
    np.testing.assert_allclose(np.degrees(navigation.rates_radps), np.tile([1, 2, 3], (20, 1)), rtol=1e-7)
    np.testing.assert_allclose(navigation.position_rms_m, np.tile([0.02, 0.01, 0.03], (20, 1)), rtol=1e-6)
    np.testing.assert_allclose(navigation.velocity_rms_mps, np.tile([5e-3, 4e-3, 6e-3], (20, 1)), rtol=1e-6)
    assert navigation.native["gsof_49"].columns["alignment"].values.tolist() == [4] * 20
    assert len(navigation.native["gsof_16"].stamps_ns) == 20


def test_garbage_bad_checksums_and_lost_pages_are_counted(tmp_path: Path) -> None:
    d = drive(4)
    packets = [gsof_packets(gsof_record(49, gsof_49(d, k)), k, 60) for k in range(4)]
    assert [len(pages) for pages in packets] == [2] * 4
    bad = bytearray(packets[2][1])
    bad[20] ^= 0x10
    data = packets[0][0] + b"garbage\x02\x00" + packets[0][1] + packets[1][0]  # 1: second page lost
    data += packets[2][0] + bytes(bad) + b"".join(packets[3])
    navigation = _read(tmp_path, data)
    report = navigation.report
    assert navigation.stamps_ns.tolist() == [round(d.unix_s[k] * 10) * 10**8 for k in (0, 3)]
    assert report.bad_checksums == 1
    assert report.skipped_bytes == 9 + len(bad)
    assert report.dropped == {"page of a transmission that is not whole": 2}


def test_other_records_are_counted_and_a_record_that_lies_is_a_loss(tmp_path: Path) -> None:
    d = drive(1)
    records = gsof_record(2, b"\0" * 24) + gsof_record(49, b"\0" * 7) + gsof_record(49, gsof_49(d, 0))
    report = _read(tmp_path, b"".join(gsof_packets(records + b"\x32\xff\0\0", 1))).report
    assert report.undecoded == {"GSOF 2": 1, "GSOF 49 of 7 bytes, not 104": 1}
    assert report.dropped == {"record that is longer than its transmission": 1}


def test_the_streams_leap_seconds_go_before_the_table(tmp_path: Path) -> None:
    d = drive(1)
    records = gsof_record(16, gsof_16(d, 0, offset=15)) + gsof_record(49, gsof_49(d, 0))
    navigation = _read(tmp_path, b"".join(gsof_packets(records, 1)))
    assert navigation.stamps_ns[0] == round(d.unix_s[0] * 1e9) + 3 * 10**9
    assert "leap seconds of the stream (record 16): 15" in navigation.report.notes


def test_a_week_counted_modulo_1024(tmp_path: Path) -> None:
    d = drive(1)
    data = b"".join(gsof_packets(gsof_record(49, gsof_49(d, 0, week=d.week(0) % 1024)), 1))
    options = ReadOptions(date=date(2021, 6, 15))
    assert _read(tmp_path, data, options).stamps_ns[0] == round(d.unix_s[0] * 1e9)
    captured = pcap([(d.unix_s[0], ethernet(ipv4(6, tcp(1, data))))])
    assert _read(tmp_path, captured).stamps_ns[0] == round(d.unix_s[0] * 1e9)


def test_a_run_over_the_weeks_end(tmp_path: Path) -> None:
    d = drive(20, datetime(2021, 6, 19, 23, 59, 41, tzinfo=UTC))
    assert d.week(19) == d.week(0) + 1
    navigation = _read(tmp_path, gsof(d))
    np.testing.assert_allclose(navigation.stamps_ns * 1e-9, d.unix_s, atol=1e-6)


def test_an_all_zero_record_is_no_position(tmp_path: Path) -> None:
    with pytest.raises(DamagedError, match="without a usable time: 1"):
        _read(tmp_path, b"".join(gsof_packets(gsof_record(49, b"\0" * 104), 1)))


def test_a_week_no_one_sends_does_not_overflow(tmp_path: Path) -> None:
    d = drive(2)
    wild = struct.pack(">H", 65535) + gsof_49(d, 0)[2:]
    records = gsof_record(49, wild) + gsof_record(49, gsof_49(d, 1))
    navigation = _read(tmp_path, b"".join(gsof_packets(records, 1)))
    assert len(navigation) == 1
    assert navigation.report.dropped == {"record without a usable time": 1}


def test_a_stream_without_navigation_is_refused(tmp_path: Path) -> None:
    data = b"".join(gsof_packets(gsof_record(16, gsof_16(drive(1), 0)), 1))
    with pytest.raises(DamagedError, match="no record 49"):
        _read(tmp_path, data)
