"""What ``scpf map from`` says about the map that it made: as text, and as JSON."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scpf.ingest.map_build import MapReport
    from scpf.ingest.map_source import MapSource
    from scpf.models.road_map import RoadMap


def print_map(found: MapSource, road_map: RoadMap, report: MapReport) -> None:
    """Print the line, the landmarks by class, and all that is not in the map and why."""
    from scpf.ingest.map_source import printable

    print(f"{found.path}: {found.format}, {len(found.points)} landmarks")
    if (line := report.line) is not None:
        shape = "a closed ring" if line.closed else "open"
        print(
            f"  centre line  {line.length_m:.0f} m, {shape}, of {line.lines} pieces ({line.named_m:.0f} m in all)"
        )
        print(f"               runs {line.direction}")
        for gap_m in line.gaps_m[:10]:
            print(f"               a gap of {gap_m:.1f} m bridged")
        if len(line.gaps_m) > 10:
            print(f"               {len(line.gaps_m) - 10} more gaps bridged")
        for reason, (length_m, names) in line.off.items():
            shown = ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")
            print(f"  left off     {length_m:.0f} m, {reason}: {shown}")
        if line.repeated:
            print(f"  note         {line.repeated} stretches come twice and were counted once")
    if road_map.origin is not None:
        latitude, longitude, height = road_map.origin
        print(
            f"  origin       {latitude:.7f}°, {longitude:.7f}°, {height:.1f} m {_bracketed(report.origin_from)}"
        )
    for name, count in report.kept.most_common():
        print(f"  {printable(name):12} {count}")
    for name, count in report.far.most_common():
        print(f"  not taken    {count} {printable(name)} further than {report.within_m:g} m from the road")
    if report.other_class:
        others = ", ".join(f"{count} {printable(name)}" for name, count in report.other_class.most_common())
        print(f"  not taken    {others} (--class)")
    if report.not_selected:
        print(f"  not taken    {report.not_selected} by --select and --exclude")
    for reason, count in report.left_out.items():
        print(f"  left out     {count} × {reason}")
    for note in report.notes:
        print(f"  note         {note}")
    if road_map.attribution:
        print(f"  attribution  {printable(road_map.attribution)}")


def _bracketed(text: str) -> str:
    return f"({text})" if text else ""


def as_dict(output: Path, found: MapSource, road_map: RoadMap, report: MapReport) -> dict[str, object]:
    """The same for ``--format json``; lengths in m."""
    line = report.line
    return {
        "path": str(output),
        "source": str(found.path),
        "format": found.format,
        "origin": list(road_map.origin) if road_map.origin is not None else None,
        "origin_from": report.origin_from,
        "attribution": road_map.attribution,
        "centre_line": line
        and {
            "length_m": line.length_m, "named_m": line.named_m, "closed": line.closed, "pieces": line.lines,
            "direction": line.direction, "gaps_m": list(line.gaps_m), "repeated": line.repeated,
            "off": {why: {"length_m": length, "pieces": list(names)} for why, (length, names) in line.off.items()},
        },
        "within_m": report.within_m if report.within_m != math.inf else None,
        "landmarks": dict(report.kept),
        "far": dict(report.far),
        "other_class": dict(report.other_class),
        "not_selected": report.not_selected,
        "left_out": dict(report.left_out),
        "notes": report.notes,
        "lossless": report.lossless,
    }  # fmt: skip
