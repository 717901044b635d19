"""``scpf map survey``: the landmarks of a map moved to where drives with reference poses saw them."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from math import degrees, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from scpf.replay.status_line import StatusLine

if TYPE_CHECKING:
    from scpf.models.survey import Survey
    from scpf.replay.survey_sights import SurveyInput


def map_survey(
    logs: tuple[Path, ...],
    /,
    *,
    output: Annotated[Path, Parameter(alias="-o")],
    road_map: Annotated[Path | None, Parameter(name="--map")] = None,
    segmenter: str = "polenet",
    threshold: float = 0.9,
    distance_model: str = "default",
    every: int = 1,
    map_sigma_m: float = 1.5,
    bearing_sigma_deg: float = 0.2,
    fewest: int = 15,
    overwrite: bool = False,
    quiet: Annotated[bool, Parameter(alias="-q")] = False,
    format: Literal["text", "json"] = "text",
) -> int:
    """Correct a map by drive logs with reference poses: every landmark's position estimated anew, with its variance.

    Distances and directions of all frames are matched to the old map, and once more to the new one. Prints how far each
    landmark moved and how well it is known; one that too few frames show keeps its position. Exit code 3: frames
    could not be decoded.

    Examples:

        scpf map survey drive.mcap -o surveyed.geojson

        scpf map survey mon.mcap tue.mcap -o surveyed.geojson --map campus.geojson --map-sigma-m 2

        scpf map survey drive.mcap -o surveyed.geojson --segmenter recorded --format json

    Parameters
    ----------
    logs
        Drive logs with calibration, reference trajectory and map, all in one map frame.
    output
        The map to write (.geojson).
    road_map
        Start from this map instead of the logs' own; it has to be in their frame.
    segmenter
        `polenet`, `thorough` (three looks at each picture), `recorded` (masks that the log holds), or a
        .safetensors file.
    threshold
        Detections of a lower score are left out.
    distance_model
        `default`, or a file that `scpf train distance` wrote.
    every
        Take every n-th frame.
    map_sigma_m
        How far the old map may be off, as a standard deviation an axis.
    bearing_sigma_deg
        Standard deviation of a direction at best, the reference's heading included; enlarged where the data show so.
    fewest
        Landmarks with fewer sightings keep their position.
    overwrite
        Replace an existing output.
    quiet
        No progress on stderr.
    format
        Form of the report on stdout.
    """
    from scpf.ingest.maps import read_map, write_map
    from scpf.models.errors import InputError, UsageError
    from scpf.models.survey import SurveySettings, survey
    from scpf.models.survey_fit import FitSettings
    from scpf.replay.survey_sights import read_sights

    if every < 1 or fewest < 1 or not (map_sigma_m > 0.0 and bearing_sigma_deg > 0.0):
        raise UsageError("--every, --fewest, --map-sigma-m and --bearing-sigma-deg are positive")
    if output.exists() and not overwrite:
        raise InputError(f"{output} exists", "choose another name, or give --overwrite")
    start = None if road_map is None else read_map(road_map)
    status = StatusLine(quiet)

    def say(frames: int, sightings: int) -> None:
        status.show(f"{frames} frames, {sightings} sightings")

    found = read_sights(logs, segmenter, threshold, distance_model, every, start, say)
    fit = FitSettings(bearing_deviation_rad=radians(bearing_sigma_deg))
    result = survey(found.sights, found.road_map, SurveySettings(map_sigma_m, fewest, fit=fit))
    write_map(output, result.road_map, overwrite=overwrite)
    if format == "json":
        print(json.dumps(_as_dict(output, found, result), indent=1, ensure_ascii=False, allow_nan=False))
    else:
        print(_as_text(output, found, result))
    if found.unreadable:
        print(f"scpf: {found.unreadable} of {found.frames} frames could not be decoded", file=sys.stderr)
    return 3 if found.unreadable else 0


def _as_text(output: Path, found: SurveyInput, result: Survey) -> str:
    """A row a landmark that was seen, then what was not used, and why."""
    from scpf.ingest.map_source import printable

    seen = [row for row in result.landmarks if row.sightings + row.rejected]
    width = max([8, *(len(printable(row.id)) for row in seen)])
    lines = [f"{'landmark':{width}}  moved m    σ m  sightings  effective  rejected"]
    for row in seen:
        counts = f"{row.sightings:9d}  {row.effective:9.1f}  {row.rejected:8d}"
        note = f"  kept: {row.reason}" if row.reason else ""
        lines.append(
            f"{printable(row.id):{width}}  {row.moved_m:7.2f}  {row.deviation_m:5.2f}  {counts}{note}"
        )
    moved = sum(not row.reason for row in result.landmarks)
    lines.append(f"{found.frames} frames, {len(found.sights)} sightings")
    lines.append(_errors("ranges", result.range_scale, result.range_share))
    lines.append(_errors("directions", result.bearing_scale, result.bearing_share))
    turned, deviation = degrees(result.turned_rad), degrees(result.turned_deviation_rad)
    side = "left" if turned > 0.0 else "right"
    lines.append(
        f"all directions pointed {abs(turned):.2f}° ± {deviation:.2f}° too far to the {side}: taken out"
    )
    left_out = {"fit no landmark": result.unmatched, "fit two landmarks, or two fit one": result.doubtful}
    lines += [f"left out: {n} × {why}" for why, n in {**found.dropped, **left_out}.items() if n]
    lines.append(f"{output}: {moved} of {len(result.landmarks)} landmarks surveyed, the others as they were")
    return "\n".join(lines)


def _errors(what: str, scale: float, share: float) -> str:
    return f"errors of {what}: {scale:.2f} × as large as stated, {100 * share:.0f} % of their variance lasts"


def _as_dict(output: Path, found: SurveyInput, result: Survey) -> dict[str, Any]:
    """The same for ``--format json``."""
    return {
        "path": str(output),
        "frames": found.frames,
        "unreadable_frames": found.unreadable,
        "sightings": len(found.sights),
        "dropped": dict(found.dropped),
        "unmatched": result.unmatched,
        "doubtful": result.doubtful,
        "range_scale": result.range_scale,
        "bearing_scale": result.bearing_scale,
        "range_share": result.range_share,
        "bearing_share": result.bearing_share,
        "turned_deg": degrees(result.turned_rad),
        "turned_deviation_deg": degrees(result.turned_deviation_rad),
        "landmarks": [asdict(row) for row in result.landmarks],
    }
