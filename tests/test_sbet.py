"""SBET and SMRMSG: real files against the bytes themselves, and an independent encoder."""

from __future__ import annotations

import csv
import struct
import tracemalloc
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from applanix_encoders import drive, sbet, smrmsg

from scpf.ingest import sbet as reader
from scpf.ingest.read_report import ReadOptions
from scpf.models.errors import DamagedError, InputError, MissingError

DAY = ReadOptions(date=date(2021, 6, 15))


@pytest.mark.parametrize(("name", "count"), [("sbet.out", 200), ("2-points.sbet", 2)])
def test_a_real_file_to_float_precision(shared_data: Path, name: str, count: int) -> None:
    path = shared_data / "applanix" / name
    navigation = reader.read(path, ReadOptions(week=1650))
    data = path.read_bytes()
    assert len(navigation) == count == len(data) // 136
    for k in range(count):
        (time, lat, lon, height, x, y, z, roll, pitch, heading, wander, *inertial) = struct.unpack_from(
            "<17d", data, 136 * k
        )
        assert navigation.stamps_ns[k] == (315964800 + 1650 * 604800 - 15) * 10**9 + round(time * 1e9)
        assert np.radians(navigation.latitude_deg[k]) == pytest.approx(lat, rel=1e-15)
        assert np.radians(navigation.longitude_deg[k]) == pytest.approx(lon, rel=1e-15)
        assert (navigation.height_m[k], navigation.roll_rad[k], navigation.pitch_rad[k]) == (
            height,
            roll,
            pitch,
        )
        assert navigation.heading_rad[k] == pytest.approx(heading - wander, rel=1e-14)
        assert [*navigation.accelerations_mps2[k], *navigation.rates_radps[k]] == inertial
        north, west = np.cos(wander) * x - np.sin(wander) * y, np.sin(wander) * x + np.cos(wander) * y
        np.testing.assert_allclose(navigation.velocity_enu_mps[k], [-west, north, z], rtol=1e-14)
        values = [column.values[k] for column in navigation.native["sbet"].columns.values()]
        assert values == list(struct.unpack_from("<17d", data, 136 * k))
    assert navigation.report.lossless
    assert any("velocities agree with the positions" in note for note in navigation.report.notes)


def test_the_real_velocities_are_not_north_east_down(shared_data: Path) -> None:
    navigation = reader.read(shared_data / "applanix" / "sbet.out", ReadOptions(week=1650))
    positions = navigation.to_trajectory(navigation.origin()).positions_m
    seconds = (navigation.stamps_ns[-1] - navigation.stamps_ns[0]) * 1e-9
    mean = navigation.velocity_enu_mps.mean(axis=0)
    np.testing.assert_allclose((positions[-1] - positions[0]) / seconds, mean, atol=0.05)
    assert np.linalg.norm(mean) > 100  # an aircraft: nothing else would fit by chance


