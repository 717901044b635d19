"""Calibration files of OpenCV, Kalibr and KITTI raw, against their own writers where those are here."""

from __future__ import annotations

import time
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from scpf.ingest.calibration import read_camera, to_yaml
from scpf.models.camera import R_BODY_OPTICAL, Camera, looking_ahead
from scpf.models.errors import InputError, ScpfError, UsageError

MATRIX = np.array([[730.25, 0.0, 517.5], [0.0, 731.125, 379.75], [0.0, 0.0, 1.0]])
LENSES = {
    4: ("plumb_bob", [-0.2, 0.05, 0.001, -0.002]),
    5: ("plumb_bob", [-0.2, 0.05, 0.001, -0.002, 0.01]),
    8: ("rational_polynomial", [0.1, 0.2, 0.001, 0.002, 0.01, 0.3, 0.1, 0.01]),
    14: ("rational_polynomial", [0.1 / k for k in range(1, 15)]),
}


def file_storage(
    path: Path, count: int, *, size: bool = True, names: tuple[str, str] | None = None, **more: int
) -> Path:
    """Written by OpenCV itself."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    if size:
        storage.write("image_width", 1032)
        storage.write("image_height", 772)
    for name, value in more.items():
        storage.write(name, value)
    matrix_name, lens_name = names or ("camera_matrix", "distortion_coefficients")
    storage.write(matrix_name, MATRIX)
    storage.write(lens_name, np.array(LENSES[count][1]).reshape(-1, 1))
    storage.write("avg_reprojection_error", 0.25)
    storage.release()
    return path


@pytest.mark.parametrize("ending", ["yml", "xml", "json"])
@pytest.mark.parametrize("count", list(LENSES))
def test_what_opencv_writes(tmp_path: Path, ending: str, count: int) -> None:
    camera = read_camera(file_storage(tmp_path / f"camera.{ending}", count), image_size_px=(1032, 772))
    np.testing.assert_array_equal(camera.matrix, MATRIX)
    assert camera.distortion_model == LENSES[count][0]
    np.testing.assert_array_equal(camera.distortion, LENSES[count][1])
    np.testing.assert_array_equal(camera.T_body_camera, looking_ahead())


@pytest.mark.parametrize("ending", ["yml", "xml"])
@pytest.mark.parametrize("names", [("cameraMatrix", "distCoeffs"), ("M1", "D1"), ("K", "D")])
def test_names_that_programs_use(tmp_path: Path, ending: str, names: tuple[str, str]) -> None:
    path = file_storage(tmp_path / f"camera.{ending}", 5, size=False, names=names)
    assert read_camera(path, image_size_px=(640, 480)).width_px == 640
    with pytest.raises(InputError, match="images' size"):
        read_camera(path)
    with pytest.raises(InputError, match="1032×772"):
        read_camera(file_storage(tmp_path / f"sized.{ending}", 5), image_size_px=(640, 480))


def test_opencv_fisheye(tmp_path: Path) -> None:
    assert read_camera(file_storage(tmp_path / "a.yml", 4, fisheye_model=1)).distortion_model == "equidistant"
    assert read_camera(file_storage(tmp_path / "b.yml", 4, fisheye_model=0)).distortion_model == "plumb_bob"
    assert read_camera(file_storage(tmp_path / "c.xml", 4, fisheye_model=1)).distortion_model == "equidistant"


KALIBR = """\
cam0:
  T_cam_imu:
  - [0.0, -1.0, 0.0, 0.1]
  - [0.0, 0.0, -1.0, 1.5]
  - [1.0, 0.0, 0.0, -1.2]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.2, 0.05, 0.001, -0.002]
  distortion_model: radtan
  intrinsics: [730.25, 731.125, 517.5, 379.75]
  resolution: [1032, 772]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: 0.01
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.5]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [0.01, 0.02, 0.0, 0.0]
  distortion_model: equidistant
  intrinsics: [500, 501, 320, 240]
  resolution: [640, 480]
