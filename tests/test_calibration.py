"""Calibration files, recognised by what is in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from scpf.ingest.calibration import read_camera, read_mount, to_yaml
from scpf.models.camera import Camera, looking_ahead
from scpf.models.errors import InputError, UsageError

MATRIX = np.array([[730.0, 0.0, 517.0], [0.0, 731.0, 379.0], [0.0, 0.0, 1.0]])
ROS = """\
image_width: 1032
image_height: 772
camera_name: center
camera_matrix: {rows: 3, cols: 3, data: [730, 0, 517, 0, 731, 379, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.2, 0.05, 0, 0, 0]}
"""
KITTI = "P0: 7 0 6 0 0 7 1 0 0 0 1 0\nP1: 8 0 6 -3 0 8 1 0 0 0 1 0\n"


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "calibration"
    path.write_text(text)
    return path


def test_ros_camera_info(tmp_path: Path) -> None:
    camera = read_camera(written(tmp_path, ROS), image_size_px=(1032, 772))
    np.testing.assert_array_equal(camera.matrix, MATRIX)
    np.testing.assert_array_equal(camera.distortion, [-0.2, 0.05, 0, 0, 0])
    np.testing.assert_array_equal(camera.T_body_camera, looking_ahead())


@pytest.mark.parametrize("prefixed", [True, False])
def test_kitti(tmp_path: Path, prefixed: bool) -> None:
    text = KITTI if prefixed else KITTI.replace("P0: ", "").replace("P1: ", "")
    path = written(tmp_path, text)
    assert read_camera(path, image_size_px=(12, 3)).matrix[0, 0] == 7.0
    assert read_camera(path, image_size_px=(12, 3), row=1).matrix[0, 0] == 8.0
    with pytest.raises(UsageError, match="2 rows, none numbered 5"):
        read_camera(path, image_size_px=(12, 3), row=5)
    with pytest.raises(InputError, match="images' size"):
        read_camera(path)


def test_what_a_log_attaches_reads_back(tmp_path: Path) -> None:
    mount = looking_ahead()
    mount[:3, 3] = 1.0, 0.5, 1.6
    camera = Camera(1032, 772, MATRIX, np.array([0.1, 0.2, 0.0, 0.0]), "equidistant", mount)
    path = tmp_path / "calibration.yaml"
    path.write_bytes(to_yaml(camera))
    back = read_camera(path)
    assert (back.width_px, back.height_px, back.distortion_model) == (1032, 772, "equidistant")
    np.testing.assert_array_equal(back.matrix, MATRIX)
    np.testing.assert_array_equal(back.distortion, camera.distortion)
    np.testing.assert_array_equal(back.T_body_camera, mount)
    np.testing.assert_array_equal(read_mount(path), mount)


def test_mounts(tmp_path: Path) -> None:
    path = written(tmp_path, "translation_m: [1.5, 0.1, 1.2]\nyaw_deg: 90\n")
    mount = read_mount(path)
    np.testing.assert_allclose(mount[:3, 3], [1.5, 0.1, 1.2])
    np.testing.assert_allclose(mount[:3, 2], [0, 1, 0], atol=1e-12)  # the optical axis points to the left
    path = written(tmp_path, "translation_m: [0, 0, 0]\npitch_deg: 30\n")
    assert read_mount(path)[2, 2] == pytest.approx(-0.5)  # and down


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("a: 1\n", "neither T_body_camera nor"),
        ("T_body_camera: [1, 2]\n", "4×4"),
        (yaml.safe_dump({"T_body_camera": (2 * np.eye(4)).tolist()}), "not a rotation"),
        (yaml.safe_dump({"T_body_camera": np.diag([1.0, 1, -1, 1]).tolist()}), "not a rotation"),
        ("translation_m: [a, b, c]\n", "translation_m"),
        ("translation_m: [0, 0, .inf]\n", "not finite"),
        ("translation_m: [0, 0, 0]\nyaw_deg: left\n", "yaw_deg"),
    ],
)
def test_mounts_that_are_none(tmp_path: Path, text: str, what: str) -> None:
    with pytest.raises(InputError, match=what):
        read_mount(written(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "known kind"),
        ("a: 1\n", "known kind"),
        ("[1, 2", "not YAML"),
        ("!!python/object/apply:os.getcwd []\n", "not YAML"),
        ("camera_matrix: 3\n", "3×3"),
        (ROS.replace("731", "-731"), "focal"),
        (ROS.replace("plumb_bob", "wide"), "wide"),
        (ROS.replace("731", "x"), "camera_matrix"),
        (ROS.replace("0.05", ".nan"), "not finite"),
        ("0 0 0 0 0 0 0 0 0 0 0 0\n", "row 0"),
        ("x" * 2_000_000, "larger than 1 MiB"),
    ],
)
def test_files_that_are_no_calibration(tmp_path: Path, text: str, what: str) -> None:
    with pytest.raises(InputError, match=what):
        read_camera(written(tmp_path, text), image_size_px=(1032, 772))


def test_a_calibration_of_other_images(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="1032×772"):
        read_camera(written(tmp_path, ROS), image_size_px=(640, 480))


def test_kitti_06(shared_data: Path) -> None:
    camera = read_camera(shared_data / "kitti_06" / "calib.txt", image_size_px=(1226, 370))
    assert camera.matrix[0, 0] == pytest.approx(707.0912)
