"""The simulated INS and GPS: true without noise, and with noise as wrong as they say."""

from __future__ import annotations

import numpy as np
import pytest
from pyproj import Geod
from scipy.spatial.transform import Rotation

from scpf.models.errors import InputError
from scpf.models.geodesy import Origin, enu_from_geodetic
from scpf.sample_logs.ring_road import default_centre_line, default_road_map
from scpf.sample_logs.sensors import InsLog, simulate_gps, simulate_ins
from scpf.sample_logs.vehicle import VehicleDrive, simulate_vehicle

ORIGIN = default_road_map().origin or Origin(0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def drive() -> VehicleDrive:
    return simulate_vehicle(default_centre_line(), start_m=200.0, duration_s=60.0, seed=5)


@pytest.fixture(scope="module")
def truth(drive: VehicleDrive) -> InsLog:
    return simulate_ins(drive, ORIGIN, seed=1, noise=0.0)


def test_without_noise_positions_are_those_of_the_bus(drive: VehicleDrive, truth: InsLog) -> None:
    assert (np.diff(truth.stamps_ns) == 5_000_000).all()
    assert (truth.stamps_ns % 5_000_000 == 0).all()
    assert truth.stamps_ns[0] < drive.stamps_ns[0]
    assert truth.stamps_ns[-1] > drive.stamps_ns[-1]
    enu = enu_from_geodetic(truth.latitude_deg, truth.longitude_deg, truth.height_m, ORIGIN)
    np.testing.assert_allclose(enu, drive.motion.at(truth.stamps_ns).T_map_body[:, :3, 3], atol=1e-6)


def test_heading_and_velocity_are_from_true_north_at_the_place(truth: InsLog) -> None:
    """Against the azimuths of the ellipsoid's geodesics: no tangent plane is in them."""
    here, next_ = slice(0, -20), slice(20, None)
    track, _, distance = Geod(ellps="WGS84").inv(
        truth.longitude_deg[here], truth.latitude_deg[here], truth.longitude_deg[next_], truth.latitude_deg[next_]
    )  # fmt: skip
    middle = truth.velocity_ned_mps[10:-10]
    course = np.degrees(np.arctan2(middle[:, 1], middle[:, 0]))
    off = (course - track + 180.0) % 360.0 - 180.0
    assert np.abs(off).max() < 0.05
    assert abs(off.mean()) < 5e-4  # the convergence at 400 m from the origin is 3e-3°
    # At the height of the campus a metre on the ellipsoid is 5e-5 longer; chords of bends are shorter.
    np.testing.assert_allclose(np.hypot(*middle[:, :2].T) * 0.1, distance, rtol=3e-4, atol=2e-4)
    slip = (truth.attitude_deg[10:-10, 2] - track + 180.0) % 360.0 - 180.0
    assert np.abs(slip).max() < 0.05
    assert (truth.attitude_deg[:, 2] >= 0.0).all()
    assert (truth.attitude_deg[:, 2] < 360.0).all()


def test_attitude_rates_and_accelerations_are_those_of_a_body_with_z_down(
    drive: VehicleDrive, truth: InsLog
) -> None:
    state = drive.motion.at(truth.stamps_ns)
    _, pitch, roll = Rotation.from_matrix(state.T_map_body[:, :3, :3]).as_euler("ZYX", degrees=True).T
    # Roll is about the same axis, pitch and yaw about the opposite ones.
    np.testing.assert_allclose(truth.attitude_deg[:, 0], roll, atol=0.01)
    np.testing.assert_allclose(truth.attitude_deg[:, 1], -pitch, atol=0.01)
    heading = np.unwrap(np.radians(truth.attitude_deg[:, 2]))
    turning = np.degrees(np.gradient(heading, 0.005))
    np.testing.assert_allclose(truth.rates_degps[5:-5, 2], turning[5:-5], atol=0.2)
    assert truth.rates_degps[:, 2].std() > 1.0
    gained = np.gradient(np.hypot(*truth.velocity_ned_mps[:, :2].T), 0.005)
    np.testing.assert_allclose(truth.accelerations_mps2[5:-5, 0], gained[5:-5], atol=0.05)
    turn = np.radians(truth.rates_degps[:, 2]) * np.hypot(*truth.velocity_ned_mps[:, :2].T)
    np.testing.assert_allclose(truth.accelerations_mps2[:, 1], turn, atol=0.05)


def test_errors_are_as_large_as_the_rms_says_and_change_slowly(drive: VehicleDrive, truth: InsLog) -> None:
    position, attitude, velocity = [], [], []
    for seed in range(40):
        ins = simulate_ins(drive, ORIGIN, seed=seed)
        enu = enu_from_geodetic(ins.latitude_deg, ins.longitude_deg, ins.height_m, ORIGIN)
        error = (enu - drive.motion.at(ins.stamps_ns).T_map_body[:, :3, 3])[:, [1, 0, 2]] * [1, 1, -1]
        assert np.abs(np.diff(error, axis=0)).max() < 0.005
        position.append((error / ins.position_rms_m)[::2000])
        turned = (ins.attitude_deg - truth.attitude_deg + 180.0) % 360.0 - 180.0
        attitude.append((turned / ins.attitude_rms_deg)[::2000])
        velocity.append(((ins.velocity_ned_mps - truth.velocity_ned_mps) / ins.velocity_rms_mps)[::2000])
        assert 0.005 < np.median(ins.position_rms_m[:, 0]) < 0.04  # RTK
    for errors in (position, attitude, velocity):
        np.testing.assert_allclose(np.sqrt((np.concatenate(errors) ** 2).mean(axis=0)), 1.0, atol=0.25)


def test_half_the_noise_is_half_the_error_and_half_the_rms(drive: VehicleDrive, truth: InsLog) -> None:
    whole, half = (simulate_ins(drive, ORIGIN, seed=2, noise=noise) for noise in (1.0, 0.5))
    np.testing.assert_allclose(half.position_rms_m, whole.position_rms_m / 2)
    np.testing.assert_allclose(
        half.height_m - truth.height_m, (whole.height_m - truth.height_m) / 2, atol=1e-6
    )
    assert np.array_equal(whole.latitude_deg, simulate_ins(drive, ORIGIN, seed=2).latitude_deg)


def test_lower_rates_keep_whole_steps(truth: InsLog) -> None:
    slow = truth.at_rate(50)
    assert (np.diff(slow.stamps_ns) == 20_000_000).all()
    assert (slow.stamps_ns % 20_000_000 == 0).all()
    assert len(slow.attitude_deg) == len(slow)
    with pytest.raises(InputError, match="60 Hz"):
        truth.at_rate(60)


def test_the_gps_is_as_rough_as_it_says(drive: VehicleDrive) -> None:
    white = [simulate_gps(drive, sigma_m=3.0, seed=seed) for seed in range(5)]
    errors = np.concatenate([gps.positions_m - drive.T_map_body[:, :2, 3] for gps in white])
    assert white[0].variance_m2 == 9.0
    assert errors.std() == pytest.approx(3.0, rel=0.05)
    assert abs(np.mean(errors[1:] * errors[:-1])) < 0.5
    lasting = simulate_gps(drive, sigma_m=3.0, seed=0, correlation_s=20.0)
    errors = lasting.positions_m - drive.T_map_body[:, :2, 3]
    assert np.abs(np.diff(errors, axis=0)).std() < 0.5
    with pytest.raises(InputError):
        simulate_gps(drive, sigma_m=0.0, seed=0)
