"""A camera's intrinsics and lens from views of a chessboard, with figures that say how far to trust them.

OpenCV minimises the reprojection errors (Zhang 2000; for equidistant lenses Kannala and Brandt 2006). Views that fit
far worse than the others are named and left out. Standard deviations follow from the errors' size and the
Jacobian at the solution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.chessboards import Board, View
from scpf.models.camera import Camera
from scpf.models.errors import InputError, UsageError

Array = NDArray[np.float64]

PARAMETERS: Final = {
    "plumb_bob": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"),
    "rational_polynomial": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "equidistant": ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"),
}
MIN_VIEWS: Final = 3
FEW_VIEWS: Final = 10
OUTLIER_FACTOR: Final = 3.0
"""A view whose error is this many times the median view's is an outlier …"""
OUTLIER_PX: Final = 0.5
"""… where it is also this large: among perfect views any is thrice the median."""
CELLS: Final = (10, 8)
"""Columns and rows that the picture is divided into, to say how much of it corners have covered."""


@dataclass
class Calibration:
    """A camera, and what its calibration was made of. Errors are RMS distances per corner, px."""

    camera: Camera
    board: Board
    rms_px: float
    view_rms_px: dict[str, float]
    outliers: dict[str, float]
    """Views left out, and their error when they still took part."""
    coverage: float
    """Fraction of the picture's 10×8 cells with at least one corner."""
    parameters: dict[str, float]
    sigmas: dict[str, float]
    """One standard deviation of each parameter."""
    notes: list[str] = field(default_factory=list)


def calibrate(
    views: Sequence[View], size_px: tuple[int, int], board: Board, model: str = "plumb_bob"
) -> Calibration:
    """Fit ``model`` to views of ``board`` in pictures of ``size_px`` (width, height).

    Raises InputError for fewer than three views, or views that no camera fits.
    """
    if model not in PARAMETERS:
        raise UsageError(f"lens model {model!r}", f"known: {', '.join(PARAMETERS)}")
    chosen, outliers = list(views), dict[str, float]()
    while True:
        if len(chosen) < MIN_VIEWS:
            left = f" ({len(outliers)} were left out as outliers)" if outliers else ""
            hint = "take ten or more, turned and tilted, near the edges too; is --board the inner corners?"
            raise InputError(
                f"a calibration needs {MIN_VIEWS} views with a board, and has {len(chosen)}{left}", hint
            )
        matrix, distortion, poses = _fit(chosen, size_px, board, model)
        residuals = [
            _residuals(view, board, matrix, distortion, pose, model)
            for view, pose in zip(chosen, poses, strict=True)
        ]
        errors = [_rms(residual) for residual in residuals]
        worst = int(np.argmax(errors))
        if errors[worst] <= max(OUTLIER_FACTOR * float(np.median(errors)), OUTLIER_PX):
            break
        outliers[chosen[worst].name] = errors[worst]
        del chosen[worst]

    values = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *distortion]
    names = PARAMETERS[model]
    sigmas = standard_deviations(board, matrix, distortion, poses, residuals, model)
    result = Calibration(
        Camera(*size_px, matrix, distortion, model), board, _rms(np.concatenate(residuals)),
        {view.name: error for view, error in zip(chosen, errors, strict=True)}, outliers, coverage(chosen, size_px),
        dict(zip(names, map(float, values), strict=True)), dict(zip(names, map(float, sigmas), strict=True)),
    )  # fmt: skip
    result.notes += _doubts(result, size_px)
    return result


def coverage(views: Sequence[View], size_px: tuple[int, int]) -> float:
    """Fraction of the picture's 10×8 cells that hold a corner of any view."""
    corners = np.concatenate([view.corners_px for view in views])
    cells = np.floor((corners + 0.5) / np.array(size_px) * np.array(CELLS)).astype(int)
    cells = np.clip(cells, 0, np.array(CELLS) - 1)
    return len({(int(x), int(y)) for x, y in cells}) / (CELLS[0] * CELLS[1])


def standard_deviations(
    board: Board,
    matrix: Array,
    distortion: Array,
    poses: Sequence[tuple[Array, Array]],
    residuals: Sequence[Array],
    model: str,
) -> Array:
    """One σ of fx, fy, cx, cy and the coefficients, px and pure numbers.

    The poses of the views are eliminated from JᵀJ (Schur's complement); σ² of a coordinate is the residuals' sum of
    squares over the degrees of freedom.
    """
    count = 4 + len(distortion)
    normal = np.zeros((count, count))
    for pose in poses:
        inner, outer = _jacobian(board, matrix, distortion, pose, model)
        cross = inner.T @ outer
        normal += inner.T @ inner - cross @ np.linalg.pinv(outer.T @ outer) @ cross.T
    squares = float(sum(np.sum(residual**2) for residual in residuals))
    freedom = sum(residual.size for residual in residuals) - count - 6 * len(poses)
    variance = squares / max(freedom, 1)
    sigmas: Array = np.sqrt(np.maximum(np.diag(np.linalg.pinv(normal, rcond=1e-20)), 0.0) * variance)
    return sigmas


