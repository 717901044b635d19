"""``scpf export``: a drive log's reference trajectory for evo and others, or the network for ONNX Runtime."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter


def export(
    source: str,
    *,
    trajectory: Path | None = None,
    onnx: Path | None = None,
    precision: Literal["int8", "float32"] = "int8",
    pictures: Annotated[list[Path] | None, Parameter(consume_multiple=False)] = None,
    format: Literal["tum", "euroc", "kitti"] | None = None,
    at_images: bool = False,
    overwrite: bool = False,
) -> int:
    """Write the reference trajectory of a drive log as TUM, EuRoC CSV or KITTI poses; or PoleNet as ONNX.

    TUM and EuRoC hold the poses of the body in the frame `map`; KITTI those of the camera, in its own axes, one an
    image. Exit code 3: images without a reference pose were left out.

    In 8 bits PoleNet takes half of the time or less, and finds a little less. Run it with --segmenter NAME.onnx.

    Examples:

        scpf export drive.mcap --trajectory reference.tum

        scpf export drive.mcap --trajectory poses.txt --format kitti

        scpf export polenet --onnx polenet_int8.onnx --pictures drive.mcap

    Parameters
    ----------
    source
        The drive log; with --onnx, weights of PoleNet (.safetensors), or `polenet` for those that ship.
    trajectory
        The file to write; its ending says the format: .tum, .csv (EuRoC) or .txt (KITTI).
    onnx
        The network to write (needs `scpf[onnx]`).
    precision
        Of the network: `int8` or `float32`.
    pictures
        A drive log or a folder of pictures of the camera that int8 shall run on; repeat it. Default: painted scenes.
    format
        The format, whatever the ending.
    at_images
        One pose an image, interpolated, instead of every pose. KITTI poses always are where the log has images.
    overwrite
        Replace an existing file.
    """
    import sys

    import numpy as np

    from scpf.ingest.drive_log import DriveLog
    from scpf.ingest.trajectory_writers import format_of, write_trajectory
    from scpf.models.errors import MissingError, UsageError
    from scpf.models.trajectory import from_poses

    if onnx is not None and trajectory is None:
        from scpf.replay.network_export import export_network

        def say(line: str) -> None:
            if sys.stderr.isatty():
                print(line, file=sys.stderr)

        print(export_network(source, onnx, precision, pictures or [], overwrite, say))
        return 0
    if trajectory is None or onnx is not None:
        raise UsageError("one thing to export: --trajectory of a drive log, or --onnx of a network")
    log = Path(source)
    chosen = format or format_of(trajectory)
    left_out = 0
    with DriveLog(log) as opened:
        poses = opened.trajectory()
        if poses is None:
            raise MissingError(f"{log} holds no reference trajectory", "ingest it with --trajectory")
        camera = opened.camera()
        stamps = (
            sorted({image.stamp_ns for image in opened.images()}) if at_images or chosen == "kitti" else []
        )
    if at_images and not stamps:
        raise MissingError(f"{log} holds no images", "leave --at-images out")
    if stamps:
        found = [(stamp, pose) for stamp in stamps if (pose := poses.at(stamp)) is not None]
        left_out = len(stamps) - len(found)
        if not found:
            raise MissingError(
                f"{log}: no image has a reference pose", "see `scpf doctor` for the times of both"
            )
        poses = from_poses(np.array([stamp for stamp, _ in found]), np.array([pose for _, pose in found]))
    mount = None if camera is None else camera.T_body_camera
    write_trajectory(trajectory, poses, chosen, T_body_camera=mount, overwrite=overwrite)
    duration_s = float(int(poses.stamps_ns[-1]) - int(poses.stamps_ns[0])) * 1e-9
    missing = f"; {left_out} images without a reference pose left out" if left_out else ""
    print(f"{trajectory}: {len(poses)} poses in {duration_s:.3f} s, {chosen}{missing}")
    return 3 if left_out else 0
