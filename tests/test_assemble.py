"""Images, times, trajectory, calibration and map: one drive log, and a report that leaves nothing out."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scpf.ingest.assemble import assemble, sha256
from scpf.ingest.drive_log import CALIBRATION_ATTACHMENT, DriveLog
from scpf.ingest.images import list_images
from scpf.ingest.reference import PoseReference
from scpf.models.camera import Camera
from scpf.models.errors import InputError
from scpf.models.geodesy import Origin
from scpf.models.road_map import Landmark, RoadMap
from scpf.models.trajectory import Trajectory
from scpf.replay import ingest_commands, map_commands

T0 = 1_660_847_613_000_000_000
CAMERA = Camera(32, 24, np.array([[30.0, 0, 16], [0, 30, 12], [0, 0, 1]]))


def stamps_at_rate(count: int, rate_hz: float, start_ns: int) -> np.ndarray:
    return start_ns + np.round(np.arange(count) * (1e9 / rate_hz)).astype(np.int64)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "images"
    folder.mkdir()
    for k in range(20):
        Image.effect_noise((32, 24), 30 + k).save(folder / f"{k}.png")
    return folder


def a_drive(start_ns: int = T0, count: int = 30) -> Trajectory:
    positions = np.column_stack([np.arange(count, dtype=float), np.zeros(count), np.zeros(count)])
    return Trajectory(start_ns + np.arange(count) * 10**8, positions, np.tile([0.0, 0, 0, 1], (count, 1)))


def test_a_whole_drive(tmp_path: Path, folder: Path) -> None:
    images = list_images(folder)
    stamps = stamps_at_rate(20, 10.0, T0)
    stamps[12:] += 300_000_000
    mark, line = Landmark("p", (5.0, 2.0, 0.0)), a_drive().positions_m[:, :2]
    road = RoadMap((mark,), line, origin=Origin(43.0, -80.0, 300.0))
    output = tmp_path / "drive.mcap"
    report = assemble(
        output, images, stamps, CAMERA,
        reference=PoseReference(a_drive(), 0.01), road_map=road, sources=[folder, images[0].path],
    )  # fmt: skip
    assert report.lossless
    assert (report.frames, report.poses, report.landmarks, report.frames_without_pose) == (20, 30, 1, 0)
    assert report.gaps == [(pytest.approx(1.1), pytest.approx(0.4))]
    assert report.duration_s == pytest.approx(2.2)
    assert report.overlap_s == pytest.approx(2.2)
    with DriveLog(output) as log:
        for shown, image, stamp in zip(log.images(), images, stamps, strict=True):
            assert (bytes(shown.data), shown.format, shown.stamp_ns) == (
                image.path.read_bytes(),
                "png",
                stamp,
            )
        trajectory, road_map = log.trajectory(), log.road_map()
        assert trajectory is not None and road_map is not None
        np.testing.assert_allclose(trajectory.positions_m, a_drive().positions_m)
        assert road_map.landmarks[0].id == "p"
        assert log.origin() == Origin(43.0, -80.0, 300.0)
        assert CALIBRATION_ATTACHMENT in log.attachments()
        metadata = log.metadata()["scpf"]
        made_from = json.loads(metadata["made_from"])
        assert made_from["0.png"] == hashlib.sha256(images[0].path.read_bytes()).hexdigest()
        assert made_from["images"] == sha256(folder)
        assert json.loads(metadata["dropped"]) == {}


def test_an_image_that_vanished_is_counted(tmp_path: Path, folder: Path) -> None:
    images = list_images(folder)
    images[3].path.unlink()
    report = assemble(tmp_path / "a.mcap", images, stamps_at_rate(20, 10.0, T0), CAMERA)
    assert not report.lossless
    assert report.dropped == {"image that could not be read": 1}
    assert "3.png" in report.notes[0]
    assert (report.frames, report.frames_without_pose) == (19, 19)


def test_repeated_frames_are_counted_and_left_out_if_asked(tmp_path: Path, folder: Path) -> None:
    for k in (8, 9, 15):
        (folder / f"{k}.png").write_bytes((folder / f"{k - 1}.png").read_bytes())
    stamps = stamps_at_rate(20, 10.0, T0)
    report = assemble(tmp_path / "a.mcap", list_images(folder), stamps, CAMERA)
    assert (report.frames, report.duplicates, report.duplicates_left_out, report.lossless) == (20, 3, 0, True)
    assert report.duplicates_at_s == pytest.approx([0.8, 0.9, 1.5])
    report = assemble(tmp_path / "b.mcap", list_images(folder), stamps, CAMERA, drop_duplicates=True)
    assert (report.frames, report.duplicates, report.duplicates_left_out) == (17, 3, 3)
    assert [gap[1] for gap in report.gaps] == pytest.approx([0.3, 0.2])


def test_a_part_of_the_drive(tmp_path: Path, folder: Path) -> None:
    stamps = stamps_at_rate(20, 1.0, T0)
    trajectory = a_drive(count=200)
    report = assemble(
        tmp_path / "a.mcap",
        list_images(folder),
        stamps,
        CAMERA,
        reference=PoseReference(trajectory),
        start_s=5.0,
        end_s=8.0,
    )
    assert (report.frames, report.poses_left_out, report.lossless) == (4, 200 - 51, True)
    with pytest.raises(InputError, match="no image lies between"):
        assemble(tmp_path / "b.mcap", list_images(folder), stamps, CAMERA, start_s=50.0)


def test_clocks_that_differ_are_an_error(tmp_path: Path, folder: Path) -> None:
    stamps = stamps_at_rate(20, 10.0, T0)
    with pytest.raises(InputError, match=r"share no time: the trajectory begins \+18\.000 s"):
        assemble(
            tmp_path / "a.mcap",
            list_images(folder),
            stamps,
            CAMERA,
            reference=PoseReference(a_drive(T0 + 18 * 10**9)),
        )
    assert not (tmp_path / "a.mcap").exists()


def test_a_calibration_of_other_images_is_an_error(tmp_path: Path, folder: Path) -> None:
    camera = Camera(64, 48, CAMERA.matrix)
    with pytest.raises(InputError, match="32×24 px, the calibration is for 64×48"):
        assemble(tmp_path / "a.mcap", list_images(folder), stamps_at_rate(20, 10.0, T0), camera)


def test_the_command_on_kitti_06(
    tmp_path: Path, shared_data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data, output = shared_data / "kitti_06", tmp_path / "kitti.mcap"
    code = ingest_commands.ingest(
        data / "image_l", output=output, calibration=data / "calib.txt", rate=10.0,
        trajectory=data / "poses.txt", format="json",
    )  # fmt: skip
    assert code == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["frames"], report["poses"], report["dropped"]) == (51, 51, {})
    code = map_commands.map_from(
        data / "poles.npz", output=tmp_path / "map.geojson", rotate_deg=1.0, select=["0,2", "25"], log=output
    )
    assert code == 0
    assert "3 of 236 points" in capsys.readouterr().out
