"""$GRP: the real capture against an independent decoder, and an independent encoder."""

from __future__ import annotations

import struct
from datetime import UTC, date, datetime
from pathlib import Path

import numpy as np
import pytest
from applanix_encoders import drive, grp, grp_1, grp_head, pos_message
from packet_encoders import ethernet, ipv4, pcap, tcp, udp

from scpf.ingest import pos_grp
from scpf.ingest.navigation import Navigation
from scpf.ingest.read_report import ReadOptions
from scpf.models.errors import DamagedError, MissingError


def _read(tmp_path: Path, data: bytes, options: ReadOptions | None = None) -> Navigation:
    (tmp_path / "pos.000").write_bytes(data)
    return pos_grp.read(tmp_path / "pos.000", options or ReadOptions())


def _real_messages(path: Path) -> list[bytes]:
    """The messages of the real capture, walked by their lengths alone."""
    data, stream, at = path.read_bytes(), b"", 24
    while at < len(data):
        (size,) = struct.unpack_from("<I", data, at + 8)
        stream += data[at + 16 + 42 : at + 16 + size]  # Ethernet 14, IPv4 20, UDP 8
        at += 16 + size
    found, at = [], 0
    while at < len(stream):
        (count,) = struct.unpack_from("<H", stream, at + 6)
        found.append(stream[at : at + 8 + count])
        at += 8 + count
    return found


def test_the_real_capture(shared_data: Path) -> None:
    path = shared_data / "applanix" / "poslv_grp_first40s.pcap"
    navigation = pos_grp.read(path, ReadOptions())
    report = navigation.report
    messages = _real_messages(path)
    assert (report.records, report.bad_checksums, report.skipped_bytes) == (len(messages), 0, 0)
    assert len(messages) == 1498
    assert report.lossless

    group1 = [m for m in messages if m[:6] == b"$GRP\x01\x00"]
    assert len(navigation) == len(group1) == 41
    for k, message in enumerate(group1):
        (time1,) = struct.unpack_from("<d", message, 8)
        # 2012-06-24 was a Sunday; 15 leap seconds until the end of that month.
        sunday = int(datetime(2012, 6, 24, tzinfo=UTC).timestamp())
        assert navigation.stamps_ns[k] == (sunday - 15) * 10**9 + round(time1 * 1e9)
        assert (navigation.latitude_deg[k], navigation.longitude_deg[k], navigation.height_m[k]) == (
            struct.unpack_from("<ddd", message, 34)
        )
        north, east, down = struct.unpack_from("<fff", message, 58)
        assert navigation.velocity_enu_mps[k].tolist() == [east, north, -down]
        roll, pitch, heading = struct.unpack_from("<ddd", message, 70)
        angles = [navigation.roll_rad[k], navigation.pitch_rad[k], navigation.heading_rad[k] % (2 * np.pi)]
        np.testing.assert_allclose(np.degrees(angles), [roll, pitch, heading], rtol=1e-14)
    assert "leap seconds of the stream (group 3): 15" in report.notes
    assert "GPS week 1694 of the stream (group 3)" in report.notes
    # The whole recording, of which this is the beginning, ends at 44.2449408681°, −76.5096210157°, 20.8124751°.
    assert navigation.latitude_deg[-1] == pytest.approx(44.2449408681, abs=1e-6)
    assert navigation.longitude_deg[-1] == pytest.approx(-76.5096210157, abs=2e-6)
    assert np.degrees(navigation.heading_rad[-1]) == pytest.approx(20.8124751, abs=2.0)
    # The first packet was captured 0.18 s after its first group 1 was valid.
    assert 0.0 < 1340648088.419146 - navigation.stamps_ns[0] * 1e-9 < 0.5


def test_a_drive_comes_back(tmp_path: Path) -> None:
    d = drive(30)
    navigation = _read(tmp_path, grp(d))
    np.testing.assert_allclose(navigation.stamps_ns * 1e-9, d.unix_s, atol=1e-6)
    assert (navigation.latitude_deg == d.latitude).all()
    north, east, down = d.velocity_ned.T
    np.testing.assert_allclose(navigation.velocity_enu_mps, np.column_stack([east, north, -down]), rtol=1e-7)
    np.testing.assert_allclose(np.degrees(navigation.heading_rad), d.attitude_deg[:, 2], rtol=1e-12)
    np.testing.assert_allclose(np.degrees(navigation.rates_radps), np.tile([1, 2, 3], (30, 1)), rtol=1e-7)
    np.testing.assert_allclose(navigation.accelerations_mps2, np.tile([0.1, 0.2, 0.3], (30, 1)), rtol=1e-7)
    np.testing.assert_allclose(navigation.position_rms_m, np.tile([0.02, 0.01, 0.03], (30, 1)), rtol=1e-6)
    np.testing.assert_allclose(
        np.degrees(navigation.attitude_rms_rad), np.tile([0.01, 0.02, 0.05], (30, 1)), rtol=1e-6
    )
    assert navigation.native["grp_1"].columns["track"].unit == "deg"
    assert len(navigation.native["grp_2"].stamps_ns) == 3
    assert navigation.report.undecoded == {"$MSG 50": 3}
    assert navigation.report.lossless


