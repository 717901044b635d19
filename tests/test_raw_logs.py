"""The raw files of a simulated drive: read by the ingesters they give its poses, and read by hand what FORMATS says."""

from __future__ import annotations

import struct
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scpf.ingest import applanix
from scpf.ingest.navigation import Navigation
from scpf.ingest.read_report import ReadOptions
from scpf.models.errors import InputError
from scpf.models.geodesy import Origin
from scpf.sample_logs.encode_grp import grp
from scpf.sample_logs.encode_gsof import gsof
from scpf.sample_logs.encode_nmea import nmea
from scpf.sample_logs.encode_pcap import pcap
from scpf.sample_logs.encode_sbet import sbet, smrmsg
from scpf.sample_logs.gps_week import weeks_of
from scpf.sample_logs.ring_road import default_centre_line, default_road_map
from scpf.sample_logs.sensors import InsLog, simulate_ins
from scpf.sample_logs.vehicle import VehicleDrive, simulate_vehicle

Array = NDArray[np.float64]

ORIGIN = default_road_map().origin or Origin(0.0, 0.0, 0.0)
DAY = ReadOptions(date=date(2022, 8, 18))


@pytest.fixture(scope="module")
def drive() -> VehicleDrive:
    return simulate_vehicle(default_centre_line(), start_m=1700.0, duration_s=20.0, seed=7, stop_at_m=1760.0)


@pytest.fixture(scope="module")
def truth(drive: VehicleDrive) -> InsLog:
    """Without noise, so that a file's poses are those of the drive."""
    return simulate_ins(drive, ORIGIN, seed=1, noise=0.0)


def assert_same_drive(
    navigation: Navigation, drive: VehicleDrive, ins: InsLog, metres: float, degrees: float
) -> None:
    """Every row of the INS is there at its own time, and each pose is that of the bus within the file's precision."""
    assert navigation.report.lossless
    assert navigation.stamps_ns.tolist() == ins.stamps_ns.tolist()
    poses = navigation.to_trajectory(ORIGIN).poses()
    there = drive.motion.at(ins.stamps_ns).T_map_body
    assert np.linalg.norm(poses[:, :3, 3] - there[:, :3, 3], axis=1).max() < metres
    turned = np.swapaxes(there[:, :3, :3], 1, 2) @ poses[:, :3, :3]
    assert np.degrees(Rotation.from_matrix(turned).magnitude()).max() < degrees


def test_sbet_and_smrmsg_give_the_drive(tmp_path: Path, drive: VehicleDrive, truth: InsLog) -> None:
    (tmp_path / "sbet.out").write_bytes(sbet(truth))
    (tmp_path / "smrmsg.out").write_bytes(smrmsg(truth))
    options = ReadOptions(date=DAY.date, smrmsg=tmp_path / "smrmsg.out")
    navigation = applanix.read(tmp_path / "sbet.out", options)
    assert_same_drive(navigation, drive, truth, metres=1e-5, degrees=1e-6)
    assert any("velocities agree with the positions" in note for note in navigation.report.notes)
    velocity = truth.velocity_ned_mps[:, [1, 0, 2]] * [1, 1, -1]
    np.testing.assert_allclose(navigation.velocity_enu_mps, velocity, atol=1e-9)
    np.testing.assert_allclose(navigation.rates_radps, np.radians(truth.rates_degps), atol=1e-12)
    np.testing.assert_allclose(navigation.accelerations_mps2, truth.accelerations_mps2, atol=1e-12)
    whole = truth.stamps_ns % 10**9 == 0
    rms = truth.position_rms_m[:, [1, 0, 2]]
    np.testing.assert_allclose(navigation.position_rms_m[whole], rms[whole], rtol=1e-9)
    heading_rms = np.degrees(navigation.attitude_rms_rad[whole])
    np.testing.assert_allclose(heading_rms, truth.attitude_rms_deg[whole], rtol=1e-9)


@pytest.mark.parametrize("page_bytes", [247, 100, 31])
def test_gsof_gives_the_drive_whatever_the_pages(
    tmp_path: Path, drive: VehicleDrive, truth: InsLog, page_bytes: int
) -> None:
    (tmp_path / "lvx.gsof").write_bytes(gsof(truth, page_bytes=page_bytes))
    navigation = applanix.read(tmp_path / "lvx.gsof")  # the stream itself says week and leap seconds
    assert navigation.report.format == "gsof"
    assert navigation.report.bad_checksums == 0
    assert_same_drive(navigation, drive, truth.at_rate(50), metres=1e-5, degrees=1e-6)
    assert set(navigation.native) == {"gsof_16", "gsof_49", "gsof_50"}
    rms = truth.at_rate(1).position_rms_m[:, [1, 0, 2]]
    whole = navigation.stamps_ns % 10**9 == 0
    np.testing.assert_allclose(navigation.position_rms_m[whole], rms, rtol=1e-6)