"""


KITTI_RAW = b"""\
calib_time: 09-Jan-2012 13:57:47
S_02: 1.392000e+03 5.120000e+02
K_02: 9.5e+02 0.0e+00 6.9e+02 0.0e+00 9.5e+02 2.2e+02 0.0e+00 0.0e+00 1.0e+00
D_02: -3.6e-01 1.9e-01 1.3e-03 5.6e-04 -6.7e-02
S_rect_02: 1.242000e+03 3.750000e+02
P_rect_02: 7.2e+02 0.0e+00 6.0e+02 4.4e+01 0.0e+00 7.2e+02 1.7e+02 2.1e-01 0.0e+00 0.0e+00 1.0e+00 2.7e-03
"""


def test_kalibr(tmp_path: Path) -> None:
    path = tmp_path / "camchain.yaml"
    path.write_text(KALIBR)
    left, right = read_camera(path), read_camera(path, row=1)
    np.testing.assert_array_equal(left.matrix, MATRIX)
    assert (left.distortion_model, right.distortion_model) == ("plumb_bob", "equidistant")
    assert (right.width_px, right.height_px, right.matrix[1, 1]) == (640, 480, 501)
    np.testing.assert_allclose(left.T_body_camera[:3, :3], R_BODY_OPTICAL)
    np.testing.assert_allclose(left.T_body_camera[:3, 3], [1.2, 0.1, 1.5])
    # Half a metre to the right of the left camera, which is -y of the body.
    np.testing.assert_allclose(right.T_body_camera[:3, 3], [1.2, -0.4, 1.5], atol=1e-12)
    with pytest.raises(UsageError, match="no cam2"):
        read_camera(path, row=2)


def test_kalibr_without_an_imu_looks_ahead(tmp_path: Path) -> None:
    document = yaml.safe_load(KALIBR)
    del document["cam0"]["T_cam_imu"]
    path = tmp_path / "camchain.yaml"
    path.write_text(yaml.safe_dump(document))
    for row in (0, 1):
        np.testing.assert_array_equal(read_camera(path, row=row).T_body_camera, looking_ahead())


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("pinhole", "omni", "omni with radtan"),
        ("radtan", "fov", "pinhole with fov"),
        ("[1032, 772]", "[1032]", "resolution"),
        ("[730.25, 731.125, 517.5, 379.75]", "[1, 2]", "intrinsics"),
        ("[-0.2, 0.05, 0.001, -0.002]", "[0.1]", "distortion_coeffs"),
        ("- [0.0, -1.0, 0.0, 0.1]", "- [0.0, -2.0, 0.0, 0.1]", "T_cam_imu is not a rotation"),
        (
            "- [0.0, 0.0, -1.0, 1.5]\n  - [1.0,",
            "- [0.0, 0.0, 1.0, 1.5]\n  - [-1.0,",
            "z axis does not point up",
        ),
    ],
)
def test_kalibr_files_that_cannot_be_used(tmp_path: Path, old: str, new: str, what: str) -> None:
    path = tmp_path / "camchain.yaml"
    assert old in KALIBR
    path.write_text(KALIBR.replace(old, new, 1))
    with pytest.raises(InputError, match=what):
        read_camera(path)


def test_kitti_raw(shared_data: Path) -> None:
    path = shared_data / "kitti_raw_0002" / "calib_cam_to_cam.txt"
    rectified = read_camera(path, image_size_px=(1242, 375), row=2)
    assert (rectified.matrix[0, 0], rectified.matrix[0, 2]) == (721.5377, 609.5593)
    assert not rectified.distortion.any()
    raw = read_camera(path, image_size_px=(1392, 512), row=2)
    assert (raw.matrix[0, 0], raw.distortion[0]) == (959.791, -0.3691481)
    with pytest.raises(InputError, match="1242×375"):
        read_camera(path, image_size_px=(640, 480), row=2)
    with pytest.raises(UsageError, match="no S_rect_07"):
        read_camera(path, row=7)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("<a/>", "XML of <a>"),
        ("<opencv_storage><camera_matrix>", "not well-formed"),
        ("<!DOCTYPE x [<!ENTITY a 'b'>]><opencv_storage/>", "document type"),
        ("<opencv_storage/>", "known kind"),
        (
            "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [1]\n",
            "3×3 are said",
        ),
        (
            "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 1\n   cols: 1\n   dt: d\n   data: [1]\n",
            "1 numbers",
        ),
        ("camera_matrix: {data: [[[[1]]]]}\n", "not a list of numbers"),
    ],
)
def test_files_that_are_none(tmp_path: Path, text: str, what: str) -> None:
    path = tmp_path / "calibration"
    path.write_text(text)
    with pytest.raises(InputError, match=what):
        read_camera(path, image_size_px=(1032, 772))


def test_a_short_text_that_means_a_long_list(tmp_path: Path) -> None:
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, 12)]
    path = tmp_path / "calibration"
    ros = "distortion_model: plumb_bob\ndistortion_coefficients: {data: []}\n"
    for tail in (
        "camera_matrix: *a11\n",
        "camera_matrix: {data: *a11}\n" + ros,
        "camera_matrix: {data: [1], rows: *a11, cols: *a11}\n",
        "camera_matrix: {data: [1, 0, 1, 0, 1, 1, 0, 0, 1]}\n"
        + ros.replace("plumb_bob", "*a11").replace("[]", "[0, 0, 0, 0]"),
        "cam0: {camera_model: *a11, distortion_model: *a11}\n",
        "camera_matrix: {data: [1, 0, 1, 0, 1, 1, 0, 0, 1]}\nT_body_camera: *a11\n" + ros,
    ):
        path.write_text("\n".join(lines) + f"\nimage_width: 9\nimage_height: 9\n{tail}")
        started = time.monotonic()
        with pytest.raises(InputError):
            read_camera(path)
        path.write_text("\n".join(lines) + f"\nimage_width: *a11\nimage_height: *a11\n{tail}")
        with pytest.raises(InputError):
            read_camera(path)
        assert time.monotonic() - started < 1.0


def test_mutated_files_raise_nothing_else(tmp_path: Path) -> None:
    camera = Camera(1032, 772, MATRIX, np.array(LENSES[5][1]))
    wholes = [
        file_storage(tmp_path / "a.yml", 5).read_bytes(),
        file_storage(tmp_path / "a.xml", 5).read_bytes(),
        KALIBR.split("cam1:")[0].encode(),
        to_yaml(camera),
        KITTI_RAW,
    ]
    pieces = [
        b".inf",
        b"&a [*a]",
        b"-",
        b"\n",
        b": ",
        b"{",
        b"]",
        b"1e999",
        b"9" * 5000,
        b"\xff",
        b"null",
        b"<",
        b">",
        b"'",
    ]
    pieces += [b"!!python/object/apply:os.system [x]", b"2001-01-01", b"[]", b"\0", b"true", b"0"]
    rng, path, refused, started = np.random.default_rng(0), tmp_path / "mutated", 0, time.monotonic()
    for trial in range(1000):
        data = bytearray(wholes[trial % len(wholes)])
        for _ in range(int(rng.integers(1, 4))):
            at = int(rng.integers(len(data)))
            data[at : at + int(rng.integers(0, 8))] = pieces[int(rng.integers(len(pieces)))]
        path.write_bytes(data)
        try:
            read_camera(path, row=2 if trial % len(wholes) == 4 else 0)
        except ScpfError as error:
            refused += 1
            assert "mutated" in error.message
    assert refused > 300
    assert time.monotonic() - started < 10
