"""The simulated bus: the road that it drives by default, and how it moves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scpf.ingest.maps import encode_map, read_map
from scpf.models.errors import InputError, MissingError
from scpf.models.road_map import RoadMap
from scpf.replay.cli import run
from scpf.sample_logs.centre_line import CentreLine
from scpf.sample_logs.ring_road import PATH, centre_line_of, default_centre_line, default_road_map
from scpf.sample_logs.vehicle import VehicleDrive, simulate_vehicle


def test_the_ring_road_is_what_the_map_command_makes_of_openstreetmap(
    shared_data: Path, tmp_path: Path
) -> None:
    made = tmp_path / "ring.geojson"
    source = str(shared_data / "waterloo" / "uw.osm")
    origin = ["43.4729699", "-80.548017", "300"]
    done = run(["map", "from", source, "-o", str(made), "--road", "Ring Road", "--origin", *origin])
    assert done == 3  # two lanes lead off the ring, and are left out
    assert made.read_bytes() == PATH.read_bytes()


def test_the_ring_road_names_its_source_and_is_a_ring_of_its_length() -> None:
    road_map, line = default_road_map(), default_centre_line()
    assert road_map.attribution == "© OpenStreetMap contributors, ODbL 1.0"
    assert encode_map(read_map(PATH)) == PATH.read_bytes()
    assert line.closed
    # Chords cut no more than 0.1 %: 2,632 m are the polygon's.
    assert line.length_m == pytest.approx(2632.0, rel=1.5e-3)
    assert np.max(line.distance_m(road_map.centre_line_m)) < 1.0
    assert 1 / np.max(np.abs(line.curvature_per_m(np.arange(0, line.length_m)))) > 30.0


def test_an_open_road_stays_open_and_a_map_without_a_road_is_refused() -> None:
    points = np.column_stack([np.linspace(0.0, 200.0, 9), np.zeros(9)])
    assert not centre_line_of(RoadMap((), points)).closed
    with pytest.raises(MissingError, match="no centre line"):
        centre_line_of(RoadMap((), np.zeros((0, 2))))


@pytest.fixture(scope="module")
def drive() -> VehicleDrive:
    """The paper's 1.2 km, with a stop."""
    return simulate_vehicle(default_centre_line(), start_m=300.0, length_m=1200.0, stop_at_m=900.0, seed=3)


def test_the_bus_keeps_its_limits_slows_in_bends_and_stops(drive: VehicleDrive) -> None:
    step_s = 0.01
    stamps = drive.motion.start_ns + np.arange(0, int(drive.motion.duration_s * 1e9), int(step_s * 1e9))
    state = drive.motion.at(stamps)
    assert 11.0 < state.speed_mps.max() <= 12.0
    curvature = np.abs(default_centre_line().curvature_per_m(state.s_m))
    bends = curvature > np.quantile(curvature, 0.95)
    assert state.speed_mps[bends].mean() < 0.85 * np.median(state.speed_mps)
    assert np.abs(state.speed_mps * state.yaw_rate_radps).max() < 1.4
    assert np.abs(np.diff(state.speed_mps)).max() / step_s < 1.3
    standing = state.speed_mps < 1e-3
    assert standing.sum() * step_s > 2.0
    np.testing.assert_allclose(state.s_m[standing], 900.0, atol=0.5)
    np.testing.assert_allclose(state.s_m[[0, -1]], [300.0, 1500.0], atol=0.2)


def test_the_bus_stays_in_its_lane_and_wanders(drive: VehicleDrive) -> None:
    _, offset = default_centre_line().project(drive.T_map_body[:, :2, 3])
    # The lane is 3.7 m wide, the bus 2.6 m.
    assert (np.abs(offset + 1.85) < 0.55).all()
    assert 0.05 < offset.std() < 0.3
    assert np.abs(np.diff(offset)).max() < 0.1


def test_stamps_increase_with_jitter_and_lost_frames(drive: VehicleDrive) -> None:
    numbers, lost = drive.frame_numbers, drive.dropped_numbers
    assert sorted([*numbers, *lost]) == list(range(1, numbers[-1] + 1))
    assert 0 < len(lost) < 0.02 * len(numbers)
    assert (np.diff(drive.stamps_ns) > 0).all()
    late_ns = drive.stamps_ns - drive.stamps_ns[0] - (numbers - 1) * 1e9 / 13
    assert 0.2e6 < late_ns.std() < 0.4e6
    assert np.abs(late_ns).max() <= 2e6