def test_smrmsg_equals_its_text(shared_data: Path) -> None:
    with (shared_data / "applanix" / "smrmsg_first_half.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    text = np.array(rows, dtype=float)
    start = 315964800 + 1700 * 604800 + 536258
    times = np.array([start, start + 10_000], dtype=np.int64) * 10**9
    table = reader.read_smrmsg(shared_data / "applanix" / "smrmsg_first_half.out", times, ReadOptions())
    assert len(header) == len(table.columns) == 10
    for k, column in enumerate(table.columns.values()):
        np.testing.assert_allclose(column.values, text[:, k], rtol=0, atol=0.5000001e-6)
    assert [column.unit for column in table.columns.values()][7:] == ["arcmin"] * 3


def test_the_truncated_file_is_refused_by_name_and_size(shared_data: Path) -> None:
    with pytest.raises(DamagedError) as caught:
        reader.read(shared_data / "applanix" / "badfile.sbet", ReadOptions(week=1650))
    assert "badfile.sbet has 271 bytes" in str(caught.value)
    assert "136" in str(caught.value)
    assert caught.value.hint


def test_a_drive_comes_back(tmp_path: Path) -> None:
    d = drive(30)
    (tmp_path / "sbet.out").write_bytes(sbet(d))
    (tmp_path / "smrmsg.out").write_bytes(smrmsg(d))
    navigation = reader.read(
        tmp_path / "sbet.out", ReadOptions(week=d.week(0), smrmsg=tmp_path / "smrmsg.out")
    )
    np.testing.assert_allclose(navigation.stamps_ns * 1e-9, d.unix_s, atol=1e-6)
    np.testing.assert_allclose(navigation.latitude_deg, d.latitude, rtol=1e-14)
    north, east, down = d.velocity_ned.T
    np.testing.assert_allclose(navigation.velocity_enu_mps, np.column_stack([east, north, -down]), atol=1e-12)
    np.testing.assert_allclose(np.degrees(navigation.heading_rad), d.attitude_deg[:, 2], atol=1e-12)
    np.testing.assert_allclose(navigation.position_rms_m, np.tile([0.02, 0.01, 0.03], (30, 1)))
    np.testing.assert_allclose(navigation.velocity_rms_mps, np.tile([0.005, 0.004, 0.006], (30, 1)))
    np.testing.assert_allclose(
        navigation.attitude_rms_rad, np.tile(np.radians(np.array([0.6, 1.2, 3.0]) / 60), (30, 1))
    )
    by_date = reader.read(tmp_path / "sbet.out", DAY)
    assert (by_date.stamps_ns == navigation.stamps_ns).all()


def _with_velocities(data: bytes, velocities: np.ndarray) -> bytes:
    table = np.frombuffer(data, "<f8").reshape(-1, 17).copy()
    table[:, 4:7] = velocities
    return table.tobytes()


def test_north_east_down_velocities_are_recognised_with_a_warning(tmp_path: Path) -> None:
    d = drive(20)
    (tmp_path / "ned.sbet").write_bytes(_with_velocities(sbet(d), d.velocity_ned))
    navigation = reader.read(tmp_path / "ned.sbet", DAY)
    assert any("WARNING: velocities taken as North-East-Down" in note for note in navigation.report.notes)
    north, east, down = d.velocity_ned.T
    np.testing.assert_allclose(navigation.velocity_enu_mps, np.column_stack([east, north, -down]))


def test_velocities_that_contradict_the_positions_are_reported(tmp_path: Path) -> None:
    d = drive(20)
    (tmp_path / "odd.sbet").write_bytes(_with_velocities(sbet(d), np.array([30.0, 0.0, 0.0])))
    notes = reader.read(tmp_path / "odd.sbet", DAY).report.notes
    assert any("WARNING: velocities disagree with the positions at 10.00 m/s" in note for note in notes)


def test_damaged_records_are_left_out_and_counted(tmp_path: Path) -> None:
    table = np.frombuffer(sbet(drive(20)), "<f8").reshape(-1, 17).copy()
    table[3, 0], table[5, 1], table[9, 0] = np.nan, 1e300, table[8, 0]
    (tmp_path / "sbet.out").write_bytes(table.tobytes())
    navigation = reader.read(tmp_path / "sbet.out", DAY)
    assert len(navigation) == 17
    assert sum(navigation.report.dropped.values()) == 3
    assert not navigation.report.lossless


def test_a_run_over_the_weeks_end(tmp_path: Path) -> None:
    table = np.frombuffer(sbet(drive(20)), "<f8").reshape(-1, 17).copy()
    table[:, 0] = (604799.0 + 0.1 * np.arange(20)) % 604800
    (tmp_path / "sbet.out").write_bytes(table.tobytes())
    stamps = reader.read(tmp_path / "sbet.out", ReadOptions(week=2162)).stamps_ns
    np.testing.assert_allclose(np.diff(stamps) * 1e-9, 0.1, atol=1e-9)
    assert stamps[0] == (315964800 + 2162 * 604800 + 604799 - 18) * 10**9


def test_without_a_week_the_reader_asks_for_it(tmp_path: Path) -> None:
    (tmp_path / "sbet.out").write_bytes(sbet(drive(3)))
    with pytest.raises(MissingError, match="GPS week is not known"):
        reader.read(tmp_path / "sbet.out", ReadOptions())


def test_accuracies_of_another_day_are_refused(tmp_path: Path) -> None:
    d = drive(30)
    (tmp_path / "sbet.out").write_bytes(sbet(d))
    (tmp_path / "smrmsg.out").write_bytes(smrmsg(d._replace(unix_s=d.unix_s - 86400)))
    with pytest.raises(InputError, match="share no time"):
        reader.read(tmp_path / "sbet.out", ReadOptions(week=d.week(0), smrmsg=tmp_path / "smrmsg.out"))


def test_accuracies_alone_are_no_log(tmp_path: Path) -> None:
    (tmp_path / "smrmsg.out").write_bytes(smrmsg(drive(30)))
    with pytest.raises(InputError, match="not poses"):
        reader.refuse_smrmsg(tmp_path / "smrmsg.out", ReadOptions())


def test_a_large_file_is_mapped_not_loaded(tmp_path: Path) -> None:
    records = 100_000
    table = np.tile(np.frombuffer(sbet(drive(1)), "<f8"), (records, 1))
    table[:, 0] += 0.005 * np.arange(records)
    (tmp_path / "sbet.out").write_bytes(table.tobytes())
    size = table.nbytes
    del table
    reader.read(tmp_path / "sbet.out", DAY)  # imports are not counted
    tracemalloc.start()
    try:
        assert len(reader.read(tmp_path / "sbet.out", DAY)) == records
        assert tracemalloc.get_traced_memory()[1] < size
    finally:
        tracemalloc.stop()