def test_a_capture_of_grp_gives_the_drive(tmp_path: Path, drive: VehicleDrive, truth: InsLog) -> None:
    (tmp_path / "poslv.pcap").write_bytes(b"".join(pcap(grp(truth))))
    navigation = applanix.read(tmp_path / "poslv.pcap")
    assert navigation.report.format == "grp"
    assert navigation.report.container == "pcap, UDP 192.168.53.100:1061 → 192.168.53.255:5600"
    assert navigation.report.bad_checksums == 0
    assert_same_drive(navigation, drive, truth.at_rate(50), metres=1e-5, degrees=1e-6)
    assert {"GPS week 2223 of the stream (group 3)", "leap seconds of the stream (group 3): 18"} <= set(
        navigation.report.notes
    )
    velocity = truth.at_rate(50).velocity_ned_mps[:, [1, 0, 2]] * [1, 1, -1]
    np.testing.assert_allclose(navigation.velocity_enu_mps, velocity, atol=2e-6)


def test_nmea_gives_the_drive_within_its_decimals(tmp_path: Path, drive: VehicleDrive, truth: InsLog) -> None:
    (tmp_path / "ins.nmea").write_bytes(nmea(truth))
    navigation = applanix.read(tmp_path / "ins.nmea")
    assert navigation.report.format == "nmea"
    # Half of the last decimal: 1e-7 minutes are 0.19 mm of latitude, heights 0.1 mm, angles 0.001° each.
    assert_same_drive(navigation, drive, truth.at_rate(10), metres=2e-4, degrees=1e-3)
    velocity = truth.at_rate(10).velocity_ned_mps[:, [1, 0]]
    np.testing.assert_allclose(navigation.velocity_enu_mps[:, :2], velocity, atol=5e-4)


def test_noise_gives_the_same_wrong_positions_in_each_file(tmp_path: Path, drive: VehicleDrive) -> None:
    ins = simulate_ins(drive, ORIGIN, seed=1)
    (tmp_path / "sbet").write_bytes(sbet(ins))
    (tmp_path / "gsof").write_bytes(gsof(ins))
    (tmp_path / "grp").write_bytes(b"".join(datagram.payload for datagram in grp(ins)))
    fine = applanix.read(tmp_path / "sbet", DAY)
    there = fine.to_trajectory(ORIGIN)
    for name in ("gsof", "grp"):
        found = applanix.read(tmp_path / name).to_trajectory(ORIGIN)
        rows = np.searchsorted(there.stamps_ns, found.stamps_ns)
        np.testing.assert_allclose(found.positions_m, there.positions_m[rows], atol=1e-5)
    off = there.positions_m - drive.motion.at(there.stamps_ns).T_map_body[:, :3, 3]
    assert 1e-3 < np.abs(off).mean() < 0.1


def test_sbet_by_hand(truth: InsLog) -> None:
    """Seventeen little-endian doubles, 136 bytes a record (FORMATS, SBET)."""
    data = sbet(truth, wander_rad=0.3)
    assert len(data) == 136 * len(truth)
    for k in (0, 1000, len(truth) - 1):
        values = struct.unpack("<17d", data[136 * k : 136 * k + 136])
        time, latitude, longitude, height, x, y, z, roll, pitch, platform, wander = values[:11]
        unix = 315964800 + 604800 * 2223 + time - 18
        assert unix == pytest.approx(truth.stamps_ns[k] * 1e-9, abs=1e-6)
        assert np.degrees([latitude, longitude]) == pytest.approx(
            [truth.latitude_deg[k], truth.longitude_deg[k]], abs=1e-12
        )
        assert height == truth.height_m[k]
        # Turned back by the wander angle, x and y are North and West.
        north, west = np.cos(wander) * x - np.sin(wander) * y, np.sin(wander) * x + np.cos(wander) * y
        assert [north, -west, -z] == pytest.approx(list(truth.velocity_ned_mps[k]), abs=1e-12)
        heading = np.degrees(platform - wander)
        assert [*np.degrees([roll, pitch]), heading] == pytest.approx(list(truth.attitude_deg[k]))
    accuracies = smrmsg(truth)
    assert len(accuracies) == 80 * len(truth.at_rate(1))
    time, *rms = struct.unpack("<10d", accuracies[:80])
    assert time == int(time)
    slow = truth.at_rate(1)
    assert rms[:6] == pytest.approx([*slow.position_rms_m[0], *slow.velocity_rms_mps[0]])
    assert rms[6:] == pytest.approx(list(slow.attitude_rms_deg[0] * 60))


