"""``scpf export``: the reference trajectory of a drive log as a file that evo and others read."""

from __future__ import annotations

from pathlib import Path
from typing import Literal


def export(
    log: Path,
    *,
    trajectory: Path,
    format: Literal["tum", "euroc", "kitti"] | None = None,
    at_images: bool | None = None,
    overwrite: bool = False,
) -> int:
    """Write the reference trajectory of a drive log as TUM, EuRoC CSV or KITTI poses.

    TUM and EuRoC hold the poses of the body in the frame `map`; KITTI those of the camera, in its own axes, one an
    image. Exit code 3: images without a reference pose were left out.

    Examples:

        scpf export drive.mcap --trajectory reference.tum

        scpf export drive.mcap --trajectory poses.txt --format kitti

    Parameters
    ----------
    log
        The drive log.
    trajectory
        The file to write; its ending says the format: .tum, .csv (EuRoC) or .txt (KITTI).
    format
        The format, whatever the ending.
    at_images
        One pose an image, interpolated, instead of every pose. KITTI poses always are where the log has images.
    overwrite
        Replace an existing file.
    """
    import numpy as np

    from scpf.ingest.drive_log import DriveLog
    from scpf.ingest.trajectory_writers import format_of, write_trajectory
    from scpf.models.errors import MissingError
    from scpf.models.trajectory import from_poses

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
