"""``scpf convert``: ROS bags to MCAP."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from scpf.replay.ingest_reports import Counter


def convert(
    inputs: list[Path],
    /,
    *,
    output: Annotated[Path, Parameter(alias="-o")],
    encoding: Literal["ros2", "ros1"] = "ros2",
    include: Annotated[list[str] | None, Parameter(alias="-t", consume_multiple=False)] = None,
    exclude: Annotated[list[str] | None, Parameter(alias="-x", consume_multiple=False)] = None,
    start: float | None = None,
    end: float | None = None,
    split_size: str | None = None,
    split_duration: float | None = None,
    compression: Literal["auto", "zstd", "none"] = "auto",
    mapping: str = "auto",
    map: Path | None = None,
    origin: tuple[float, float, float] | None = None,
    verify: bool = False,
    overwrite: bool = False,
    quiet: Annotated[bool, Parameter(alias="-q")] = False,
    format: Literal["text", "json"] = "text",
) -> int:
    """Convert ROS bags to MCAP: ROS 1 bags (also .active and cut ones), rosbag2 folders, .db3 and .mcap files.

    Several inputs are merged by time. A topic mapping makes the result a drive log that `scpf replay` takes. What
    cannot be read or converted is left out and named; exit code 3.

    Examples:

        scpf convert drive.bag -o drive.mcap --verify

        scpf convert part1.bag part2.bag -o drive.mcap -t "/camera/*" -t "re:/ins/(pose|fix)" --start 10 --end 70

        scpf convert drive.bag -o raw.mcap --encoding ros1 --split-size 2GB

        scpf convert drive.bag -o drive.mcap --mapping my-car.toml --map campus.geojson

    Parameters
    ----------
    inputs
        Recordings.
    output
        The MCAP file to write; with a split, NAME_000.mcap, NAME_001.mcap, …
    encoding
        `ros2`: CDR, which replay and viewers read. `ros1`: the bytes of ROS 1 as they are.
    include
        Only topics that match this glob, or regular expression after `re:`; may be given several times.
    exclude
        No topic that matches this; likewise.
    start
        Leave out what comes before this many seconds after the first message.
    end
        Leave out what comes after this many seconds.
    split_size
        Begin another file after this size, such as 500MB or 2GiB.
    split_duration
        Begin another file after this many seconds.
    compression
        `auto`: zstd, but for images, which it does not make smaller.
    mapping
        Topics of the drive log: watonobus, applanix, trimble, autoware, plain, a TOML file, `auto` or `none`.
    map
        Road map (GeoJSON) to attach; its origin becomes that of the poses.
    origin
        Latitude, longitude (deg) and height (m) of the origin of the poses; else the map's, else the first position.
    verify
        Read source and result again and compare every message.
    overwrite
        Replace an existing output.
    quiet
        No progress.
    format
        Form of the report on stdout.
    """
    from dataclasses import asdict

    from scpf.ingest.bag_output import Split
    from scpf.ingest.bag_report import Options
    from scpf.ingest.bags import convert as convert_bags
    from scpf.replay.convert_report import parse_origin, parse_size, print_conversion

    options = Options(
        encoding=encoding,
        include=tuple(include or ()),
        exclude=tuple(exclude or ()),
        start_s=start,
        end_s=end,
        split=Split(None if split_size is None else parse_size(split_size), split_duration),
        compression=compression,
        mapping=mapping,
        road_map=map,
        origin=None if origin is None else parse_origin(origin),
        verify=verify,
        overwrite=overwrite,
    )
    report = convert_bags(inputs, output, options, None if quiet else Counter("messages"))
    if format == "json":
        computed = {"messages": report.messages, "lossless": report.lossless, "verified": report.verified}
        print(json.dumps({**asdict(report), **computed}, indent=1))
    else:
        print_conversion(report)
    return 0 if report.lossless else 3
