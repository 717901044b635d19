"""NMEA: sentences of the standard's own making, and an independent encoder."""

from __future__ import annotations

from datetime import UTC, date, datetime
from pathlib import Path

import numpy as np
import pytest
from applanix_encoders import drive
from navigation_text_encoders import nmea, nmea_bodies, nmea_sentence
from packet_encoders import ethernet, ipv4, pcap, udp

from scpf.ingest import nmea as reader
from scpf.ingest.navigation import Navigation
from scpf.ingest.nmea_sentences import degrees, sentences, time_of_day, two_digit_date
from scpf.ingest.read_report import ReadOptions, ReadReport
from scpf.models.errors import DamagedError, MissingError


def _read(tmp_path: Path, data: bytes, options: ReadOptions | None = None) -> Navigation:
    (tmp_path / "log.nmea").write_bytes(data)
    return reader.read(tmp_path / "log.nmea", options or ReadOptions())


def test_a_published_sentence_and_its_checksum() -> None:
    text = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n"
    (sentence,) = sentences(text, report := ReadReport("", "nmea"))
    assert (sentence.kind, len(sentence.fields), report.skipped_bytes) == ("GGA", 14, 0)
    assert degrees(sentence.fields[1], "N", "NS", 90) == pytest.approx(48 + 7.038 / 60)
    assert degrees(sentence.fields[3], "W", "EW", 180) == pytest.approx(-(11 + 31 / 60))
    assert time_of_day(sentence.fields[0]) == (12 * 3600 + 35 * 60 + 19) * 10**9
    assert two_digit_date("230394") == date(1994, 3, 23)


@pytest.mark.parametrize("talker", ["IN", "GP", "GN"])
def test_a_drive_comes_back(tmp_path: Path, talker: str) -> None:
    d = drive(20)
    navigation = _read(tmp_path, nmea(d, talker))
    assert navigation.report.lossless
    assert navigation.report.records == 100
    assert navigation.stamps_ns.tolist() == [round(unix * 10) * 10**8 for unix in d.unix_s]
    np.testing.assert_allclose(navigation.latitude_deg, d.latitude, rtol=0, atol=2e-10)
    np.testing.assert_allclose(navigation.longitude_deg, d.longitude, rtol=0, atol=2e-10)
    np.testing.assert_allclose(navigation.height_m, d.height, atol=1e-4)  # above the ellipsoid
    north, east, _ = d.velocity_ned.T
    np.testing.assert_allclose(navigation.velocity_enu_mps[:, :2], np.column_stack([east, north]), atol=1e-5)
    assert np.isnan(navigation.velocity_enu_mps[:, 2]).all()
    # PASHR's heading goes before that of HDT (0.5° more, here): it has its own time.
    np.testing.assert_allclose(np.degrees(navigation.heading_rad), d.attitude_deg[:, 2], atol=1e-5)
    np.testing.assert_allclose(np.degrees(navigation.pitch_rad), d.attitude_deg[:, 1], atol=1e-5)
    np.testing.assert_allclose(np.degrees(navigation.attitude_rms_rad), np.tile([0.01, 0.02, 0.05], (20, 1)))
    assert navigation.native["nmea"].columns["sentence"].values[0].startswith(f"${talker}GGA".encode())


def test_heading_of_hdt_where_there_is_no_pashr(tmp_path: Path) -> None:
    d = drive(5)
    bodies = [body for body in nmea_bodies(d) if not body.startswith("PASHR")]
    navigation = _read(tmp_path, b"".join(map(nmea_sentence, bodies)))
    np.testing.assert_allclose(np.degrees(navigation.heading_rad), d.attitude_deg[:, 2] + 0.5, atol=1e-5)


def test_the_date_rolls_over_at_midnight(tmp_path: Path) -> None:
    d = drive(40, datetime(2021, 12, 31, 23, 59, 58, tzinfo=UTC))
    # Only the very first RMC tells the date; the days are counted on.
    bodies = nmea_bodies(d)
    kept = [body for k, body in enumerate(bodies) if "RMC" not in body or k < 5]
    navigation = _read(tmp_path, b"".join(map(nmea_sentence, kept)))
    assert navigation.stamps_ns.tolist() == [round(unix * 10) * 10**8 for unix in d.unix_s]


