"""POSPac's ASCII export: rows by an independent encoder, under a published header."""

from __future__ import annotations

from datetime import date
from pathlib import Path

import numpy as np
import pytest
from applanix_encoders import drive
from navigation_text_encoders import POSPAC_HEADER, pospac

from scpf.ingest import pospac as reader
from scpf.ingest.navigation import Navigation
from scpf.ingest.read_report import ReadOptions
from scpf.models.errors import DamagedError, MissingError

SHUFFLED = ("TIME", "HEADING", "LONGITUDE", "ROLL", "ELLIPSOID HEIGHT", "PITCH", "LATITUDE")
ON_THE_GRID = ("TIME", "EASTING", "NORTHING", "ELLIPSOID HEIGHT", "HEADING")


def _read(tmp_path: Path, data: bytes, options: ReadOptions | None = None) -> Navigation:
    (tmp_path / "export.txt").write_bytes(data)
    return reader.read(tmp_path / "export.txt", options or ReadOptions())


def test_a_drive_comes_back(tmp_path: Path) -> None:
    d = drive(20)
    navigation = _read(tmp_path, pospac(d))
    np.testing.assert_allclose(navigation.stamps_ns * 1e-9, d.unix_s, atol=1e-6)
    np.testing.assert_allclose(navigation.latitude_deg, d.latitude, atol=1e-9)
    north, east, down = d.velocity_ned.T
    np.testing.assert_allclose(navigation.velocity_enu_mps, np.column_stack([east, north, -down]), atol=1e-9)
    np.testing.assert_allclose(np.degrees(navigation.heading_rad), d.attitude_deg[:, 2], atol=1e-9)
    np.testing.assert_allclose(navigation.position_rms_m, np.tile([0.02, 0.01, 0.03], (20, 1)))
    np.testing.assert_allclose(np.degrees(navigation.attitude_rms_rad), np.tile([0.01, 0.02, 0.05], (20, 1)))
    assert len(navigation.native["pospac"].columns) == 19
    assert navigation.native["pospac"].columns["EAST SD"].unit == "m"
    assert navigation.native["pospac"].columns["HEADING SD"].unit == "deg"
    assert any("by the date of mission 2021-06-15" in note for note in navigation.report.notes)


def test_columns_are_found_by_name(tmp_path: Path) -> None:
    d = drive(5)
    navigation = _read(tmp_path, pospac(d, SHUFFLED))
    np.testing.assert_allclose(navigation.longitude_deg, d.longitude, atol=1e-9)
    np.testing.assert_allclose(np.degrees(navigation.pitch_rad), d.attitude_deg[:, 1], atol=1e-9)
    assert np.isnan(navigation.velocity_enu_mps).all()


@pytest.mark.parametrize("zone", [None, "17N"])
def test_eastings_and_northings_by_the_header_or_the_zone(tmp_path: Path, zone: str | None) -> None:
    from pyproj import Transformer

    d = drive(5)
    utm = Transformer.from_crs("EPSG:4326", "EPSG:32617")
    grid = utm.transform(d.latitude, d.longitude)
    data = pospac(d, ON_THE_GRID, grid)
    if zone is not None:
        data = data.replace(b"central meridian", b"nothing of interest")
        with pytest.raises(MissingError, match="mapping frame is not known"):
            _read(tmp_path, data)
    navigation = _read(tmp_path, data, ReadOptions(utm_zone=zone))
    np.testing.assert_allclose(navigation.latitude_deg, d.latitude, atol=1e-9)
    np.testing.assert_allclose(navigation.longitude_deg, d.longitude, atol=1e-9)


def test_names_may_be_apart_by_blanks(tmp_path: Path) -> None:
    d = drive(3)
    data = pospac(d, SHUFFLED).replace(", ".join(SHUFFLED).encode(), "   ".join(SHUFFLED).encode())
    assert _read(tmp_path, data).height_m.tolist() == pytest.approx(d.height.tolist())


def test_the_second_height_is_kept_under_its_own_name(tmp_path: Path) -> None:
    names = [*SHUFFLED, "ELLIPSOID HEIGHT"]
    assert "ELLIPSOID HEIGHT 2" in _read(tmp_path, pospac(drive(3), names)).native["pospac"].columns


def test_angles_in_radians(tmp_path: Path) -> None:
    data = pospac(drive(3)).replace(b"and SD in Degrees", b"and SD in Radians")
    data = data.replace(b"orientation angles and SD in", b"orientation angles in")
    assert _read(tmp_path, data).heading_rad[0] == pytest.approx(70.0 - 22 * np.pi)


def test_a_row_that_breaks_off_is_named(tmp_path: Path) -> None:
    data = pospac(drive(5)).rstrip()[:-30]
    line = data.count(b"\n") + 1
    with pytest.raises(DamagedError, match=rf"export.txt:{line} \(byte \d+\): \d+ columns"):
        _read(tmp_path, data)


def test_a_word_among_the_numbers_is_named(tmp_path: Path) -> None:
    with pytest.raises(DamagedError, match="'300,5' is not a number"):
        _read(tmp_path, pospac(drive(5)).replace(b" 300.0100000000 ", b" 300,5 "))


def test_without_a_date_the_reader_asks_for_it(tmp_path: Path) -> None:
    d = drive(3)
    data = pospac(d).replace(b"Date of Mission", b"Day of Mission")
    with pytest.raises(MissingError, match="GPS week is not known"):
        _read(tmp_path, data)
    navigation = _read(tmp_path, data, ReadOptions(date=date(2021, 6, 15)))
    assert navigation.stamps_ns[0] == round(d.unix_s[0] * 1e9)


def test_times_in_utc_when_the_units_say_so(tmp_path: Path) -> None:
    d = drive(3)
    navigation = _read(tmp_path, pospac(d).replace(b"time in Sec", b"UTC time in Sec"))
    assert navigation.stamps_ns[0] == round(d.unix_s[0] * 1e9) + 18 * 10**9


@pytest.mark.parametrize("text", [POSPAC_HEADER, "TIME, LATITUDE\n", "nothing\n"])
def test_headers_alone_are_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(DamagedError):
        _read(tmp_path, text.encode())
