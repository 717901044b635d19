"""``scpf ingest`` and ``info``: what happens before a replay."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from scpf.replay.ingest_reports import Counter, finish_assembly, print_info


def ingest(
    images: Path | None = None,
    *,
    output: Annotated[Path, Parameter(alias="-o")],
    calibration: Path | None = None,
    timestamps: Path | None = None,
    time_unit: Literal["s", "ms", "us", "ns"] | None = None,
    rate: float | None = None,
    times: Literal["names", "exif"] | None = None,
    start_time: str = "0",
    clock_offset: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    bayer: Literal["rggb", "bggr", "grbg", "gbrg"] | None = None,
    raw_size: str | None = None,
    raw_bits: Literal[8, 10, 12, 14, 16] | None = None,
    encode: Literal["png", "jpeg"] | None = None,
    jpeg_quality: int = 95,
    drop_duplicates: bool = False,
    trajectory: Path | None = None,
    trajectory_sigma_m: float | None = None,
    gps_week: int | None = None,
    gps_date: date | None = None,
    leap_seconds: int | None = None,
    utm_zone: str | None = None,
    poses_of: Literal["camera", "body", "applanix"] | None = None,
    smrmsg: Path | None = None,
    log_format: Literal["grp", "gsof", "nmea", "boreas", "pospac", "sbet"] | None = None,
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

    Times come from one of `--timestamps`, `--rate` and `--times`; a video has its own. JPEG and PNG files, and frames
    of Motion-JPEG, are stored byte for byte. Exit code 3: something was left out; the report says what.

    Examples:

        scpf ingest images -o drive.mcap --calibration camera.yaml --timestamps times.csv --trajectory gt.tum

        scpf ingest image_0 -o kitti.mcap --calibration calib.txt --rate 10 --trajectory poses.txt --map poles.geojson

        scpf ingest drive.mp4 -o drive.mcap --calibration camera.yaml --start-time "2022-08-18 18:33:53.703"

        scpf ingest raw -o drive.mcap --calibration cam.yaml --times names --bayer rggb --raw-size 2048x1536

        scpf ingest images -o drive.mcap --calibration cam.yaml --rate 13 --start-time name --trajectory sbet.out \
            --gps-date 2022-08-18 --smrmsg smrmsg.out --map campus.geojson

        scpf ingest -o reference.mcap --trajectory capture.pcap

        scpf ingest basler -o drive.mcap --calibration camera.yaml --rate 13 --start-time name

        scpf ingest tiffs -o drive.mcap --calibration cam.yaml --timestamps t.csv --clock-offset 520123456789=1660847613

    Parameters
    ----------
    images
        A folder of JPEG, PNG, TIFF, PGM or raw (.raw, .bin) files, ordered by the numbers in their names, or a video.
        Without images, the reference alone becomes a log.
    output
        The drive log to write (.mcap).
    calibration
        ROS camera_info YAML, OpenCV (YAML, XML), Kalibr camchain, or KITTI's calib.txt or calib_cam_to_cam.txt.
    timestamps
        One time a line (seconds, ns, or YYYY-MM-DD hh:mm:ss.fff), or a table of image (name or number) and time.
    time_unit
        Unit of plain numbers in that file, where its heading does not say it.
    rate
        Images per second, where there is no file of times. Frames that the counters in the names lack keep their time.
    times
        `names`: each file's name holds its time (ns, or seconds.fraction); `exif`: DateTimeOriginal with SubSecTime.
    start_time
        Time of the first image with --rate or a video: seconds, ns, a date in UTC, or `name` for Basler's names.
    clock_offset
        DEVICE=UTC, one moment by the camera's clock and in UTC, for times since power-on; or seconds to add.
    bayer
        The mosaic of raw, PNG, TIFF or PGM files: colours of the upper left 2×2 pixels.
    raw_size
        Width and height of raw files, such as 2048x1536.
    raw_bits
        Significant bits of a raw pixel: above 8, two bytes each, little-endian. The log holds the upper 8.
    encode
        How pixels that are no JPEG or PNG yet are stored. Default: png for files, jpeg for videos.
    jpeg_quality
        1 to 100, with jpeg.
    drop_duplicates
        Leave out images whose bytes repeat the one before; otherwise they are reported alone.
    trajectory
        Reference: an Applanix log (SBET, GSOF, $GRP, NMEA, POSPac or Boreas text, as bytes or in a network capture),
        or poses: TUM, EuRoC, KITTI raw's oxts folder, or KITTI's 3×4 rows (those of the camera, one an image).
        Recognised by content; the report says as what.
    trajectory_sigma_m
        Standard deviation of the reference position, m; unknown if not given.
    gps_week
        GPS week of the first record, for formats that carry the time of week only.
    gps_date
        Or its UTC date, YYYY-MM-DD.
    leap_seconds
        GPS − UTC; by default the stream's own, or the table's for the date.
    utm_zone
        Zone of eastings and northings, such as 17N.
    poses_of
        Whose poses a CSV in Boreas' style holds.
    smrmsg
        Accuracies that belong to an SBET.
    log_format
        Read the trajectory as this format, whatever it looks like.
    mount
        YAML with T_body_camera, or translation_m, roll_deg, pitch_deg, yaw_deg. Default: ahead from the origin.
    map
        Road map, GeoJSON, in the frame of the trajectory.
    calib_row
        Which camera of a calibration of several, from 0: KITTI's left grey one, Kalibr's cam0.
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
    from dataclasses import replace

    from scpf.ingest.assemble import assemble, assemble_reference
    from scpf.ingest.assembly_report import AssemblyReport
    from scpf.ingest.calibration import read_camera, read_mount
    from scpf.ingest.camera_files import Clock, time_pictures
    from scpf.ingest.image_sources import open_source
    from scpf.ingest.maps import read_map
    from scpf.ingest.pictures import Encoding
    from scpf.ingest.raw_images import RawLayout, parse_size
    from scpf.ingest.read_report import ReadOptions
    from scpf.ingest.reference import NavigationReference, PoseReference, open_applanix, open_poses
    from scpf.models.errors import UsageError

    if images is None and trajectory is None:
        raise UsageError("neither images nor a --trajectory: nothing to make a log of")
    if images is not None and calibration is None:
        raise UsageError(
            "images without a --calibration", "`scpf calibrate` makes one of chessboard pictures"
        )
    road_map = read_map(map) if map is not None else None
    options = ReadOptions(gps_week, gps_date, leap_seconds, utm_zone, smrmsg, poses_of)
    reference: NavigationReference | PoseReference | None = None
    if trajectory is not None:
        reference = open_applanix(trajectory, options, road_map, log_format)
    given = (images, calibration, timestamps, trajectory, smrmsg, mount, map)
    sources = [path for path in given if path is not None]
    variance_m2 = None if trajectory_sigma_m is None else trajectory_sigma_m**2
    if images is None or calibration is None:
        assert trajectory is not None
        if reference is None:
            reference = open_poses(trajectory, variance_m2=variance_m2, road_map=road_map)
        report = assemble_reference(
            output, reference, road_map=road_map, sources=sources, overwrite=overwrite
        )
        return finish_assembly(report, reference, format)

    layout = RawLayout(bayer, raw_bits, None if raw_size is None else parse_size(raw_size))
    source = open_source(images, layout, encode and Encoding(encode, jpeg_quality), jpeg_quality)
    clock = Clock(timestamps, rate, times, start_time, time_unit, clock_offset)
    timed, missing = time_pictures(source, clock)
    size_px = (timed.pictures[0].width_px, timed.pictures[0].height_px)
    camera = read_camera(calibration, image_size_px=size_px, row=calib_row)
    if mount is not None:
        camera = replace(camera, T_body_camera=read_mount(mount))
    if trajectory is not None and reference is None:
        reference = open_poses(
            trajectory,
            stamps_ns=timed.stamps_ns,
            T_body_camera=camera.T_body_camera,
            variance_m2=variance_m2,
            road_map=road_map,
        )
    report = assemble(
        output,
        timed.pictures,
        timed.stamps_ns,
        camera,
        reference=reference,
        road_map=road_map,
        start_s=start,
        end_s=end,
        sources=sources,
        found=AssemblyReport(
            str(output),
            frames_missing=missing,
            encoding=source.encoding,
            dropped=timed.dropped,
            notes=timed.notes,
        ),
        drop_duplicates=drop_duplicates,
        overwrite=overwrite,
        progress=None if quiet else Counter("images"),
    )
    return finish_assembly(report, reference, format)


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