def test_velocities_and_rates_are_those_of_the_poses(drive: VehicleDrive) -> None:
    stamps = drive.motion.start_ns + np.arange(0, 60 * 10**9, 10**6 * 5)
    state = drive.motion.at(stamps)
    position, rotation = state.T_map_body[:, :3, 3], Rotation.from_matrix(state.T_map_body[:, :3, :3])
    assert np.abs(np.diff(position, axis=0)).max() < 12.0 * 0.005  # no leap
    between = 0.5 * (state.velocity_map_mps[1:] + state.velocity_map_mps[:-1])
    np.testing.assert_allclose(np.diff(position, axis=0) / 0.005, between, atol=1e-3)
    turned = (rotation[:-1].inv() * rotation[1:]).as_rotvec() / 0.005
    np.testing.assert_allclose(
        turned, 0.5 * (state.rates_body_radps[1:] + state.rates_body_radps[:-1]), atol=1e-3
    )
    gained = np.diff(state.velocity_map_mps, axis=0) / 0.005
    np.testing.assert_allclose(
        gained, 0.5 * (state.acceleration_map_mps2[1:] + state.acceleration_map_mps2[:-1]), atol=5e-3
    )
    # The body looks where it drives.
    moving = state.speed_mps > 1.0
    ahead = np.einsum("ni,ni->n", state.T_map_body[:, :3, 0], state.velocity_map_mps)
    np.testing.assert_allclose(ahead[moving], state.speed_mps[moving], rtol=1e-3)


def test_braking_lowers_the_front_and_a_left_bend_lifts_the_left_side() -> None:
    angle = np.linspace(0.0, np.pi, 60)
    bend = 60.0 * np.column_stack([np.sin(angle), 1 - np.cos(angle)])
    line = CentreLine(np.vstack([[-150.0, 0.0], bend, [-150.0, 120.0]]))
    drive = simulate_vehicle(line, start_m=5.0, length_m=line.length_m - 10.0, stop_at_m=110.0, seed=1)
    state = drive.frames
    yaw_pitch_roll = Rotation.from_matrix(state.T_map_body[:, :3, :3]).as_euler("ZYX")
    forward = np.einsum("ni,ni->n", state.T_map_body[:, :3, 0], state.acceleration_map_mps2)
    assert yaw_pitch_roll[forward < -0.8, 1].mean() > np.radians(0.1)
    assert yaw_pitch_roll[forward > 0.7, 1].mean() < -np.radians(0.1)
    left = state.speed_mps * state.yaw_rate_radps > 0.8
    assert left.sum() > 20
    assert yaw_pitch_roll[left, 2].mean() > np.radians(0.2)


def test_one_seed_is_one_drive_and_a_closed_road_takes_any_length(drive: VehicleDrive) -> None:
    line = default_centre_line()
    again = simulate_vehicle(line, start_m=300.0, length_m=1200.0, stop_at_m=900.0, seed=3)
    assert np.array_equal(again.T_map_body, drive.T_map_body)
    assert np.array_equal(again.stamps_ns, drive.stamps_ns)
    other = simulate_vehicle(line, start_m=300.0, length_m=1200.0, stop_at_m=900.0, seed=4)
    assert not np.array_equal(other.T_map_body[0], drive.T_map_body[0])
    laps = simulate_vehicle(line, start_m=2000.0, duration_s=400.0)
    assert laps.frames.s_m[-1] > line.length_m + 2000.0
    assert laps.stamps_ns[-1] - laps.stamps_ns[0] == pytest.approx(400e9, abs=1e9)


@pytest.mark.parametrize(
    "wrong",
    [
        {},
        {"length_m": 50.0, "duration_s": 5.0},
        {"length_m": -3.0},
        {"length_m": 500.0},
        {"duration_s": 60.0},
        {"duration_s": 0.2},
        {"start_m": 190.0, "length_m": 20.0},
        {"length_m": 100.0, "stop_at_m": 150.0},
        {"length_m": float("nan")},
    ],
)
def test_what_is_no_drive_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError):
        simulate_vehicle(CentreLine([[0.0, 0.0], [100.0, 0.0], [200.0, 0.0]]), **wrong)  # type: ignore[arg-type]


def test_a_moment_outside_the_drive_is_refused(drive: VehicleDrive) -> None:
    with pytest.raises(InputError, match="outside"):
        drive.motion.at(np.array([drive.motion.start_ns - 60 * 10**9]))


def test_a_slower_camera_sees_the_same_drive() -> None:
    fast, slow = (
        simulate_vehicle(
            default_centre_line(), start_m=300.0, duration_s=20.0, rate_hz=rate, dropped_share=0.0
        )
        for rate in (13.0, 2.0)
    )
    assert len(slow) == 41
    intervals_s = np.diff(slow.stamps_ns) * 1e-9
    assert np.abs(intervals_s - 0.5).max() < 0.0021
    np.testing.assert_allclose(slow.frames.s_m[-1], fast.frames.s_m[-1], atol=0.03)
    assert slow.frame_numbers.tolist() == list(range(1, 42))
