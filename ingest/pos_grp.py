"""$GRP: the navigation that a POS LV or POS MV sends in real time (UDP 5600) and logs.

Groups 1 (navigation) and 2 (its RMS) are decoded, and of group 3 (GNSS status) the week and the offset to UTC.
Times are seconds of the week; which of the two times of a message is GPS time, or UTC, its time types say.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scpf.ingest import gps_time
from scpf.ingest.byte_streams import open_stream
from scpf.ingest.navigation import Navigation
from scpf.ingest.pos_grp_messages import FIELDS, messages, read_tables
from scpf.ingest.read_report import ReadOptions, ReadReport
from scpf.ingest.real_time_records import native_table, navigation_of
from scpf.models.errors import DamagedError

Array = NDArray[np.float64]
Records = NDArray[np.void]

_GPS_TIME, _UTC_TIME = 1, 2
"""Time types: the low four bits tell of time 1, the high four of time 2; 0 is the time since power-on."""


def probe(head: bytes, size: int) -> str | None:
    """Why the beginning of a stream looks like $GRP, or None."""
    report = ReadReport("", "grp")
    count = sum(message.kind == "$GRP" for message in messages(head, report))
    return f"{count} $GRP groups with right checksums in the first {len(head)} bytes" if count else None


def read(path: Path, options: ReadOptions) -> Navigation:
    """The navigation (group 1) of a stream, with the accuracies of group 2.

    Week and leap seconds are those of group 3 where the user gives none; then a capture's own time tells the
    week. Raises DamagedError for a stream without group 1, MissingError where nothing tells the week.
    """
    report = ReadReport(str(path), "grp")
    stream = open_stream(path, report, probe)
    tables = read_tables(stream.data, report)
    group1 = tables[1]
    if not len(group1):
        text = f"{path}: no group 1 (navigation) in {len(stream.data)} bytes, {report.bad_checksums} bad checksums"
        raise DamagedError(text, "let the unit send group 1")
    seconds = {number: _seconds_of_week(table) for number, table in tables.items()}
    known = gps_time.in_week(seconds[1][0])
    if not known.any():
        hint = "let the unit send GPS or UTC times, not the time since power-on alone"
        raise DamagedError(f"{path}: group 1 has neither GPS nor UTC times", hint)
    offset = _utc_offset(tables[3], options, report)
    first = float(seconds[1][0][int(np.argmax(known))])
    week = _week(str(path), options, first, tables[3], seconds[3][0], stream.captured_unix_s, report)
    stamps = {number: _stamps(week, first, *seconds[number], offset) for number in tables}
    native = {
        f"grp_{number}": native_table(table, stamps[number], {name: unit for name, _, unit in FIELDS[number]})
        for number, table in tables.items()
        if len(table)
    }
    aligning = int((group1["alignment_status"] != 0).sum())
    if aligning:
        report.notes.append(f"{aligning} of {len(group1)} records are not in full navigation (alignment 0)")
    return navigation_of(report, group1, stamps[1], tables[2], stamps[2], native)


def _seconds_of_week(table: Records) -> tuple[Array, NDArray[np.bool_]]:
    """Seconds of the week (N,), NaN where a record has none, and which of them are UTC."""
    first, second = table["time_types"] & 15, table["time_types"] >> 4
    times = np.full(len(table), np.nan)
    utc = np.zeros(len(table), dtype=np.bool_)
    for column, kinds in (("time2", second), ("time1", first)):
        for kind in (_UTC_TIME, _GPS_TIME):
            times[kinds == kind] = table[column][kinds == kind]
            utc[kinds == kind] = kind == _UTC_TIME
    return times, utc


def _utc_offset(group3: Records, options: ReadOptions, report: ReadReport) -> int | None:
    """GPS − UTC (s): the user's, the stream's, or None for the table's."""
    if options.leap_seconds is not None:
        return options.leap_seconds
    offsets = group3["utc_offset"]
    offsets = offsets[(offsets > 0) & (offsets < 100) & (offsets == np.rint(offsets))]
    if not len(offsets):
        report.notes.append("leap seconds of the table: the stream states none")
        return None
    values, counts = np.unique(offsets, return_counts=True)
    report.notes.append(
        f"leap seconds of the stream (group 3): {', '.join(f'{value:.0f}' for value in values)}"
    )
    return int(values[np.argmax(counts)])


def _week(
    path: str,
    options: ReadOptions,
    first: float,
    group3: Records,
    seconds3: Array,
    captured_unix_s: float | None,
    report: ReadReport,
) -> int:
    """The week of the first group 1."""
    given = options.given_week(first)
    if given is not None:
        return given
    weeks = group3["gps_week"].astype(np.int64)
    good = (weeks > 0) & (weeks <= gps_time.MAX_WEEK) & gps_time.in_week(seconds3)
    if good.any():
        k = int(np.argmax(good))
        week = gps_time.week_near(float(weeks[k]) * gps_time.WEEK_S + float(seconds3[k]), first)
        report.notes.append(f"GPS week {week} of the stream (group 3)")
        return week
    if captured_unix_s is not None:
        week = gps_time.week_near(gps_time.gps_seconds(captured_unix_s), first)
        report.notes.append(f"GPS week {week} from the time of the capture")
        return gps_time.check_week(week)
    return options.needed_week(path, first)


def _stamps(
    week: int, first: float, seconds: Array, utc: NDArray[np.bool_], offset: int | None
) -> NDArray[np.int64]:
    """Unix ns of a group's times; its own first may lie on the other side of a week's end than group 1's."""
    known = gps_time.in_week(seconds)
    if not known.any():
        return np.zeros(len(seconds), dtype=np.int64)
    reference = week * gps_time.WEEK_S + first
    start = gps_time.week_near(reference, float(seconds[int(np.argmax(known))]))
    stamps = gps_time.stamps_of_week(start, seconds, offset)
    if utc.any():
        stamps[utc & known] = gps_time.stamps_of_week(start, seconds, 0)[utc & known]
    return stamps
