"""Calibration files of other tools: OpenCV's FileStorage (YAML, XML), Kalibr's camchain, KITTI raw."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.calibration_values import matrix, rigid, shown, whole
from scpf.models.camera import Camera, looking_ahead
from scpf.models.errors import InputError, UsageError

Array = NDArray[np.float64]
Size = tuple[int, int]

OPENCV_MATRIX: Final = (
    "camera_matrix",
    "Camera_Matrix",
    "cameraMatrix",
    "cameraMatrix1",
    "K",
    "K1",
    "M1",
    "M",
)
OPENCV_DISTORTION: Final = (
    "distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "distCoeffs1", "dist_coeffs", "distortion",
    "D", "D1",
)  # fmt: skip
_WIDTH: Final = ("image_width", "image_Width", "width", "imageWidth")
_HEIGHT: Final = ("image_height", "image_Height", "height", "imageHeight")
_SIZE: Final = ("image_size", "imageSize", "img_size")
KALIBR_LENSES: Final = {"radtan": "plumb_bob", "equidistant": "equidistant", "none": "plumb_bob"}
_RAW_KITTI: Final = re.compile(r"^P_rect_0*([0-9]{1,2}):", re.MULTILINE)


def is_opencv(document: Mapping[str, Any]) -> bool:
    """Whether it names a camera matrix as OpenCV's programs do, and no distortion model as ROS does."""
    return "distortion_model" not in document and any(name in document for name in OPENCV_MATRIX)


def opencv(place: str, document: Mapping[str, Any], image_size_px: Size | None, row: int) -> Camera:
    """A camera that cv::FileStorage wrote; the lens model goes by the number of coefficients, 4 and 5 being
    plumb_bob and 8 to 14 rational_polynomial; ``fisheye_model: 1`` (OpenCV's sample program) is equidistant.
    """
    values = _data(_first(document, OPENCV_MATRIX), f"{place}: camera matrix")
    coefficients = _first(document, OPENCV_DISTORTION)
    distortion = np.zeros(5)
    if coefficients is not None:
        distortion = matrix(_data(coefficients, f"{place}: distortion"), (-1,), f"{place}: distortion")
    width, height, size = (_first(document, names) for names in (_WIDTH, _HEIGHT, _SIZE))
    if width is None and height is None and isinstance(size, list) and len(size) == 2:
        width, height = size
    if width is not None and height is not None:
        size_px = whole(width, f"{place}: image_width"), whole(height, f"{place}: image_height")
    elif image_size_px is not None:
        size_px = image_size_px
    else:
        raise InputError(f"{place} does not state the images' size", "give the images as well")
    fisheye = _first(document, ("fisheye_model", "fisheye"))
    model = "equidistant" if fisheye not in (None, 0, "0", False) else _model_of(len(distortion))
    return _camera(place, size_px, matrix(values, (3, 3), f"{place}: camera matrix"), distortion, model)


def is_kalibr(document: Mapping[str, Any]) -> bool:
    """Whether it is a camchain."""
    return isinstance(document.get("cam0"), dict)


def kalibr(place: str, document: Mapping[str, Any], image_size_px: Size | None, row: int) -> Camera:
    """Camera ``row`` of a Kalibr camchain (pinhole; radtan, equidistant or none).

    With T_cam_imu (of this camera, or of one before it in the chain of T_cn_cnm1), the body is Kalibr's IMU frame;
    it has to be x forward, y left, z up, which is checked as far as one can: the picture's down has to be the
    body's, within a right angle. Without it the camera looks ahead from the body's origin.
    """
    entry = document.get(f"cam{row}")
    if not isinstance(entry, dict):
        raise UsageError(f"{place} has no cam{row}", "choose a camera with --calib-row, counted from 0")
    where = f"{place}: cam{row}"
    kind, lens = shown(entry.get("camera_model")), shown(entry.get("distortion_model"))
    if kind != "pinhole" or lens not in KALIBR_LENSES:
        known = f"known: pinhole with {', '.join(KALIBR_LENSES)}"
        raise InputError(f"{where} is {kind} with {lens}", known)
    fx, fy, cx, cy = matrix(entry.get("intrinsics"), (4,), f"{where}: intrinsics")
    coefficients = np.zeros(4)
    if lens != "none":
        coefficients = matrix(entry.get("distortion_coeffs"), (4,), f"{where}: distortion_coeffs")
    resolution = entry.get("resolution")
    if not isinstance(resolution, list) or len(resolution) != 2:
        raise InputError(f"{where}: resolution is not two numbers")
    size_px = whole(resolution[0], f"{where}: resolution"), whole(resolution[1], f"{where}: resolution")
    mount = _kalibr_mount(place, document, row)
    pinhole = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return _camera(place, size_px, pinhole, coefficients, KALIBR_LENSES[lens], mount)


