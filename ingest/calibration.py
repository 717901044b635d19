"""Calibration files: ROS camera_info YAML, KITTI's calib.txt, and where the camera sits on the vehicle."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.camera import R_BODY_OPTICAL, Camera, looking_ahead
from scpf.models.errors import InputError, UsageError

Array = NDArray[np.float64]

MAX_BYTES: Final = 1 << 20
_KNOWN: Final = (
    "known: ROS camera_info YAML (image_width, camera_matrix, …) and KITTI calib.txt (12 numbers a row)"
)


def read_camera(path: Path, *, image_size_px: tuple[int, int] | None = None, row: int = 0) -> Camera:
    """The camera of a file; it looks ahead from the body's origin, or as the file's ``T_body_camera`` says.

    ``image_size_px`` (width, height): needed for KITTI's files, which have none; checked against the others'.
    ``row``: which projection of a KITTI file (0 = P0). Raises InputError for a file of no known kind.
    """
    text = _text(path)
    first = text.lstrip().split("\n", 1)[0]
    numbers = first.split(":", 1)[-1].split()
    if len(numbers) == 12 and all(_is_number(word) for word in numbers):
        if image_size_px is None:
            raise InputError(f"{path} does not state the images' size", "give the images as well")
        return _kitti(path, text, image_size_px, row)
    document = _yaml(path, text)
    for key, reader in _READERS.items():
        if key in document:
            camera = reader(path, document)
            if image_size_px not in (None, (camera.width_px, camera.height_px)):
                size = f"{camera.width_px}×{camera.height_px}"
                raise InputError(f"{path} is for images of {size} px, and these have {image_size_px} px")
            return camera
    raise InputError(f"{path} is not a calibration of a known kind", _KNOWN)


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
        transform = _matrix(document["T_body_camera"], (4, 4), f"{place}: T_body_camera")
        rotation = transform[:3, :3]
        off = np.abs(rotation @ rotation.T - np.eye(3)).max()
        if off > 1e-3 or np.linalg.det(rotation) < 0 or not np.allclose(transform[3], [0, 0, 0, 1]):
            raise InputError(
                f"{place}: T_body_camera is not a rotation and a translation (misses by {off:.2g})"
            )
        return transform
    if "translation_m" not in document:
        raise InputError(f"{place} says neither T_body_camera nor translation_m", "see `scpf ingest --help`")
    transform[:3, 3] = _matrix(document["translation_m"], (3,), f"{place}: translation_m")
    angles = [
        _number(document.get(name, 0.0), f"{place}: {name}") for name in ("yaw_deg", "pitch_deg", "roll_deg")
    ]
    transform[:3, :3] = Rotation.from_euler("ZYX", angles, degrees=True).as_matrix() @ R_BODY_OPTICAL
    return transform


def to_yaml(camera: Camera) -> bytes:
    """The camera as ROS camera_info YAML, with ``T_body_camera`` added: what a drive log attaches."""
    import yaml

    def block(values: Array, rows: int, cols: int) -> dict[str, Any]:
        return {"rows": rows, "cols": cols, "data": [float(value) for value in np.ravel(values)]}

    document = {
        "image_width": camera.width_px,
        "image_height": camera.height_px,
        "camera_name": "camera",
        "camera_matrix": block(camera.matrix, 3, 3),
        "distortion_model": camera.distortion_model,
        "distortion_coefficients": block(camera.distortion, 1, len(camera.distortion)),
        "rectification_matrix": block(np.eye(3), 3, 3),
        "projection_matrix": block(np.column_stack([camera.matrix, np.zeros(3)]), 3, 4),
        "T_body_camera": [[float(value) for value in row] for row in camera.T_body_camera],
    }
    text: str = yaml.safe_dump(document, sort_keys=False, default_flow_style=None)
    return text.encode()


def _ros(path: Path, document: dict[str, Any]) -> Camera:
    place = str(path)
    try:
        size = (int(document["image_width"]), int(document["image_height"]))
        matrix, coefficients = document["camera_matrix"]["data"], document["distortion_coefficients"]["data"]
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{place}: the camera_info lacks {error}", _KNOWN) from error
    distortion = _matrix(coefficients, (-1,), f"{place}: distortion_coefficients")
    mount = mount_of(document, place) if "T_body_camera" in document else looking_ahead()
    model = str(document.get("distortion_model", "plumb_bob"))
    if not len(distortion):
        model, distortion = "plumb_bob", np.zeros(5)
    try:
        return Camera(*size, _matrix(matrix, (3, 3), f"{place}: camera_matrix"), distortion, model, mount)
    except InputError as error:
        raise InputError(f"{place}: {error.message}", error.hint) from error


_READERS: Final[dict[str, Callable[[Path, dict[str, Any]], Camera]]] = {"camera_matrix": _ros}
"""How a YAML calibration is recognised, by a key of its first level."""


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


def _matrix(values: Any, shape: tuple[int, ...], place: str) -> Array:
    try:
        matrix = np.array(values, dtype=np.float64).reshape(shape)
    except (TypeError, ValueError) as error:
        raise InputError(f"{place} is not {'×'.join(map(str, shape))} numbers") from error
    if not np.isfinite(matrix).all():
        raise InputError(f"{place} holds a value that is not finite")
    return matrix


def _number(value: Any, place: str) -> float:
    return float(_matrix([value], (1,), place)[0])


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False
