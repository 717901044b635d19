"""Calibration files, told apart by what is in them, and where the camera sits on the vehicle."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest import calibration_files
from scpf.ingest.calibration_values import matrix, rigid, shown, whole
from scpf.models.camera import R_BODY_OPTICAL, Camera, looking_ahead
from scpf.models.errors import InputError, UsageError

Array = NDArray[np.float64]

MAX_BYTES: Final = 1 << 20
_KNOWN: Final = (
    "known: ROS camera_info YAML, OpenCV FileStorage (YAML, XML), Kalibr camchain YAML, KITTI's calib.txt and "
    "calib_cam_to_cam.txt"
)


def read_camera(path: Path, *, image_size_px: tuple[int, int] | None = None, row: int = 0) -> Camera:
    """The camera of a file; it looks ahead from the body's origin, or as the file's ``T_body_camera`` says.

    ``image_size_px`` (width, height): needed where the file has none (KITTI's calib.txt, some of OpenCV's);
    checked against the others'. ``row``: which camera of a file of several, from 0 (KITTI's P0, Kalibr's cam0).
    Raises InputError for a file of no known kind.
    """
    text = _text(path)
    if calibration_files.is_kitti_raw(text):
        return _of_size(path, calibration_files.kitti_raw(str(path), text, image_size_px, row), image_size_px)
    first = text.lstrip().split("\n", 1)[0]
    numbers = first.split(":", 1)[-1].split()
    if len(numbers) == 12 and all(_is_number(word) for word in numbers):
        if image_size_px is None:
            raise InputError(f"{path} does not state the images' size", "give the images as well")
        return _kitti(path, text, image_size_px, row)
    if text.lstrip().startswith("<"):
        document = calibration_files.opencv_xml(path, MAX_BYTES)
    else:
        document = _yaml(path, calibration_files.opencv_yaml(text))
    for belongs, reader in _READERS:
        if belongs(document):
            return _of_size(path, reader(str(path), document, image_size_px, row), image_size_px)
    raise InputError(f"{path} is not a calibration of a known kind", _KNOWN)


def _of_size(path: Path, camera: Camera, image_size_px: tuple[int, int] | None) -> Camera:
    """The camera, after a check that it is for images of this size."""
    if image_size_px not in (None, (camera.width_px, camera.height_px)):
        size = f"{camera.width_px}×{camera.height_px}"
        raise InputError(f"{path} is for images of {size} px, and these have {image_size_px} px")
    return camera


def read_mount(path: Path) -> Array:
    """``T_body_camera`` (4, 4) of an extrinsics YAML file.

    Either ``T_body_camera`` with four rows of four numbers, or ``translation_m`` [x, y, z] of the camera in
    the body frame with ``roll_deg``, ``pitch_deg``, ``yaw_deg``: the attitude of a camera that would look ahead
    at zero, turned about z (yaw, left positive), then y (pitch, down positive), then x (roll).
    """
    return mount_of(_yaml(path, _text(path)), str(path))


def mount_of(document: dict[str, Any], place: str) -> Array:
    """``T_body_camera`` (4, 4) of a document as ``read_mount`` describes it."""
    from scipy.spatial.transform import Rotation

    transform = looking_ahead()
    if "T_body_camera" in document:
        return rigid(document["T_body_camera"], f"{place}: T_body_camera")
    if "translation_m" not in document:
        raise InputError(f"{place} says neither T_body_camera nor translation_m", "see `scpf ingest --help`")
    transform[:3, 3] = matrix(document["translation_m"], (3,), f"{place}: translation_m")
    angles = [
        _number(document.get(name, 0.0), f"{place}: {name}") for name in ("yaw_deg", "pitch_deg", "roll_deg")
    ]
    transform[:3, :3] = Rotation.from_euler("ZYX", angles, degrees=True).as_matrix() @ R_BODY_OPTICAL
    return transform


def to_yaml(camera: Camera, *, mounted: bool = True) -> bytes:
    """The camera as ROS camera_info YAML: what a drive log attaches. ``mounted``: with ``T_body_camera``."""
    import yaml

    def block(values: Array, rows: int, cols: int) -> dict[str, Any]:
        return {"rows": rows, "cols": cols, "data": [float(value) for value in np.ravel(values)]}

    document: dict[str, Any] = {
        "image_width": camera.width_px,
        "image_height": camera.height_px,
        "camera_name": "camera",
        "camera_matrix": block(camera.matrix, 3, 3),
        "distortion_model": camera.distortion_model,
        "distortion_coefficients": block(camera.distortion, 1, len(camera.distortion)),
        "rectification_matrix": block(np.eye(3), 3, 3),
        "projection_matrix": block(np.column_stack([camera.matrix, np.zeros(3)]), 3, 4),
    }
    if mounted:
        document["T_body_camera"] = [[float(value) for value in row] for row in camera.T_body_camera]
    text: str = yaml.safe_dump(document, sort_keys=False, default_flow_style=None)
    return text.encode()


def _ros(place: str, document: dict[str, Any], image_size_px: tuple[int, int] | None, row: int) -> Camera:
    try:
        size = whole(document["image_width"], place), whole(document["image_height"], place)
        values, coefficients = document["camera_matrix"]["data"], document["distortion_coefficients"]["data"]
    except (KeyError, TypeError) as error:
        raise InputError(f"{place}: the camera_info lacks {error}", _KNOWN) from error
    distortion = matrix(coefficients, (-1,), f"{place}: distortion_coefficients")
    mount = mount_of(document, place) if "T_body_camera" in document else looking_ahead()
    model = shown(document.get("distortion_model", "plumb_bob"))
    if not len(distortion):
        model, distortion = "plumb_bob", np.zeros(5)
    try:
        return Camera(*size, matrix(values, (3, 3), f"{place}: camera_matrix"), distortion, model, mount)
    except InputError as error:
        raise InputError(f"{place}: {error.message}", error.hint) from error


_Reader = Callable[[str, dict[str, Any], tuple[int, int] | None, int], Camera]
_READERS: Final[tuple[tuple[Callable[[dict[str, Any]], bool], _Reader], ...]] = (
    (calibration_files.is_kalibr, calibration_files.kalibr),
    (calibration_files.is_opencv, calibration_files.opencv),
    (lambda document: "camera_matrix" in document, _ros),
)
"""How the kind of a document is recognised, and what reads it; the first that fits."""


def _kitti(path: Path, text: str, image_size_px: tuple[int, int], row: int) -> Camera:
    lines = [line for line in text.splitlines() if line.strip()]
    if not 0 <= row < len(lines):
        raise UsageError(f"{path} has {len(lines)} rows, none numbered {row}", "rows are counted from 0")
    words = lines[row].split(":", 1)[-1].split()
    if len(words) != 12 or not all(_is_number(word) for word in words):
        raise InputError(f"{path}: row {row} is not a projection of 12 numbers")
    projection = np.array([float(word) for word in words]).reshape(3, 4)
    try:
        return Camera(*image_size_px, projection[:, :3].copy())
    except InputError as error:
        raise InputError(f"{path}: row {row}: {error.message}", error.hint) from error


def _text(path: Path) -> str:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"{path} is larger than 1 MiB: not a calibration", _KNOWN)
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not a text file ({error})", _KNOWN) from error


def _yaml(path: Path, text: str) -> dict[str, Any]:
    import yaml

    try:
        document = yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise InputError(f"{path} is not YAML ({str(error).splitlines()[0]})", _KNOWN) from error
    if not isinstance(document, dict):
        raise InputError(f"{path} is not a calibration of a known kind", _KNOWN)
    return document


def _number(value: Any, place: str) -> float:
    return float(matrix([value], (1,), place)[0])


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False
