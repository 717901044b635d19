"""``scpf calibrate``: pictures of a chessboard become a calibration, with a report of its errors."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from scpf.models.whole_files import whole
from scpf.replay.ingest_reports import Counter, plain

if TYPE_CHECKING:
    from scpf.ingest.camera_calibration import Calibration
    from scpf.ingest.chessboards import Board, View


def calibrate(
    pictures: list[Path],
    *,
    output: Annotated[Path, Parameter(alias="-o")],
    board: str,
    square_m: float,
    model: Literal["plumb_bob", "rational_polynomial", "equidistant"] = "plumb_bob",
    overwrite: bool = False,
    quiet: Annotated[bool, Parameter(alias="-q")] = False,
    format: Literal["text", "json"] = "text",
) -> int:
    """Calibrate a camera from pictures of a chessboard; writes what `scpf ingest --calibration` reads.

    Prints the reprojection error of each view and of all, the standard deviation of each parameter, and how much of
    the picture was covered. Views that fit far worse than the rest are left out. Exit code 3: views were left out.

    Examples:

        scpf calibrate chessboard/ --board 9x6 --square-m 0.025 -o calibration.yaml

        scpf calibrate 1.png 2.png 3.png --board 8x5 --square-m 0.1 --model equidistant -o fisheye.yaml

    Parameters
    ----------
    pictures
        JPEG, PNG, TIFF or PGM files, or folders of them, all of one size.
    output
        The calibration to write (ROS camera_info YAML).
    board
        Inner corners of the board, such as 9x6: where four squares meet.
    square_m
        Side of a square in metres.
    model
        Lens: `plumb_bob` for most, `rational_polynomial` for wide angles, `equidistant` for fisheyes.
    overwrite
        Replace an existing output.
    quiet
        No progress.
    format
        Form of the report on stdout.
    """
    import json

    from scpf.ingest.camera_calibration import calibrate as fit
    from scpf.ingest.chessboards import list_pictures, parse_board
    from scpf.models.errors import InputError

    pattern = parse_board(board, square_m)
    if output.exists() and not overwrite:
        raise InputError(f"{output} exists", "choose another name, or give --overwrite")
    views, left_out, size_px = _views(
        list_pictures(pictures), pattern, None if quiet else Counter("pictures")
    )
    result = fit(views, size_px, pattern, model)
    for name, error_px in result.outliers.items():
        left_out[name] = f"outlier, {error_px:.2f} px"
    _write(output, result, len(left_out))
    if format == "json":
        print(json.dumps(_figures(output, result, left_out), indent=1))
    else:
        _print(output, result, left_out)
    return 3 if left_out else 0


def _views(
    paths: list[Path], board: Board, progress: Counter | None
) -> tuple[list[View], dict[str, str], tuple[int, int]]:
    """The views with a board, why others have none, and the size of the pictures."""
    from scpf.ingest.chessboards import View, find_corners, read_grey
    from scpf.models.errors import InputError

    views: list[View] = []
    left_out: dict[str, str] = {}
    size_px: tuple[int, int] | None = None
    names = [path.name for path in paths]
    for number, path in enumerate(paths, 1):
        name = path.name if names.count(path.name) == 1 else str(path)
        try:
            grey = read_grey(path)
        except InputError as error:
            left_out[name] = error.message.removeprefix(f"{path} ")
            continue
        shown_px = (grey.shape[1], grey.shape[0])
        size_px = size_px or shown_px
        if shown_px != size_px:
            text = (
                f"{path} has {shown_px[0]}×{shown_px[1]} px, the pictures before it {size_px[0]}×{size_px[1]}"
            )
            raise InputError(text, "a calibration is that of one camera and one size")
        corners = find_corners(grey, board)
        if corners is None:
            left_out[name] = f"no board of {board.columns}×{board.rows} inner corners found"
        else:
            views.append(View(name, corners))
        if progress is not None:
            progress(number, len(paths))
    return views, left_out, size_px or (0, 0)


def _write(output: Path, result: Calibration, left_out: int) -> None:
    from scpf.ingest.calibration import to_yaml

    board = result.board
    heading = (
        f"# scpf calibrate: {len(result.view_rms_px)} views of a {board.columns}x{board.rows} board of "
        f"{board.square_m} m, {left_out} left out; RMS {result.rms_px:.4f} px, coverage {result.coverage:.0%}\n"
    )
    with whole(output) as partial:
        partial.write_bytes(heading.encode() + to_yaml(result.camera, mounted=False))


def _figures(output: Path, result: Calibration, left_out: dict[str, str]) -> dict[str, Any]:
    return {
        "path": str(output),
        "model": result.camera.distortion_model,
        "size_px": [result.camera.width_px, result.camera.height_px],
        "rms_px": result.rms_px,
        "coverage": result.coverage,
        "parameters": result.parameters,
        "sigmas": result.sigmas,
        "view_rms_px": result.view_rms_px,
        "left_out": left_out,
        "notes": result.notes,
    }


def _print(output: Path, result: Calibration, left_out: dict[str, str]) -> None:
    camera = result.camera
    print(f"{output}: {camera.distortion_model}, {camera.width_px}×{camera.height_px} px")
    print(f"  error       {result.rms_px:.3f} px RMS over {len(result.view_rms_px)} views")
    print(f"  coverage    {result.coverage:.0%} of the picture's cells hold a corner")
    for note in result.notes:
        print(f"  note        {note}")
    print(f"\n  {'parameter':<12}{'value':>14}  {'σ':>10}")
    for name, value in result.parameters.items():
        print(f"  {name:<12}{value:>14.6g}  {result.sigmas[name]:>10.2g}")
    width = max(len(plain(name)) for name in [*result.view_rms_px, *left_out])
    print(f"\n  {'view':<{width}}  RMS px")
    for name, error_px in result.view_rms_px.items():
        print(f"  {plain(name):<{width}}  {error_px:6.3f}")
    for name, reason in left_out.items():
        print(f"  {plain(name):<{width}}  left out: {plain(reason)}")
