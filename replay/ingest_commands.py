"""``scpf ingest``, ``convert``, ``info`` and ``map from``: what happens before a replay."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from scpf.replay.ingest_reports import Counter, print_assembly, print_conversion, print_info


def ingest(
    images: Path,
    *,
    output: Annotated[Path, Parameter(alias="-o")],
    calibration: Path,
    timestamps: Path | None = None,
    rate: float | None = None,
    start_time: str = "0",
    trajectory: Path | None = None,
    trajectory_sigma_m: float | None = None,
    mount: Path | None = None,
    map: Path | None = None,
    calib_row: int = 0,
    start: float | None = None,
    end: float | None = None,
    overwrite: bool = False,
    quiet: Annotated[bool, Parameter(alias="-q")] = False,
    format: Literal["text", "json"] = "text",
) -> int:
    """Make a drive log of camera images, a calibration, and, where you have them, trajectory and map.

    Times come from `--timestamps`, or from `--rate` and `--start-time`. Exit code 3: something was left out.

    Examples:

        scpf ingest images -o drive.mcap --calibration camera.yaml --timestamps times.csv --trajectory gt.tum

        scpf ingest image_0 -o kitti.mcap --calibration calib.txt --rate 10 --trajectory poses.txt --map poles.geojson

    Parameters
    ----------
    images
        A folder of JPEG or PNG files, ordered by the numbers in their names.
    output
        The drive log to write (.mcap).
    calibration
        ROS camera_info YAML, or KITTI's calib.txt.
    timestamps
        One time a line (seconds, ns, or YYYY-MM-DD hh:mm:ss.fff), or a CSV of image and time.
    rate
        Images per second, where there is no file of times.
    start_time
        Time of the first image (UTC; seconds, ns, or a date), with --rate.
    trajectory
        Reference poses: TUM, or KITTI's 3×4 rows (those of the camera, one an image).
    trajectory_sigma_m
        Standard deviation of the reference position, m; unknown if not given.
    mount
        YAML with T_body_camera, or translation_m, roll_deg, pitch_deg, yaw_deg. Default: ahead from the origin.
    map
        Road map, GeoJSON, in the frame of the trajectory.
    calib_row
        Row of a KITTI calibration: 0 is the left grey camera.
    start
        Leave out what comes before this many seconds.
    end
        Leave out what comes after this many seconds.
    overwrite
        Replace an existing output.
    quiet
        No progress.
    format
        Form of the report on stdout.
    """
    from dataclasses import asdict, replace

    from scpf.ingest.assemble import assemble
    from scpf.ingest.calibration import read_camera, read_mount
    from scpf.ingest.images import list_images, parse_time, read_stamps, stamps_at_rate
    from scpf.ingest.maps import read_map
    from scpf.ingest.trajectories import read_trajectory
    from scpf.models.errors import UsageError

    if (timestamps is None) == (rate is None):
        raise UsageError("give either --timestamps or --rate", "scpf ingest --help")
    files = list_images(images)
    size_px = (files[0].width_px, files[0].height_px)
    if timestamps is not None:
        stamps_ns = read_stamps(timestamps, files)
    else:
        assert rate is not None
        stamps_ns = stamps_at_rate(len(files), rate, parse_time(start_time, "--start-time"))
    camera = read_camera(calibration, image_size_px=size_px, row=calib_row)
    if mount is not None:
        camera = replace(camera, T_body_camera=read_mount(mount))
    poses = None
    if trajectory is not None:
        poses = read_trajectory(trajectory, stamps_ns=stamps_ns, T_body_camera=camera.T_body_camera)
    report = assemble(
        output,
        files,
        stamps_ns,
        camera,
        trajectory=poses,
        position_variance_m2=None if trajectory_sigma_m is None else trajectory_sigma_m**2,
        road_map=read_map(map) if map is not None else None,
        start_s=start,
        end_s=end,
        sources=[
            path for path in (images, calibration, timestamps, trajectory, mount, map) if path is not None
        ],
        overwrite=overwrite,
        progress=None if quiet else Counter("images"),
    )
    if format == "json":
        print(json.dumps({**asdict(report), "lossless": report.lossless}, indent=1))
    else:
        print_assembly(report)
    return 0 if report.lossless else 3


def convert(
    inputs: list[Path],
    *,
    output: Annotated[Path, Parameter(alias="-o")],
    include: Annotated[list[str] | None, Parameter(alias="-t", consume_multiple=False)] = None,
    exclude: Annotated[list[str] | None, Parameter(alias="-x", consume_multiple=False)] = None,
    start: float | None = None,
    end: float | None = None,
    overwrite: bool = False,
    quiet: Annotated[bool, Parameter(alias="-q")] = False,
    format: Literal["text", "json"] = "text",
) -> int:
    """Convert ROS bags to one MCAP file of ROS 2 messages: ROS 1 bags, rosbag2 folders, .db3 and .mcap files.

    Several inputs are merged by time. A topic that cannot be converted is left out and named; exit code 3.

    Examples:

        scpf convert drive.bag -o drive.mcap

        scpf convert part1.bag part2.bag -o drive.mcap -t "/camera/*" -t "/ins/*" --start 10 --end 70

    Parameters
    ----------
    inputs
        Recordings.
    output
        The MCAP file to write.
    include
        Only topics that match this glob; may be given several times.
    exclude
        No topic that matches this glob; may be given several times.
    start
        Leave out what comes before this many seconds after the first message.
    end
        Leave out what comes after this many seconds.
    overwrite
        Replace an existing output.
    quiet
        No progress.
    format
        Form of the report on stdout.
    """
    from dataclasses import asdict

    from scpf.ingest.bags import convert as convert_bags

    progress = None if quiet else Counter("messages")
    report = convert_bags(
        inputs, output, include=include or (), exclude=exclude or (), start_s=start, end_s=end,
        overwrite=overwrite, progress=progress,
    )  # fmt: skip
    if format == "json":
        print(
            json.dumps({**asdict(report), "messages": report.messages, "lossless": report.lossless}, indent=1)
        )
    else:
        print_conversion(report)
    return 0 if report.lossless else 3


def info(
    log: Path,
    *,
    quiet: Annotated[bool, Parameter(alias="-q")] = False,
    format: Literal["text", "json"] = "text",
) -> int:
    """Show what a log holds, after reading all of it: topics, counts, rates, largest gaps, attachments.

    Exit code 3: something in it is damaged or cannot be used; every finding is listed.

    Examples:

        scpf info drive.mcap

        scpf info drive.mcap --format json

    Parameters
    ----------
    log
        An MCAP file.
    quiet
        No progress.
    format
        Form of the report on stdout.
    """
    from dataclasses import asdict

    from scpf.ingest.inspect import inspect

    found = inspect(log, None if quiet else Counter("messages"))
    if format == "json":
        print(json.dumps({**asdict(found), "duration_s": found.duration_s}, indent=1))
    else:
        print_info(found)
    return 3 if found.findings else 0


def map_from_points(
    points: Path,
    *,
    output: Annotated[Path, Parameter(alias="-o")],
    rotate_deg: float = 0.0,
    offset_m: tuple[float, float] = (0.0, 0.0),
    log: Path | None = None,
    road_offset_m: float = 0.0,
    half_width_m: float = 4.0,
    within_m: float | None = None,
    select: Annotated[list[str] | None, Parameter(consume_multiple=False)] = None,
    exclude: Annotated[list[str] | None, Parameter(consume_multiple=False)] = None,
    key: str | None = None,
    attribution: str = "",
    overwrite: bool = False,
) -> int:
    """Make a road map of landmark points; the trajectory of a log becomes the road's centre line.

    Examples:

        scpf map from poles.csv -o map.geojson --log drive.mcap --road-offset-m 1.75

        scpf map from poles.npz -o map.geojson --rotate-deg 1.0 --offset-m -0.53 -0.23 --select 0,2,25 --log kitti.mcap

    Parameters
    ----------
    points
        CSV with columns id, x, y, and perhaps z, class; or .npz with an array of N×2. Metres, frame `map`.
    output
        The map to write (.geojson).
    rotate_deg
        Turn the points about the origin first, counter-clockwise.
    offset_m
        Then move them by x and y.
    log
        Drive log whose reference trajectory gives the centre line.
    road_offset_m
        How far the centre line lies to the left of the trajectory.
    half_width_m
        Half the width of the road.
    within_m
        Keep the points that are this near to the trajectory.
    select
        Only these ids, separated by commas; may be given several times.
    exclude
        Not these ids, likewise.
    key
        The array of an .npz that holds several.
    attribution
        Whose data these are; kept in the map.
    overwrite
        Replace an existing output.
    """
    from scpf.ingest.drive_log import DriveLog
    from scpf.ingest.maps import points_map, read_points, write_map
    from scpf.models.errors import MissingError, UsageError

    trajectory = None
    if log is not None:
        with DriveLog(log) as opened:
            trajectory = opened.trajectory()
        if trajectory is None:
            raise MissingError(f"{log} holds no reference trajectory", "ingest it with --trajectory")
    elif within_m is not None:
        raise UsageError("--within-m needs a trajectory", "give --log as well")
    found = read_points(points, key)
    road_map = points_map(
        found, rotate_deg=rotate_deg, offset_m=offset_m, trajectory=trajectory, road_offset_m=road_offset_m,
        half_width_m=half_width_m, within_m=within_m, select=_ids(select), exclude=_ids(exclude),
        attribution=attribution,
    )  # fmt: skip
    write_map(output, road_map, overwrite=overwrite)
    line = (
        f"centre line of {len(road_map.centre_line_m)} points"
        if len(road_map.centre_line_m)
        else "no centre line"
    )
    print(f"{output}: {len(road_map.landmarks)} of {len(found)} points, {line}")
    return 0


def _ids(values: list[str] | None) -> set[str]:
    return {part.strip() for value in values or () for part in value.split(",") if part.strip()}