def test_garbage_and_bad_checksums_are_counted(tmp_path: Path) -> None:
    d = drive(10)
    whole = pos_message(b"$GRP", 1, grp_head(d, 9) + grp_1(d, 9))
    bad = bytearray(whole)
    bad[40] ^= 1
    navigation = _read(tmp_path, b"noise" + grp(d) + bytes(bad) + b"$GRP" + whole[:60])
    assert navigation.report.bad_checksums == 1
    assert navigation.report.skipped_bytes == 5 + len(whole) + 4 + 60
    assert len(navigation) == 10


def test_the_streams_leap_seconds_go_before_the_table_and_the_users_before_both(tmp_path: Path) -> None:
    d = drive(10)
    data = grp(d, offset=15.0)
    assert _read(tmp_path, data).stamps_ns[0] - round(d.unix_s[0] * 1e9) == 3 * 10**9
    assert _read(tmp_path, data, ReadOptions(leap_seconds=18)).stamps_ns[0] == round(d.unix_s[0] * 1e9)


def test_the_week_is_asked_for_or_taken_from_the_capture(tmp_path: Path) -> None:
    d = drive(10)
    data = grp(d, group_3=False)
    with pytest.raises(MissingError, match="GPS week is not known"):
        _read(tmp_path, data)
    expected = round(d.unix_s[0] * 1e9)
    assert _read(tmp_path, data, ReadOptions(date=date(2021, 6, 15))).stamps_ns[0] == expected
    captured = pcap([(d.unix_s[0] + 1, ethernet(ipv4(17, udp(data))))])
    assert _read(tmp_path, captured).stamps_ns[0] == expected


def test_a_tcp_capture_with_other_traffic(tmp_path: Path) -> None:
    d = drive(20)
    data = grp(d)
    parts = [(1 + k, data[k : k + 700]) for k in range(0, len(data), 700)]
    parts[2], parts[3] = parts[3], parts[2]
    packets = [ethernet(ipv4(6, tcp(number, part))) for number, part in [*parts, parts[0]]]
    packets.insert(2, ethernet(ipv4(17, udp(b"something else", 9))))
    navigation = _read(tmp_path, pcap([(d.unix_s[0], packet) for packet in packets]))
    assert len(navigation) == 20
    assert navigation.report.lossless
    assert "700 bytes were sent again (TCP)" in navigation.report.notes


def test_times_in_utc_and_in_the_second_field(tmp_path: Path) -> None:
    d = drive(3)
    sunday = datetime(2021, 6, 13, tzinfo=UTC).timestamp()
    utc = [struct.pack("<dddBB", d.unix_s[k] - sunday, 5.0, 0.0, 0x02, 0) for k in range(3)]
    second = [struct.pack("<dddBB", 5.0 + k, d.tow(k), 0.0, 0x10, 0) for k in range(3)]
    for heads in (utc, second):
        data = b"".join(pos_message(b"$GRP", 1, head + grp_1(d, k)) for k, head in enumerate(heads))
        stamps = _read(tmp_path, data, ReadOptions(date=date(2021, 6, 15))).stamps_ns
        np.testing.assert_allclose(stamps * 1e-9, d.unix_s, atol=1e-6)


def test_times_since_power_on_alone_are_refused(tmp_path: Path) -> None:
    d = drive(3)
    data = b"".join(pos_message(b"$GRP", 1, grp_head(d, k, types=0x00) + grp_1(d, k)) for k in range(3))
    with pytest.raises(DamagedError, match="neither GPS nor UTC"):
        _read(tmp_path, data)


def test_a_stream_without_navigation_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DamagedError, match="no group 1"):
        _read(tmp_path, pos_message(b"$MSG", 50, b"\0" * 4))
