"""What ``scpf ingest`` and ``info`` print: reports on stdout, a counter on stderr."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scpf.ingest.assembly_report import AssemblyReport
    from scpf.ingest.inspect import LogInfo
    from scpf.ingest.read_report import ReadReport
    from scpf.ingest.reference import Reference

MAX_SHOWN = 200
"""Characters shown of a name that comes out of a file."""


def plain(text: str) -> str:
    """Text out of a file, safe to print: no control characters that a terminal would obey, and not endless."""
    shown = "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in text[:MAX_SHOWN])
    return shown + ("…" if len(text) > MAX_SHOWN else "")


class Counter:
    """A counter on stderr, ten times a second at most, and only on a terminal."""

    def __init__(self, what: str) -> None:
        self._what = what
        self._shown = sys.stderr.isatty()
        self._last_s = 0.0

    def __call__(self, done: int, total: int) -> None:
        import time

        now_s = time.monotonic()
        if self._shown and (done >= total or now_s - self._last_s > 0.1):
            self._last_s = now_s
            end = "\n" if done >= total else ""
            print(f"\r{done} of {total} {self._what}", end=end, file=sys.stderr, flush=True)


def finish_assembly(report: AssemblyReport, reference: Reference | None, format: str) -> int:
    """Print the report of a new drive log, and of its reference; returns the exit code."""
    log = None if reference is None else reference.report
    lossless = report.lossless and (log is None or log.lossless)
    if format == "json":
        told = {**asdict(report), "reference": None if log is None else asdict(log), "lossless": lossless}
        print(json.dumps(told, indent=1, default=str))
    else:
        print_assembly(report)
        if log is not None:
            print_reading(log)
    return 0 if lossless else 3


def print_reading(report: ReadReport) -> None:
    """What a reference log held, and what could not be read of it."""
    print(f"  {report.format:<11} {report.records} records, {report.rows} poses, {report.total_bytes} bytes")
    if report.skipped_bytes or report.bad_checksums:
        print(f"  damaged     {report.skipped_bytes} bytes skipped, {report.bad_checksums} bad checksums")
    for reason, count in report.dropped.items():
        print(f"  left out    {count}: {plain(reason)}")
    if report.undecoded:
        kinds = ", ".join(sorted(report.undecoded))
        print(f"  not decoded {sum(report.undecoded.values())} messages of other kinds: {plain(kinds)}")
    for note in report.notes:
        print(f"  note        {plain(note)}")


def print_assembly(report: AssemblyReport) -> None:
    """The report of a new drive log."""
    rate = f"{1 / report.median_interval_s:.2f} Hz" if report.median_interval_s else "one image"
    if report.frames:
        print(f"{report.path}: {report.frames} images in {report.duration_s:.3f} s ({rate})")
        print(f"  reference   {report.poses} poses, {report.overlap_s:.3f} s together with the images")
    else:
        print(f"{report.path}: no images; {report.poses} reference poses in {report.duration_s:.3f} s")
    if report.poses_left_out:
        print(f"              {report.poses_left_out} poses before or after the images left out")
    if report.frames_without_pose:
        print(f"              {report.frames_without_pose} images without a reference pose")
    print(f"  map         {report.landmarks} landmarks")
    for at_s, length_s in report.gaps[:10]:
        print(f"  gap         {length_s:.3f} s after {at_s:.3f} s")
    if len(report.gaps) > 10:
        print(f"  gap         {len(report.gaps) - 10} more")
    if report.encoding:
        print(f"  encoded     as {report.encoding}")
    if report.frames_missing:
        print(f"  missing     {report.frames_missing} frames by the counters in the names")
    if report.duplicates:
        at = ", ".join(f"{at_s:.3f}" for at_s in report.duplicates_at_s)
        more = ", …" if report.duplicates > len(report.duplicates_at_s) else ""
        done = f"{report.duplicates_left_out} left out as asked" if report.duplicates_left_out else "kept"
        print(f"  duplicates  {report.duplicates} images repeat the one before ({done}), at {at}{more} s")
    for note in report.notes:
        print(f"  note        {plain(note)}")
    for reason, count in report.dropped.items():
        print(f"  dropped     {count} × {reason}")


def print_info(info: LogInfo) -> None:
    """What a log holds."""
    from datetime import UTC, datetime

    start = datetime.fromtimestamp(info.start_ns * 1e-9, UTC).isoformat(sep=" ", timespec="milliseconds")
    print(f"{info.path}: {info.size_bytes / 1e6:.1f} MB, {info.messages} messages in {info.duration_s:.3f} s")
    print(f"  start       {start}")
    print(f"  written by  {plain(info.library) or 'unknown'}, profile {plain(info.profile) or 'none'}")
    if info.camera:
        print(f"  camera      {info.camera}")
    if info.landmarks is not None:
        print(
            f"  map         {info.landmarks} landmarks, {'georeferenced' if info.origin else 'not georeferenced'}"
        )
    for name, size in info.attachments.items():
        print(f"  attachment  {plain(name)}, {size} bytes")
    for name, values in info.metadata.items():
        print(f"  metadata    {plain(name)}: {plain(', '.join(values))}")
    width = max((len(plain(topic.topic)) for topic in info.topics), default=5)
    print(f"\n  {'topic':{width}}  {'count':>8}  {'rate':>10}  {'largest gap':>11}  type")
    for topic in info.topics:
        rate = f"{topic.rate_hz:.2f} Hz" if topic.rate_hz else "–"
        gap = f"{topic.largest_gap_s:.3f} s" if topic.rate_hz else "–"
        kind = plain(topic.type or topic.encoding)
        print(f"  {plain(topic.topic):{width}}  {topic.count:8d}  {rate:>10}  {gap:>11}  {kind}")
    for finding in info.findings:
        print(f"  damaged: {plain(finding)}")