def _kalibr_mount(place: str, document: Mapping[str, Any], row: int) -> Array | None:
    T_cam_previous = np.eye(4)
    for index in range(row, -1, -1):
        entry = document.get(f"cam{index}")
        if not isinstance(entry, dict):
            return None
        if "T_cam_imu" in entry:
            T_cam_imu = T_cam_previous @ rigid(entry["T_cam_imu"], f"{place}: cam{index}: T_cam_imu")
            mount = np.asarray(np.linalg.inv(T_cam_imu), dtype=np.float64)
            if mount[2, 1] >= 0:
                hint = "turn T_cam_imu to such a frame, or give --mount, which replaces it"
                raise InputError(
                    f"{place}: by T_cam_imu the IMU's z axis does not point up in the picture", hint
                )
            return mount
        if "T_cn_cnm1" not in entry:
            return None
        step = rigid(entry["T_cn_cnm1"], f"{place}: cam{index}: T_cn_cnm1")
        T_cam_previous = np.asarray(T_cam_previous @ step, dtype=np.float64)
    return None


def is_kitti_raw(text: str) -> bool:
    """Whether it is the calib_cam_to_cam.txt of a KITTI raw day."""
    return _RAW_KITTI.search(text) is not None


def kitti_raw(place: str, text: str, image_size_px: Size | None, row: int) -> Camera:
    """Camera ``row`` (2: left colour) of calib_cam_to_cam.txt: the rectified one, P_rect and S_rect, or the raw one,
    K, D and S, whichever has the images' size; rectified where no size is given.
    """
    lines = {
        name.strip(): words.split() for name, _, words in (line.partition(":") for line in text.splitlines())
    }

    def values(name: str, *shape: int) -> Array:
        if name not in lines:
            known = sorted(int(number) for number in _RAW_KITTI.findall(text))
            raise UsageError(f"{place} has no {name}", f"cameras: {known}; choose one with --calib-row")
        return matrix(lines[name], shape, f"{place}: {name}")

    key = f"{row:02d}"
    width, height = values(f"S_rect_{key}", 2)
    rectified = whole(width, place), whole(height, place)
    if f"S_{key}" in lines and image_size_px is not None and image_size_px != rectified:
        raw = whole(values(f"S_{key}", 2)[0], place), whole(values(f"S_{key}", 2)[1], place)
        if image_size_px == raw:
            return _camera(place, raw, values(f"K_{key}", 3, 3), values(f"D_{key}", 5), "plumb_bob")
    return _camera(place, rectified, values(f"P_rect_{key}", 3, 4)[:, :3].copy(), np.zeros(5), "plumb_bob")


def opencv_yaml(text: str) -> str:
    """FileStorage's YAML as YAML: its first line (``%YAML:1.0``) is none, and its tag is known to OpenCV alone."""
    without = re.sub(r"\A%YAML[: ][0-9.]+[ \t]*\r?\n", "", text.lstrip())
    return without.replace("!!opencv-matrix", "")


def opencv_xml(path: Path, max_bytes: int) -> dict[str, Any]:
    """FileStorage's XML as the document that its YAML would be. Raises InputError for other XML."""
    from scpf.ingest.xml_stream import stream

    document: dict[str, Any] = {}
    open_tags: list[str] = []
    texts: list[str] = []

    def start(name: str, attributes: dict[str, str], depth: int) -> None:
        if depth == 0 and name != "opencv_storage":
            raise InputError(f"{path} is XML of <{name[:40]}>, not of <opencv_storage>")
        open_tags.append(name)
        texts.clear()

    def end(name: str, depth: int) -> None:
        open_tags.pop()
        words = "".join(texts).split()
        texts.clear()
        if depth == 1 and words and name not in document:
            document[name] = words[0] if len(words) == 1 else words
        elif depth == 2 and open_tags:
            inner = document.setdefault(open_tags[-1], {})
            if isinstance(inner, dict):
                inner[name] = words

    stream(path, start, end, texts.append, max_bytes=max_bytes)
    return document


def _first(document: Mapping[str, Any], names: tuple[str, ...]) -> Any:
    return next((document[name] for name in names if name in document), None)


def _data(value: Any, place: str) -> Any:
    """The numbers of an OpenCV matrix, whose rows and columns have to agree with them."""
    if not isinstance(value, dict):
        return value
    data, rows, cols = value.get("data"), value.get("rows"), value.get("cols")
    if rows is not None and cols is not None and isinstance(data, list):
        counts = [_one(rows), _one(cols)]
        if not all(isinstance(count, int) for count in counts) or counts[0] * counts[1] != len(data):
            raise InputError(f"{place}: {shown(rows)}×{shown(cols)} are said, and {len(data)} numbers follow")
    return data


def _one(value: Any) -> Any:
    """A whole number, also where XML gave it as a list of one word."""
    word = value[0] if isinstance(value, list) and len(value) == 1 else value
    return int(word) if isinstance(word, str) and re.fullmatch(r"[0-9]{1,4}", word) else word


def _model_of(count: int) -> str:
    return "plumb_bob" if count <= 5 else "rational_polynomial"


def _camera(
    place: str, size_px: Size, pinhole: Array, distortion: Array, model: str, mount: Array | None = None
) -> Camera:
    try:
        return Camera(*size_px, pinhole, distortion, model, looking_ahead() if mount is None else mount)
    except InputError as error:
        raise InputError(f"{place}: {error.message}", error.hint) from error