def test_a_date_that_comes_late_holds_for_what_was_before(tmp_path: Path) -> None:
    d = drive(40, datetime(2021, 12, 31, 23, 59, 58, tzinfo=UTC))
    bodies = [body for body in nmea_bodies(d) if "RMC" not in body]
    zda = "GPZDA,000001.900,01,01,2022,00,00"
    navigation = _read(tmp_path, b"".join(map(nmea_sentence, [*bodies, zda])))
    assert navigation.stamps_ns.tolist() == [round(unix * 10) * 10**8 for unix in d.unix_s]


def test_the_date_is_asked_for_or_taken_from_the_capture(tmp_path: Path) -> None:
    d = drive(5)
    data = nmea(d, dated=False)
    with pytest.raises(MissingError, match="date is not known"):
        _read(tmp_path, data)
    expected = round(d.unix_s[0] * 1e9)
    assert _read(tmp_path, data, ReadOptions(date=date(2021, 6, 15))).stamps_ns[0] == expected
    captured = pcap([(d.unix_s[0] + 0.1, ethernet(ipv4(17, udp(data))))])
    assert _read(tmp_path, captured).stamps_ns[0] == expected


def test_bad_checksums_and_garbage_are_counted(tmp_path: Path) -> None:
    data = nmea(drive(5))
    wrong = b"$INGGA,183000.000,4328.0,N,08032.0,W,4,14,0.7,336.0,M,-36.0,M,1.0,0001*00\r\n"
    report = _read(tmp_path, b"binary\xff\x00" + wrong + data + b"$INGGA,1830").report
    assert report.bad_checksums == 1
    assert report.skipped_bytes == 8 + len(wrong) - 2 + 11  # line ends are no loss
    assert report.rows == 5


def test_no_fix_empty_and_unreadable_fields_are_counted(tmp_path: Path) -> None:
    bodies = [
        *nmea_bodies(drive(2)),
        "INGGA,183001.000,,,,,0,00,,,M,,M,,",
        "INGGA,183002.000,4399.0,N,08032.0,W,4,14,0.7,336.0,M,-36.0,M,1.0,0001",
        "INGGA,253002.000,4328.0,N,08032.0,W,4,14,0.7,336.0,M,-36.0,M,1.0,0001",
        "INHDT,inf,T",
        "INGSV,1,1,00",
        "INRMC,183003.000,V,,,,,,,150621,,,N",
    ]
    report = _read(tmp_path, b"".join(map(nmea_sentence, bodies))).report
    assert report.dropped["GGA without a fix"] == 1
    assert report.dropped["GGA whose fields cannot be read"] == 2
    assert report.dropped["HDT whose fields cannot be read"] == 1
    assert report.undecoded["NMEA GSV"] == 1
    assert report.undecoded["RMC that calls itself void"] == 1
    assert report.rows == 2


def test_rmc_alone_has_no_heights(tmp_path: Path) -> None:
    d = drive(3)
    bodies = [body for body in nmea_bodies(d) if "RMC" in body]
    navigation = _read(tmp_path, b"".join(map(nmea_sentence, bodies)))
    np.testing.assert_allclose(navigation.latitude_deg, d.latitude, atol=2e-10)
    assert (navigation.height_m == 0).all()
    assert any("RMC alone: no heights" in note for note in navigation.report.notes)
    with pytest.raises(MissingError, match="without a heading"):
        navigation.to_trajectory(navigation.origin())


def test_heights_above_the_sea_are_called_so(tmp_path: Path) -> None:
    body = "GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,,M,,"
    navigation = _read(tmp_path, nmea_sentence(body), ReadOptions(date=date(2021, 6, 15)))
    assert any("above sea level" in note for note in navigation.report.notes)


def test_a_log_without_times_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DamagedError, match="no sentence with a time"):
        _read(tmp_path, nmea_sentence("INHDT,10.0,T"))