def test_grp_by_hand(truth: InsLog) -> None:
    """Header, times, body, padding, checksum and end of every message (FORMATS, $GRP)."""
    data = b"".join(datagram.payload for datagram in grp(truth))
    slow, at, groups, last_time = truth.at_rate(50), 0, {1: 0, 2: 0, 3: 0}, 0.0
    while at < len(data):
        start, group, count = struct.unpack_from("<4sHH", data, at)
        assert start == b"$GRP"
        message = data[at : at + 8 + count]
        assert len(message) % 4 == 0
        assert sum(struct.unpack(f"<{len(message) // 2}H", message)) % 65536 == 0
        assert message[-2:] == b"$#"
        time1, time2, distance, types, _ = struct.unpack_from("<dddBB", message, 8)
        assert types & 15 == 1  # GPS time
        row = groups[1]
        expected = slow.stamps_ns[row] * 1e-9 + 18 - 315964800 - 604800 * 2223
        assert time1 == pytest.approx(expected, abs=1e-6)
        assert time1 >= last_time
        assert time2 > 0
        assert 0.0 <= distance < 12.0 * 21
        last_time = time1
        body = message[34:]
        if group == 1:
            assert count == 132
            values = struct.unpack_from("<3d3f4d2f3f3fB", body)
            (latitude, longitude, altitude), velocity, attitude = values[:3], values[3:6], values[6:9]
            assert (latitude, longitude) == (slow.latitude_deg[row], slow.longitude_deg[row])
            assert altitude == slow.height_m[row]
            assert list(velocity) == pytest.approx(list(slow.velocity_ned_mps[row]), abs=1e-6)
            assert list(attitude) == list(slow.attitude_deg[row])
            wander, track, speed, *inertial, alignment = values[9:]
            assert wander == 0.0
            assert speed == pytest.approx(np.hypot(*slow.velocity_ned_mps[row, :2]), abs=1e-6)
            slip = (track - attitude[2] + 180.0) % 360.0 - 180.0
            assert abs(slip) < 0.1 or speed < 0.1
            assert inertial == pytest.approx(
                [*slow.rates_degps[row], *slow.accelerations_mps2[row]], abs=1e-5
            )
            assert alignment == 0
        elif group == 2:
            assert count == 80
            rms = struct.unpack_from("<12f", body)
            expected_rms = [
                *slow.position_rms_m[row],
                *slow.velocity_rms_mps[row],
                *slow.attitude_rms_deg[row],
            ]
            assert list(rms[:9]) == pytest.approx(expected_rms, rel=1e-6)
        groups[group] += 1
        at += 8 + count
    assert groups[1] == len(slow)
    assert groups[2] == groups[3] in (21, 22, 23)


def test_the_checksums_of_gsof_and_nmea_by_hand(truth: InsLog) -> None:
    data, at, packets = gsof(truth, page_bytes=100), 0, 0
    while at < len(data):
        size = data[at + 3]
        assert (data[at], data[at + 2], data[at + 5 + size]) == (0x02, 0x40, 0x03)
        assert sum(data[at + 1 : at + 4 + size]) % 256 == data[at + 4 + size]
        assert size <= 0xFA
        at, packets = at + 6 + size, packets + 1
    assert packets > len(truth.at_rate(50))  # 106 bytes of record 49 do not fit on a page
    for line in nmea(truth).decode().splitlines():
        content, _, checksum = line[1:].partition("*")
        total = 0
        for letter in content:
            total ^= ord(letter)
        assert total == int(checksum, 16)


def test_a_drive_over_the_end_of_a_week_and_a_day(tmp_path: Path) -> None:
    end_ns = (315964800 + 604800 * 2224 - 18) * 10**9
    drive = simulate_vehicle(default_centre_line(), duration_s=5.0, start_ns=end_ns - 2 * 10**9)
    ins = simulate_ins(drive, ORIGIN, seed=0, noise=0.0)
    (tmp_path / "sbet").write_bytes(sbet(ins))
    (tmp_path / "gsof").write_bytes(gsof(ins))
    (tmp_path / "grp").write_bytes(b"".join(pcap(grp(ins))))
    midnight = 1_660_953_600 * 10**9
    late = simulate_vehicle(default_centre_line(), duration_s=5.0, start_ns=midnight - 2 * 10**9)
    late_ins = simulate_ins(late, ORIGIN, seed=0, noise=0.0)
    (tmp_path / "nmea").write_bytes(nmea(late_ins))
    assert (
        applanix.read(tmp_path / "sbet", ReadOptions(week=2223)).stamps_ns.tolist() == ins.stamps_ns.tolist()
    )
    for name in ("gsof", "grp"):
        assert applanix.read(tmp_path / name).stamps_ns.tolist() == ins.at_rate(50).stamps_ns.tolist()
    assert applanix.read(tmp_path / "nmea").stamps_ns.tolist() == late_ins.at_rate(10).stamps_ns.tolist()
    with pytest.raises(InputError, match="2017"):
        weeks_of(np.array([10**18]))
