"""What ``scpf convert`` prints, and how it reads a size."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from scpf.models.errors import UsageError
from scpf.replay.ingest_reports import plain

if TYPE_CHECKING:
    from scpf.ingest.bag_report import ConversionReport
    from scpf.models.geodesy import Origin

_UNITS: Final = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "t": 10**12}
_SIZE: Final = re.compile(r"([0-9]+(?:\.[0-9]+)?)\s*([kmgt]?)(i?)b?", re.IGNORECASE)
MAX_LINES: Final = 50


def parse_size(text: str) -> int:
    """Bytes of a size such as ``500MB``, ``2GiB`` or ``1000000``. UsageError for anything else."""
    match = _SIZE.fullmatch(text.strip())
    if match is None:
        raise UsageError(f"--split-size {text!r} is not a size", "such as 500MB, 2GiB or 1000000")
    power = list(_UNITS).index(match[2].lower())
    return round(float(match[1]) * (1024**power if match[3] else _UNITS[match[2].lower()]))


def parse_origin(place: tuple[float, float, float]) -> Origin:
    """The origin of the poses. UsageError for a place that is not on the earth."""
    from scpf.models.geodesy import Origin

    latitude, longitude, height = place
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and abs(height) < 1e5):
        raise UsageError(
            f"--origin {latitude:g} {longitude:g} {height:g}",
            "latitude and longitude in degrees, height in m",
        )
    return Origin(latitude, longitude, height)


def print_conversion(report: ConversionReport) -> None:
    """The report of a conversion, topic by topic."""
    print(f"{', '.join(report.paths)}: {report.messages} messages, {report.encoding}")
    width = max((len(plain(topic)) for topic in (*report.topics, *report.derived)), default=0)
    for topic in report.topics.values():
        count = f"{topic.written:8d} of {topic.counted:<8d}"
        print(f"  {plain(topic.topic):{width}}  {count}  {plain(topic.type)}")
        if topic.renamed_to:
            print(f"  {'':{width}}  is {topic.renamed_to}")
        if topic.problem:
            print(f"  {'':{width}}  lost: {plain(topic.problem)}")
    for name, number in report.derived.items():
        print(f"  {name:{width}}  {number:8d}              by the mapping {plain(report.mapping)}")
    if report.left_out:
        print(f"  left out as asked: {plain(', '.join(report.left_out))}")
    for kind, lines in (("lost", report.losses), ("note", report.notes)):
        for line in lines[:MAX_LINES]:
            print(f"  {kind}: {plain(line)}")
        if len(lines) > MAX_LINES:
            print(f"  {kind}: {len(lines) - MAX_LINES} more (--format json lists them)")
    _print_comparisons(report)


def _print_comparisons(report: ConversionReport) -> None:
    if report.comparisons is None:
        return
    wrong = [found for found in report.comparisons if not found.equal]
    for found in wrong:
        print(
            f"  differs: {plain(found.topic)}: {found.source} messages in the source, {found.output} in the output"
        )
    ways = sorted({found.compared for found in report.comparisons})
    right = sum(found.source for found in report.comparisons if found.equal)
    topics = len(report.comparisons) - len(wrong)
    print(f"  verified: {right} messages of {topics} topics equal their source ({', '.join(ways)})")
