"""``scpf ingest`` with videos, raw folders, and recordings that dropped or repeated frames."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image
from video_files import HEIGHT, WIDTH, brightness, write_video

from scpf.ingest.calibration import to_yaml
from scpf.ingest.drive_log import DriveLog
from scpf.models.camera import Camera
from scpf.replay.cli import run

CAMERA = Camera(WIDTH, HEIGHT, np.array([[60.0, 0, 32], [0, 60, 24], [0, 0, 1]]))


@pytest.fixture
def calibration(tmp_path: Path) -> Path:
    path = tmp_path / "camera.yaml"
    path.write_bytes(to_yaml(CAMERA))
    return path


def ingested(
    images: Path, calibration: Path, capsys: pytest.CaptureFixture[str], *options: str
) -> tuple[int, dict[str, Any], list[tuple[int, bytes, str]]]:
    """Exit code, report, and the images of the log as (stamp, bytes, format)."""
    output = images.parent / "drive.mcap"
    tokens = [
        "ingest",
        str(images),
        "-o",
        str(output),
        "--calibration",
        str(calibration),
        "--overwrite",
        *options,
    ]
    code = run([*tokens, "--format", "json"])
    report = json.loads(capsys.readouterr().out)
    with DriveLog(output) as log:
        shown = [(image.stamp_ns, bytes(image.data), image.format) for image in log.images()]
        assert json.loads(log.metadata()["scpf"]["report"])["encoding"] == report["encoding"]
    assert len(shown) == report["frames"]
    return code, report, shown


def test_a_video(tmp_path: Path, calibration: Path, capsys: pytest.CaptureFixture[str]) -> None:
    times = [0, 77, 154, 231, 385, 462]
    write_video(tmp_path / "drive.mp4", "libx265", times, Fraction(1, 1000))
    code, report, shown = ingested(tmp_path / "drive.mp4", calibration, capsys, "--start-time", "100")
    assert (code, report["encoding"]) == (0, "JPEG at quality 95, from hevc")
    assert [stamp - 100 * 10**9 for stamp, _, _ in shown] == [time * 10**6 for time in times]
    assert report["gaps"] == [[pytest.approx(0.231), pytest.approx(0.154)]]
    for index, (_, data, format) in enumerate(shown):
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        assert format == "jpeg" and float(image.mean()) == pytest.approx(brightness(index), abs=4)


def test_motion_jpeg_with_a_repeated_frame(
    tmp_path: Path, calibration: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    colours = [(20, 20, 20), (60, 60, 60), (60, 60, 60), (90, 90, 90)]
    write_video(tmp_path / "drive.avi", "mjpeg", [0, 1, 2, 4], Fraction(1, 25), colours, qmin="3", qmax="3")
    code, report, shown = ingested(tmp_path / "drive.avi", calibration, capsys)
    assert (code, report["encoding"], report["duplicates"], report["frames"]) == (0, "", 1, 4)
    assert report["duplicates_at_s"] == [pytest.approx(0.08)]
    assert {format for _, _, format in shown} == {"jpeg"}
    code, report, _ = ingested(tmp_path / "drive.avi", calibration, capsys, "--drop-duplicates")
    assert (code, report["duplicates_left_out"], report["frames"]) == (0, 1, 3)


def test_a_bayer_recording_with_holes(
    tmp_path: Path, calibration: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, rng = tmp_path / "raw", np.random.default_rng(0)
    folder.mkdir()
    for k in (1, 2, 3, 6, 10):
        pixels = rng.integers(0, 4096, (HEIGHT, WIDTH)).astype("<u2")
        (folder / f"cam_20220818_183353703_{k}.raw").write_bytes(pixels.tobytes()[: -1 if k == 3 else None])
    options = (
        "--bayer",
        "rggb",
        "--raw-size",
        f"{WIDTH}x{HEIGHT}",
        "--raw-bits",
        "12",
        "--rate",
        "10",
        "--start-time",
    )
    code, report, shown = ingested(folder, calibration, capsys, *options, "name")
    assert (code, report["frames_missing"], report["frames"]) == (3, 5, 4)
    assert report["dropped"] == {"image that could not be read": 1}
    assert any("cam_20220818_183353703_3.raw" in note for note in report["notes"])
    assert [(stamp - 1_660_847_633_703_000_000) // 10**8 for stamp, _, _ in shown] == [0, 1, 5, 9]
    assert report["encoding"] == "PNG (lossless), from raw, Bayer rggb, 12 bit cut to 8"
    tokens = [
        "ingest",
        str(folder),
        "-o",
        str(tmp_path / "b.mcap"),
        "--calibration",
        str(calibration),
        *options,
        "name",
    ]
    assert run(tokens) == 3
    text = capsys.readouterr().out
    assert "missing     5 frames" in text and "encoded     as PNG" in text and "3.raw" in text


def test_times_that_stand_still(
    tmp_path: Path, calibration: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "images"
    folder.mkdir()
    for k, stamp in enumerate([10, 11, 11, 12, 13, 12, 14]):
        Image.effect_noise((WIDTH, HEIGHT), 30 + k).save(folder / f"{k}.png")
        with (tmp_path / "times.csv").open("a") as file:
            file.write(f"{k}.png,{stamp}\n")
    code, report, shown = ingested(folder, calibration, capsys, "--timestamps", str(tmp_path / "times.csv"))
    assert code == 3
    assert sum(report["dropped"].values()) == 2
    assert [stamp // 10**9 for stamp, _, _ in shown] == [10, 11, 12, 13, 14]
    assert shown[2][1] == (folder / "3.png").read_bytes()


def test_calls_that_cannot_work(
    tmp_path: Path, calibration: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "images"
    folder.mkdir()
    Image.new("L", (WIDTH, HEIGHT)).save(folder / "1.png")
    common = ["ingest", str(folder), "-o", str(tmp_path / "a.mcap"), "--calibration", str(calibration)]
    assert run(common) == 1
    assert "give --timestamps, --rate, or --times" in capsys.readouterr().err
    assert run([*common, "--rate", "10", "--times", "exif"]) == 2
    assert run([*common, "--rate", "10", "--clock-offset", "noon"]) == 2
    assert run([*common, "--rate", "10", "--clock-offset", "-1"]) == 1
    assert "does not fit a log" in capsys.readouterr().err
    assert not (tmp_path / "a.mcap").exists()


def test_kitti_raw_colour(tmp_path: Path, shared_data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = shared_data / "kitti_raw_0002"
    stamps = tmp_path / "timestamps.txt"
    stamps.write_text("\n".join((data / "image_02" / "timestamps.txt").read_text().splitlines()[:10]))
    (tmp_path / "images").symlink_to(data / "image_02" / "data")
    code, report, shown = ingested(
        tmp_path / "images",
        data / "calib_cam_to_cam.txt",
        capsys,
        "--timestamps",
        str(stamps),
        "--calib-row",
        "2",
    )
    assert (code, report["frames"], report["duplicates"], report["notes"]) == (0, 10, 0, [])
    assert shown[7][1] == (data / "image_02" / "data" / "0000000007.png").read_bytes()
    assert shown[0][0] % 10**9 == int(stamps.read_text().splitlines()[0].split(".")[1])


def test_kitti_06_through_a_video(
    tmp_path: Path, shared_data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Real pictures, as lossless video and back: the very pixels, at the very times."""
    av: Any = pytest.importorskip("av")
    files = sorted((shared_data / "kitti_06" / "image_l").iterdir())[:6]
    with av.open(str(tmp_path / "drive.mkv"), "w") as container:
        stream = container.add_stream("ffv1", rate=10)
        stream.width, stream.height, stream.pix_fmt = 1226, 370, "gray"
        for k, path in enumerate(files):
            frame = av.VideoFrame.from_ndarray(np.asarray(Image.open(path).convert("L")), format="gray")
            frame.pts, frame.time_base = k, Fraction(1, 10)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    code, report, shown = ingested(
        tmp_path / "drive.mkv", shared_data / "kitti_06" / "calib.txt", capsys, "--encode", "png"
    )
    assert (code, report["encoding"]) == (0, "PNG (lossless), from ffv1")
    assert [stamp for stamp, _, _ in shown] == [k * 10**8 for k in range(6)]
    for path, (_, data, _) in zip(files, shown, strict=True):
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE)
        np.testing.assert_array_equal(image, np.asarray(Image.open(path).convert("L")))
