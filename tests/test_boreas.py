"""CSV poses of the Boreas dataset: the published file, and an independent encoder."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from navigation_text_encoders import boreas

from scpf.ingest import boreas as reader
from scpf.ingest.navigation import Navigation
from scpf.ingest.read_report import ReadOptions
from scpf.models.errors import DamagedError, MissingError, UsageError
from scpf.models.trajectory import yaw_of

ZONE = ReadOptions(utm_zone="17N")
T0_US = 1_628_184_886_438_099


def _real(shared_data: Path) -> Path:
    return shared_data / "boreas" / "boreas-2021-08-05-13-34" / "applanix" / "camera_poses.csv"


def test_the_published_file(shared_data: Path) -> None:
    path = _real(shared_data)
    with path.open(newline="") as file:
        _, *rows = csv.reader(file)
    navigation = reader.read(path, ZONE)
    assert len(navigation) == len(rows) == 11_192
    assert navigation.report.lossless
    assert navigation.stamps_ns.tolist() == [int(row[0]) * 1000 for row in rows]
    minutes = (navigation.stamps_ns[-1] - navigation.stamps_ns[0]) / 60e9
    assert 18 < minutes < 20
    # The institute in Toronto where the drives begin.
    assert navigation.latitude_deg[0] == pytest.approx(43.782, abs=1e-3)
    assert navigation.longitude_deg[0] == pytest.approx(-79.466, abs=1e-3)
    assert np.degrees(np.abs(navigation.roll_rad)).max() < 10  # a car, not a camera on its side


def test_utm_and_local_coordinates_are_the_same_but_for_scale_and_north(shared_data: Path) -> None:
    navigation = reader.read(_real(shared_data), ZONE)
    positions = navigation.to_trajectory(navigation.origin()).positions_m
    columns = navigation.native["boreas"].columns
    utm = np.column_stack([columns["easting"].values, columns["northing"].values])
    utm = (utm - utm[0]) @ np.array([1.0, 1.0j])
    local = positions[:, :2] @ np.array([1.0, 1.0j])
    ratio = np.vdot(utm, local) / np.vdot(utm, utm)
    # 120 km east of the zone's centre: 0.9996·(1 + ½(123/6371)²) = 0.99979 on the ellipsoid; North turns by 1.06°.
    assert 1 / abs(ratio) == pytest.approx(0.99979, abs=5e-5)
    assert np.degrees(np.angle(ratio)) == pytest.approx(-1.061, abs=0.02)
    assert np.abs(local - ratio * utm).max() < 0.5


def test_the_body_drives_where_it_looks(shared_data: Path) -> None:
    navigation = reader.read(_real(shared_data), ZONE)
    trajectory = navigation.to_trajectory(navigation.origin())
    velocity = np.gradient(trajectory.positions_m, navigation.stamps_ns * 1e-9, axis=0)
    fast = np.linalg.norm(velocity, axis=1) > 5
    ahead = trajectory.poses()[fast, :3, 0]
    course = velocity[fast] / np.linalg.norm(velocity[fast], axis=1)[:, None]
    assert np.degrees(np.arccos(np.median(np.sum(ahead * course, axis=1)))) < 1.5
    miss = np.linalg.norm(navigation.velocity_enu_mps - velocity, axis=1)[fast]
    assert np.median(miss) < 0.1
    rate = np.gradient(np.unwrap(navigation.heading_rad), navigation.stamps_ns * 1e-9)
    slope = np.polyfit(navigation.rates_radps[:, 2], rate, 1)[0]
    assert slope == pytest.approx(1.0, abs=0.02)  # body z down: the same sense as the heading


def _angles(R_enu_sensor: np.ndarray) -> list[float]:
    """Roll, pitch, heading of the file: R = (Rz(heading)·Ry(pitch)·Rx(roll) by scipy's convention)ᵀ."""
    from scipy.spatial.transform import Rotation

    heading, pitch, roll = Rotation.from_matrix(R_enu_sensor.T).as_euler("ZYX")
    return [roll, pitch, heading]


@pytest.mark.parametrize("sensor", ["camera", "body", "applanix"])
def test_sensors_are_told_apart_and_turned_to_the_body(tmp_path: Path, sensor: str) -> None:
    n, grid_yaw = 5, np.radians(30.0)
    ahead = np.array([np.cos(grid_yaw), np.sin(grid_yaw), 0.0])
    left, up = np.array([-ahead[1], ahead[0], 0.0]), np.array([0.0, 0.0, 1.0])
    axes = {"camera": [-left, -up, ahead], "body": [ahead, left, up], "applanix": [-left, ahead, up]}
    angles = np.tile(_angles(np.column_stack(axes[sensor])), (n, 1))
    easting = 500_000.0 + 10 * np.arange(n) * ahead[0]  # on the central meridian: grid North is true
    northing = 4_800_000.0 + 10 * np.arange(n) * ahead[1]
    velocity = np.tile(10 * ahead, (n, 1))
    stamps = [T0_US + 1_000_000 * k for k in range(n)]
    (tmp_path / "poses.csv").write_bytes(boreas(stamps, easting, northing, velocity, angles))
    navigation = reader.read(tmp_path / "poses.csv", ZONE)
    assert any(repr(sensor) in note for note in navigation.report.notes)
    pose = navigation.to_trajectory(navigation.origin()).poses()[0]
    assert yaw_of(pose) == pytest.approx(grid_yaw, abs=1e-6)
    np.testing.assert_allclose(pose[:3, 2], up, atol=1e-6)
    np.testing.assert_allclose(navigation.velocity_enu_mps, velocity, atol=1e-3)


def _simple(tmp_path: Path, **changes: object) -> Path:
    n = 3
    values: dict[str, object] = {
        "unix_us": [T0_US + 100_000 * k for k in range(n)],
        "easting": np.full(n, 5e5),
        "northing": np.full(n, 4.8e6),
        "velocity_enu": np.zeros((n, 3)),
        "rpy": np.zeros((n, 3)),
    }
    (tmp_path / "poses.csv").write_bytes(boreas(**(values | changes)))  # type: ignore[arg-type]
    return tmp_path / "poses.csv"


def test_times_in_seconds(tmp_path: Path) -> None:
    path = _simple(tmp_path, unix_us=[1_628_184_886, 1_628_184_887, 1_628_184_888])
    navigation: Navigation = reader.read(path, ReadOptions(utm_zone="17N", sensor="body"))
    assert navigation.stamps_ns[0] == 1_628_184_886 * 10**9


def test_what_the_file_does_not_say_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(MissingError, match="without a UTM zone"):
        reader.read(_simple(tmp_path), ReadOptions())
    with pytest.raises(MissingError, match="which axis of the sensor is ahead"):
        reader.read(_simple(tmp_path), ZONE)
    with pytest.raises(UsageError, match="not a kind of sensor"):
        reader.read(_simple(tmp_path), ReadOptions(utm_zone="17N", sensor="lidar"))
    with pytest.raises(UsageError, match="not a UTM zone"):
        reader.read(_simple(tmp_path), ReadOptions(utm_zone="61N"))


def test_a_line_that_breaks_off_is_named(tmp_path: Path) -> None:
    path = _simple(tmp_path)
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(DamagedError, match=r"poses.csv:4 \(byte \d+\)"):
        reader.read(path, ZONE)
