"""Pictures of a simulated drive in a folder, a video and bags: ingested, they are the drive log written directly."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scpf.ingest import applanix
from scpf.ingest.calibration import to_yaml
from scpf.ingest.drive_log import DriveLog, DriveLogWriter
from scpf.models.camera import R_BODY_OPTICAL, Camera
from scpf.models.errors import InputError
from scpf.models.geodesy import Origin
from scpf.replay.cli import run
from scpf.sample_logs.bags_out import write_ros1_bag, write_rosbag2
from scpf.sample_logs.encode_gsof import gsof
from scpf.sample_logs.encode_sbet import sbet
from scpf.sample_logs.finished_frames import encode_jpeg
from scpf.sample_logs.raw_camera import RecordedPicture, write_basler_folder, write_mp4
from scpf.sample_logs.raw_logs import write_raw_logs
from scpf.sample_logs.rectify import Rectifier
from scpf.sample_logs.ring_road import PATH, default_centre_line, default_road_map
from scpf.sample_logs.sensors import InsLog, simulate_ins
from scpf.sample_logs.vehicle import VehicleDrive, simulate_vehicle

ORIGIN = default_road_map().origin or Origin(0.0, 0.0, 0.0)
MOUNTED = np.eye(4)
MOUNTED[:3, :3] = Rotation.from_euler("y", 2.6, degrees=True).as_matrix() @ R_BODY_OPTICAL
MOUNTED[:3, 3] = 1.9, 0.0, 2.3
CAMERA = Camera(
    64, 48, np.array([[46.0, 0.0, 31.5], [0.0, 46.1, 23.0], [0.0, 0.0, 1.0]]), T_body_camera=MOUNTED
)


@pytest.fixture(scope="module")
def drive() -> VehicleDrive:
    """Some frames of it are lost."""
    drive = simulate_vehicle(default_centre_line(), start_m=400.0, duration_s=4.0, seed=7, dropped_share=0.15)
    assert len(drive.dropped_numbers) >= 2
    return drive


@pytest.fixture(scope="module")
def ins(drive: VehicleDrive) -> InsLog:
    return simulate_ins(drive, ORIGIN, seed=1, noise=0.0)


@pytest.fixture(scope="module")
def pictures(drive: VehicleDrive) -> list[RecordedPicture]:
    rng = np.random.default_rng(0)
    found = []
    for stamp, number in zip(drive.stamps_ns, drive.frame_numbers, strict=True):
        image = rng.integers(0, 256, (48, 64, 3), dtype=np.uint8)
        found.append(RecordedPicture(int(stamp), int(number), encode_jpeg(image, 85)))
    return found


@pytest.fixture(scope="module")
def direct(
    tmp_path_factory: pytest.TempPathFactory, drive: VehicleDrive, pictures: list[RecordedPicture]
) -> Path:
    """The drive log that the simulator writes itself."""
    path = tmp_path_factory.mktemp("direct") / "drive.mcap"
    with DriveLogWriter(path, origin=ORIGIN) as log:
        log.write_camera(pictures[0].stamp_ns, CAMERA)
        for picture, pose in zip(pictures, drive.T_map_body, strict=True):
            log.write_pose(picture.stamp_ns, pose)
            log.write_image(picture.stamp_ns, picture.jpeg, "jpeg")
    return path


def assert_same_log(path: Path, direct: Path, metres: float = 2e-4, degrees: float = 0.05) -> None:
    """The same pictures at the same times, seen by the same camera, from the same places.

    Poses between those of the INS are interpolated: at 50 Hz, by less than ``metres`` and ``degrees``.
    """
    with DriveLog(path) as found, DriveLog(direct) as expected:
        images = [(image.stamp_ns, bytes(image.data), image.format) for image in found.images()]
        assert images == [(image.stamp_ns, bytes(image.data), image.format) for image in expected.images()]
        camera, true_camera = found.camera(), expected.camera()
        assert camera is not None
        assert true_camera is not None
        np.testing.assert_allclose(camera.matrix, true_camera.matrix)
        np.testing.assert_allclose(camera.T_body_camera, true_camera.T_body_camera, atol=1e-9)
        assert not camera.distortion.any()
        assert found.origin() == expected.origin()
        trajectory, truth = found.trajectory(), expected.trajectory()
        assert trajectory is not None
        assert truth is not None
        for stamp, there in zip(truth.stamps_ns, truth.poses(), strict=True):
            pose = trajectory.at(int(stamp))
            assert pose is not None
            assert np.linalg.norm(pose[:3, 3] - there[:3, 3]) < metres
            turned = Rotation.from_matrix(there[:3, :3].T @ pose[:3, :3]).magnitude()
            assert np.degrees(turned) < degrees


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """A folder with the calibration, which says where the camera sits, too."""
    (tmp_path / "camera.yaml").write_bytes(to_yaml(CAMERA))
    return tmp_path


def ingest(files: Path, source: str, times: str, trajectory: str, *more: str) -> Path:
    log = files / "ingested.mcap"
    given = ["--calibration", "camera.yaml", "--trajectory", trajectory]
    given += ["--timestamps", times]
    arguments = [word if word.startswith("-") else str(files / word) for word in given]
    command = ["ingest", str(files / source), "-o", str(log), *arguments, "--map", str(PATH), "-q", *more]
    assert run(command) == 0
    return log


def test_a_basler_folder_and_an_sbet_give_the_drive(
    files: Path, ins: InsLog, pictures: list[RecordedPicture], direct: Path
) -> None:
    assert write_basler_folder(files / "basler", files / "times.csv", pictures) == len(pictures)
    (files / "sbet.out").write_bytes(sbet(ins))
    names = {file.name for file in (files / "basler").iterdir()}
    assert f"Basler_acA2040-55uc__23734412__20220818_183353703_{pictures[-1].number}.jpg" in names
    assert "Basler_acA2040-55uc__23734412__20220818_183353703_1.jpg" in names
    log = ingest(files, "basler", "times.csv", "sbet.out", "--gps-date", "2022-08-18")
    assert_same_log(log, direct)


def test_the_names_alone_say_which_frames_are_missing(
    files: Path, drive: VehicleDrive, pictures: list[RecordedPicture], capsys: pytest.CaptureFixture[str]
) -> None:
    write_basler_folder(files / "basler", files / "times.csv", pictures)
    log = files / "a.mcap"
    command = ["ingest", str(files / "basler"), "-o", str(log), "--calibration", str(files / "camera.yaml")]
    assert run([*command, "--rate", "13", "--start-time", "name", "-q", "--format", "json"]) == 0
    assert f'"frames_missing": {len(drive.dropped_numbers)}' in capsys.readouterr().out
    with DriveLog(log) as opened:
        stamps = np.array([image.stamp_ns for image in opened.images()])
    # The camera's jitter, and the millisecond to which the name is cut.
    assert np.abs(stamps - drive.stamps_ns).max() < 3e6


def test_a_video_and_gsof_give_the_drive(
    files: Path, ins: InsLog, pictures: list[RecordedPicture], direct: Path
) -> None:
    pytest.importorskip("av")
    assert write_mp4(files / "drive.mp4", files / "times.csv", pictures) == len(pictures)
    (files / "lvx.gsof").write_bytes(gsof(ins))
    assert_same_log(ingest(files, "drive.mp4", "times.csv", "lvx.gsof"), direct)


def test_bags_give_the_drive(
    tmp_path: Path, ins: InsLog, pictures: list[RecordedPicture], direct: Path
) -> None:
    write_ros1_bag(tmp_path / "drive.bag", ins, iter(pictures), CAMERA)
    write_rosbag2(tmp_path / "drive", ins, iter(pictures), CAMERA)
    for name in ("drive.bag", "drive"):
        log = tmp_path / f"{name}.mcap"
        command = ["convert", str(tmp_path / name), "-o", str(log), "--map", str(PATH), "--verify", "-q"]
        assert run(command) == 0
        assert_same_log(log, direct)
        with DriveLog(log) as opened:
            assert opened.metadata()["scpf_conversion"]["mapping"] == "watonobus"
            fix = next(opened.messages(["/ins/fix"])).message
            east, north = ins.position_rms_m[0, [1, 0]]
            assert fix.position_covariance[[0, 4]] == pytest.approx([east**2, north**2], rel=1e-3)


def test_one_seed_is_one_set_of_bytes(tmp_path: Path, ins: InsLog, pictures: list[RecordedPicture]) -> None:
    again = simulate_ins(
        simulate_vehicle(default_centre_line(), start_m=400.0, duration_s=4.0, seed=7, dropped_share=0.15),
        ORIGIN,
        seed=1,
        noise=0.0,
    )
    for name, log in (("a", ins), ("b", again)):
        write_raw_logs(tmp_path / name, log)
        write_ros1_bag(tmp_path / name / "drive.bag", log, pictures, CAMERA)
    files = sorted(path.name for path in (tmp_path / "a").iterdir())
    assert files == ["drive.bag", "ins.nmea", "lvx.gsof", "poslv.pcap", "sbet.out", "smrmsg.out"]
    for name in files:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    with pytest.raises(InputError, match="exists"):
        write_raw_logs(tmp_path / "a", ins)
    recognised = {
        name: applanix.recognise(tmp_path / "a" / name).name for name in files if name != "drive.bag"
    }
    assert list(recognised.values()) == ["nmea", "gsof", "grp", "sbet", "smrmsg"]


def test_rectified_pictures_show_points_where_a_camera_without_distortion_sees_them() -> None:
    """A bright spot drawn through the lens lies, rectified, where OpenCV's pinhole has it."""
    lens = Camera(
        640, 480, np.array([[458.0, 0, 323], [0, 458.3, 236], [0, 0, 1.0]]), np.array([-0.19, 0.055, 6e-4, -4e-4, 0])
    )  # fmt: skip
    rectifier = Rectifier(lens)
    points = np.array([[x, y, 10.0] for x in (-4.0, 0.5, 4.5) for y in (-3.0, 0.3, 3.2)])
    image = np.zeros((480, 640, 3), dtype=np.uint8)
    for pixel in lens.project(points):
        centre = tuple(round(float(value) * 16) for value in pixel)
        cv2.circle(image, centre, 4 * 16, (255, 255, 255), -1, cv2.LINE_AA, 4)
    straight = cv2.imdecode(np.frombuffer(rectifier.jpeg(encode_jpeg(image, 95)), np.uint8), 0)
    moved = np.linalg.norm(lens.project(points) - rectifier.camera.project(points), axis=1)
    assert moved.max() > 10.0
    for x, y in rectifier.camera.project(points):
        column, row = round(float(x)), round(float(y))
        patch = straight[row - 9 : row + 10, column - 9 : column + 10].astype(float)
        rows, columns = np.mgrid[-9:10, -9:10]
        spot = [(columns * patch).sum() / patch.sum() + column, (rows * patch).sum() / patch.sum() + row]
        assert np.linalg.norm(np.array(spot) - [x, y]) < 0.3
    assert np.array_equal(rectifier.camera.T_body_camera, lens.T_body_camera)
    with pytest.raises(InputError, match="640×480"):
        rectifier.jpeg(b"no picture")


def test_what_would_mislead_is_refused(tmp_path: Path, ins: InsLog, pictures: list[RecordedPicture]) -> None:
    bent = Camera(64, 48, CAMERA.matrix, np.array([-0.2, 0.0, 0.0, 0.0, 0.0]))
    with pytest.raises(InputError, match="rectified"):
        write_ros1_bag(tmp_path / "a.bag", ins, pictures, bent)
    (tmp_path / "there").mkdir()
    with pytest.raises(InputError, match="exists"):
        write_rosbag2(tmp_path / "there", ins, pictures, CAMERA)
    with pytest.raises(InputError, match="exists"):
        write_basler_folder(tmp_path / "there", tmp_path / "times.csv", pictures)
    pytest.importorskip("av")
    large = RecordedPicture(2 * 10**18, 99, encode_jpeg(np.zeros((32, 32, 3), dtype=np.uint8), 85))
    with pytest.raises(InputError, match="another size"):
        write_mp4(tmp_path / "a.mp4", tmp_path / "times.csv", [*pictures[:2], large])
    with pytest.raises(InputError, match="no JPEG"):
        write_mp4(tmp_path / "b.mp4", tmp_path / "times.csv", [RecordedPicture(1, 1, b"\x89PNG")])
