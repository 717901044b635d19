"""``scpf simulate``: a drive log that replays, agrees with its own truth, and is the same whoever renders it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from scpf.ingest.doctor import examine
from scpf.ingest.drive_log import DriveLog
from scpf.ingest.maps import write_map
from scpf.ingest.messages import from_pose
from scpf.ingest.topics import SCPF_METADATA, TRUE_MAP_ATTACHMENT, TRUTH_POSE_TOPIC
from scpf.models.road_map import Landmark, RoadMap, from_geojson
from scpf.replay.cli import run
from scpf.sample_logs import simulation
from scpf.sample_logs.drive_frames import DriveSettings, SimulatedDrive
from scpf.sample_logs.ring_road import default_road_map
from scpf.sample_logs.simulated_road import simulated_road
from scpf.sample_logs.simulation import frames_folder, simulate_drive

GIVEN = {
    "--start-m": "300",
    "--duration": "2",
    "--seed": "3",
    "--weather": "cloudy",
    "--width": "128",
    "--map-error": "0.3",
    "--workers": "1",
}
FRAMES = 27


@pytest.fixture
def log(simulated: Path) -> Path:
    return simulated / "drive.mcap"


def simulate(path: Path, *more: str, **given: str) -> int:
    """Run the command with the options of ``GIVEN``, some of them changed."""
    options = GIVEN | {f"--{name.replace('_', '-')}": value for name, value in given.items()}
    return run(["simulate", "-o", str(path), *more, *(word for pair in options.items() for word in pair)])


def test_it_replays_with_small_errors_and_the_doctor_finds_nothing(log: Path, tmp_path: Path) -> None:
    assert not frames_folder(log).exists()
    assert examine(log, deep=True).findings == []
    command = [
        "replay",
        str(log),
        "-o",
        str(tmp_path),
        "--segmenter",
        "recorded",
        "--preset",
        "default",
        "-q",
    ]
    assert run(command) == 0
    summary = json.loads((tmp_path / "drive.json").read_text())
    assert summary["frames"] == FRAMES and summary["warnings"] == []
    detections = summary["detections"]
    assert detections["matched"] > 10 and detections["matched_wrong"] <= 0.05 * detections["matched"]
    errors = summary["errors"]
    assert errors["position"]["mean"] < min(0.9, 0.75 * errors["baseline_position"]["mean"])


def test_the_truth_agrees_with_the_pictures_and_the_reference_with_its_own_variance(log: Path) -> None:
    with DriveLog(log) as opened:
        camera, trajectory, mapped = opened.camera(), opened.trajectory(), opened.road_map()
        true = from_geojson(json.loads(opened.attachments()[TRUE_MAP_ATTACHMENT]))
        truth = {
            record.sensor_ns: from_pose(record.message.pose.position, record.message.pose.orientation)
            for record in opened.messages([TRUTH_POSE_TOPIC])
        }
        seen = {
            record.sensor_ns: record.message.instances for record in opened.messages(["/truth/instances"])
        }
        masks, gps = opened.instances(), opened.gps()
        odometry = [record.message for record in opened.messages(["/ins/odometry"])]
    assert camera is not None and trajectory is not None and mapped is not None and gps is not None
    assert list(masks) == list(truth) == list(seen) == gps[0].tolist()
    shown = 0
    for stamp_ns, T_map_body in truth.items():
        T_camera_map = np.linalg.inv(T_map_body @ camera.T_body_camera)
        for instance, message in zip(masks[stamp_ns], seen[stamp_ns], strict=True):
            pole = true.landmark(instance.landmark_id)
            assert pole is not None
            distance_m = np.hypot(*(np.array(pole.position_m[:2]) - T_map_body[:2, 3]))
            assert message.distance_m == pytest.approx(distance_m, abs=0.01)
            assert 0.0 < message.visible_fraction <= 1.0
            up = np.array(pole.position_m) + np.linspace(0.5, 7.0, 20)[:, None] * [0, 0, 1]
            axis_px = camera.project(up @ T_camera_map[:3, :3].T + T_camera_map[:3, 3])
            rows = axis_px[:, 1]
            x1, y1, x2, y2 = instance.box_px
            on_axis = (rows > y1) & (rows < y2)
            leans_px = 1.5 + 0.025 * 7.0 * camera.matrix[0, 0] / distance_m
            assert np.all((axis_px[on_axis, 0] > x1 - leans_px) & (axis_px[on_axis, 0] < x2 + leans_px))
            shown += int(on_axis.any())
    assert shown > 25
    errors = [trajectory.at(stamp)[:3, 3] - pose[:3, 3] for stamp, pose in truth.items()]  # type: ignore[index]
    rms_m = np.sqrt(np.array(odometry[0].pose.covariance).reshape(6, 6).diagonal()[:3])
    assert np.all((rms_m > 0.003) & (rms_m < 0.1))
    assert np.all(np.abs(errors) < 4.5 * rms_m) and np.abs(errors).max() > 1e-4
    rough = gps[1] - [pose[:2, 3] for pose in truth.values()]
    assert 2.0 < rough.std() < 4.0 and np.all(gps[2] == 9.0)
    off_m = np.hypot(*(mapped.positions_m - true.positions_m).T)
    assert np.all((off_m > 0.199) & (off_m < 0.401))
    assert mapped.landmarks[0].variance_m2 == pytest.approx(np.mean(off_m**2) / 2, rel=0.15)
    assert true.landmarks[0].variance_m2 == 0.0
    assert "OpenStreetMap" in mapped.attribution


class Teller:
    """Takes reports, and interrupts the first run where so many frames are done."""

    def __init__(self, stop_after: int) -> None:
        self.stop_after = stop_after

    def say(self, line: str) -> None:
        assert "compiling" in line

    def frame(self, done: int, resumed: int, count: int) -> None:
        if done == self.stop_after > resumed:
            raise KeyboardInterrupt


def test_workers_and_interruptions_change_no_byte(log: Path, tmp_path: Path) -> None:
    with DriveLog(log) as opened:
        settings = DriveSettings(**json.loads(opened.metadata()[SCPF_METADATA]["settings"]))
    path = tmp_path / "again.mcap"
    with pytest.raises(KeyboardInterrupt):
        simulate_drive(path, settings, Teller(9))
    assert not path.exists() and len(list(frames_folder(path).glob("*.jpg"))) == 9
    report = simulate_drive(path, settings, Teller(9), workers=2)
    assert (report.frames, report.rendered) == (FRAMES, FRAMES - 9)
    assert path.read_bytes() == log.read_bytes()


def test_an_interrupt_says_that_the_frames_are_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*given: object, **more: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(simulation, "render_all", interrupted)
    monkeypatch.setattr(simulation, "warm_up", lambda say: None)
    assert simulate(tmp_path / "a.mcap") == 130
    assert "a.frames: the same command goes on" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "value", "code", "said"),
    [
        ("weather", "hail", 2, "hail"),
        ("width", "1001", 2, "1001"),
        ("quality", "0", 2, "quality"),
        ("workers", "0", 2, "workers"),
        ("seed", "-1", 2, "seed"),
        ("map_error", "-1", 1, "map error"),
        ("gps_sigma", "0", 1, "GPS"),
        ("duration", "0.1", 1, "0.1 s"),
        ("duration", "nan", 2, "finite"),
        ("stop_at_m", "10", 1, "stop"),
        ("rate", "0", 2, "pictures a second"),
        ("map", "no.geojson", 1, "no.geojson"),
    ],
)
def test_what_makes_no_drive_is_refused_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, value: str, code: int, said: str
) -> None:
    assert simulate(tmp_path / "a.mcap", **{name: value}) == code
    captured = capsys.readouterr()
    assert captured.out == "" and said in captured.err
    assert captured.err.startswith("scpf: ") and len(captured.err.splitlines()) <= 2
    assert not any(tmp_path.iterdir())


def test_an_existing_log_and_a_missing_folder_are_refused(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = log.read_bytes()
    assert simulate(log) == 1
    assert "--overwrite" in capsys.readouterr().err
    assert log.read_bytes() == before
    assert simulate(tmp_path / "none" / "a.mcap") == 1
    assert "no folder" in capsys.readouterr().err


def test_a_map_s_own_poles_and_ids_are_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = np.array([[0.0, 0.0], [120.0, 0.0], [240.0, 30.0]])
    marks = (Landmark("lamp a", (60.0, 6.0, 0.0)), Landmark("sign", (70.0, -6.0, 0.0), "traffic_sign"))
    street = RoadMap(marks, line, 3.5, attribution="a village")
    road = simulated_road(street, seed=1, map_error_m=0.6)
    assert list(road.names.values()) == ["lamp a"]
    assert road.mapped().positions_m.tolist() == [[60.0, 6.0]]
    assert road.mapped().attribution == "a village"
    assert 0.39 < np.hypot(*(road.true().positions_m - road.mapped().positions_m)[0]) < 0.81
    ring = simulated_road(None, seed=1)
    off_m = np.hypot(*(ring.mapped().positions_m - ring.true().positions_m).T)
    assert np.all((off_m > 0.99) & (off_m < 2.01)) and len(off_m) == 99
    bare = simulated_road(RoadMap((), line), seed=1)
    assert len(bare.poles) == round(bare.centre_line.length_m / 26.6)

    drive = SimulatedDrive(DriveSettings(35.0, 1.0, width_px=128, weather="overcast"), street)
    assert [pole.instance.landmark_id for pole in drive()(0).poles] == ["lamp a"]
    assert drive.road.true().origin == default_road_map().origin  # a map in metres is laid there
    write_map(tmp_path / "street.geojson", street)
    assert simulate(tmp_path / "a.mcap", map=str(tmp_path / "street.geojson"), start_m="235") == 1
    assert "long enough" in capsys.readouterr().err


def test_one_world_may_be_driven_through_several_times() -> None:
    first = SimulatedDrive(DriveSettings(seed=1, world_seed=7))
    second = SimulatedDrive(DriveSettings(seed=2, world_seed=7))
    places = [drive.road.mapped().positions_m for drive in (first, second)]
    assert np.array_equal(*places)
    assert not np.array_equal(first.vehicle.T_map_body[5], second.vehicle.T_map_body[5])
    other = SimulatedDrive(DriveSettings(seed=1))
    assert not np.array_equal(other.road.mapped().positions_m, places[0])
    assert {SimulatedDrive(DriveSettings(seed=seed)).weather.name for seed in range(20)} >= {"rain", "dusk"}