def _fit(
    views: Sequence[View], size_px: tuple[int, int], board: Board, model: str
) -> tuple[Array, Array, list[tuple[Array, Array]]]:
    """Matrix (3, 3), coefficients, and (rotation vector, translation) of the board in each view."""
    import cv2

    points = board.points_m().astype(np.float32).reshape(-1, 1, 3)
    corners = [view.corners_px.astype(np.float32).reshape(-1, 1, 2) for view in views]
    try:
        if model == "equidistant":
            flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW
            criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-10)
            # One row of points a view: a column is refused, though the documentation says otherwise.
            rows = [points.reshape(1, -1, 3).astype(np.float64)] * len(views)
            found = cv2.fisheye.calibrate(
                rows, [corner.reshape(1, -1, 2).astype(np.float64) for corner in corners], size_px,
                np.zeros((3, 3)), np.zeros((4, 1)), flags=flags, criteria=criteria,
            )  # fmt: skip
        else:
            flags = cv2.CALIB_RATIONAL_MODEL if model == "rational_polynomial" else 0
            criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-12)
            found = cv2.calibrateCamera(
                [points] * len(views), corners, size_px, None, None, flags=flags, criteria=criteria
            )
    except cv2.error as error:
        reason = str(error.err or error).splitlines()[0]
        raise InputError(
            f"no {model} camera fits these views ({reason})", "turn and tilt the board more"
        ) from error
    _, fitted, lens, rotations, translations = found
    matrix: Array = np.array(fitted, dtype=np.float64)
    distortion: Array = np.array(lens, dtype=np.float64).ravel()[: len(PARAMETERS[model]) - 4]
    if not (
        np.isfinite(matrix).all() and np.isfinite(distortion).all() and matrix[0, 0] > 0 and matrix[1, 1] > 0
    ):
        raise InputError(f"no {model} camera fits these views", "turn and tilt the board more")
    poses = [
        (np.ravel(r).astype(np.float64), np.ravel(t).astype(np.float64))
        for r, t in zip(rotations, translations, strict=True)
    ]
    return matrix, distortion, poses


def _project(
    board: Board, matrix: Array, distortion: Array, pose: tuple[Array, Array], model: str
) -> tuple[Array, Any]:
    import cv2

    points = board.points_m().reshape(-1, 1, 3)
    if model == "equidistant":
        pixels, jacobian = cv2.fisheye.projectPoints(points, pose[0], pose[1], matrix, distortion)
    else:
        pixels, jacobian = cv2.projectPoints(points, pose[0], pose[1], matrix, distortion)
    return np.asarray(pixels, np.float64).reshape(-1, 2), jacobian


def _residuals(
    view: View, board: Board, matrix: Array, distortion: Array, pose: tuple[Array, Array], model: str
) -> Array:
    residual: Array = view.corners_px - _project(board, matrix, distortion, pose, model)[0]
    return residual


def _jacobian(
    board: Board, matrix: Array, distortion: Array, pose: tuple[Array, Array], model: str
) -> tuple[Array, Array]:
    """Derivatives of the pixels (2N, ·) by the camera's parameters, and by the pose."""
    jacobian = np.asarray(_project(board, matrix, distortion, pose, model)[1], np.float64)
    count = 4 + len(distortion)
    if model == "equidistant":  # f, c, k, then rotation, translation, skew
        return jacobian[:, :count], jacobian[:, count : count + 6]
    return jacobian[:, 6 : 6 + count], jacobian[:, :6]


def _rms(residuals: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(residuals**2, axis=1))))


def _doubts(result: Calibration, size_px: tuple[int, int]) -> list[str]:
    """What makes the result less certain than its errors say."""
    notes = []
    if len(result.view_rms_px) < FEW_VIEWS:
        notes.append(f"{len(result.view_rms_px)} views are few: ten to thirty are better")
    if result.coverage < 0.6:
        notes.append(
            f"corners cover {result.coverage:.0%} of the picture: the lens is guessed where there are none"
        )
    if result.sigmas["fx"] > 0.005 * result.parameters["fx"]:
        notes.append("the focal length is uncertain by more than 0.5 %: tilt the board more")
    fx, fy = result.parameters["fx"], result.parameters["fy"]
    if abs(fx / fy - 1) > 0.02:
        notes.append(
            f"fx and fy differ by {abs(fx / fy - 1):.1%}: are columns and rows of the board swapped?"
        )
    off = max(abs(result.parameters[c] / size - 0.5) for c, size in zip(("cx", "cy"), size_px, strict=True))
    if off > 0.15:
        notes.append(f"the principal point lies {off:.0%} of the picture off its centre")
    return notes
