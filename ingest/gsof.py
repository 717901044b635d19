"""GSOF: Trimble's general output, as a POS LVX sends it (TCP 5017) and records it.

Layout (FORMATS, Applanix real time), big-endian. Packet: 02h, status, type 40h, length, data, checksum (sum of
status … data modulo 256), 03h; the data begin with transmission number, page and last page, and the pages of a
transmission joined are records: type, length, body. A record may lie on two pages. Decoded: 49 (navigation), 50
(its RMS), 16 (UTC offset), 1 (time).
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest import gps_time
from scpf.ingest.byte_streams import Buffer, open_stream
from scpf.ingest.navigation import Navigation
from scpf.ingest.read_report import ReadOptions, ReadReport
from scpf.ingest.real_time_records import AXES, native_table, navigation_of
from scpf.models.errors import DamagedError

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
Records = NDArray[np.void]

_START: Final = re.compile(rb"\x02.\x40", re.DOTALL)
_TIME_STATUS: Final = (
    ("week", ">u2", "week"),
    ("time", ">u4", "ms of GPS week"),
    ("alignment", "u1", ""),
    ("quality", "u1", ""),
)
_FIELDS: Final[dict[int, tuple[tuple[str, str, str], ...]]] = {
    49: (
        *_TIME_STATUS,
        ("latitude", ">f8", "deg"),
        ("longitude", ">f8", "deg"),
        ("altitude", ">f8", "m"),
        *((f"{axis}_velocity", ">f4", "m/s") for axis in ("north", "east", "down")),
        ("speed", ">f4", "m/s"),
        *((name, ">f8", "deg") for name in ("roll", "pitch", "heading")),
        ("track", ">f8", "deg"),
        *((f"{axis}_angular_rate", ">f4", "deg/s") for axis in AXES),
        *((f"{axis}_acceleration", ">f4", "m/s²") for axis in AXES),
    ),
    50: (
        *_TIME_STATUS,
        *((f"{axis}_position_rms", ">f4", "m") for axis in ("north", "east", "down")),
        *((f"{axis}_velocity_rms", ">f4", "m/s") for axis in ("north", "east", "down")),
        *((f"{name}_rms", ">f4", "deg") for name in ("roll", "pitch", "heading")),
    ),
    16: (
        ("time", ">u4", "ms of GPS week"),
        ("week", ">u2", "week"),
        ("utc_offset", ">u2", "s"),
        ("flags", "u1", ""),
    ),
    1: (
        ("time", ">u4", "ms of GPS week"),
        ("week", ">u2", "week"),
        ("satellites", "u1", ""),
        ("flags_1", "u1", ""),
        ("flags_2", "u1", ""),
        ("initialisation", "u1", ""),
    ),
}
_DTYPES: Final = {k: np.dtype([(name, kind) for name, kind, _ in fields]) for k, fields in _FIELDS.items()}
FULL_NAVIGATION: Final = 4
_OFFSET_VALID: Final = 2
"""Bit of record 16's flags: the UTC offset is known."""


def packets(data: Buffer, report: ReadReport) -> Iterator[bytes]:
    """The data of the whole and right packets; bytes between them and wrong checksums are counted."""
    offset = covered = 0
    while (found := _START.search(data, offset)) is not None:
        start = found.start()
        offset = start + 1
        if start + 6 > len(data):
            break
        end = start + data[start + 3] + 6
        if data[start + 3] < 3 or end > len(data) or data[end - 1] != 3:
            continue
        packet = data[start:end]
        if sum(packet[1:-2]) % 256 != packet[-2]:
            report.bad_checksums += 1
            continue
        report.records += 1
        report.skipped_bytes += start - covered
        offset = covered = end
        yield packet[4:-2]
    report.skipped_bytes += len(data) - covered


def transmissions(data: Buffer, report: ReadReport) -> Iterator[bytes]:
    """The records of each whole transmission; pages that do not make one are counted."""
    pages: list[bytes] = []
    begun: tuple[int, int] | None = None
    for packet in packets(data, report):
        number, page, last = packet[:3]
        if page == 0 or begun != (number, last) or page != len(pages):
            report.drop("page of a transmission that is not whole", len(pages))
            pages, begun = [], (number, last)
            if page != 0 or page > last:
                report.drop("page of a transmission that is not whole")
                begun = None
                continue
        pages.append(packet[3:])
        if page == last:
            yield b"".join(pages)
            pages, begun = [], None
    report.drop("page of a transmission that is not whole", len(pages))


def probe(head: bytes, size: int) -> str | None:
    """Why the beginning of a stream looks like GSOF, or None."""
    report = ReadReport("", "gsof")
    count = sum(1 for _ in packets(head, report))
    # A packet has 24 bits to tell it by: in a large file of something else one may turn up by chance.
    share = len(head) - report.skipped_bytes
    return f"{count} packets of type 40h with right checksums" if count and share >= len(head) // 4 else None


def read(path: Path, options: ReadOptions) -> Navigation:
    """The navigation (record 49) of a stream, with the accuracies of record 50.

    Leap seconds are those of record 16 where the user gives none. Raises DamagedError for a stream without 49.
    """
    report = ReadReport(str(path), "gsof")
    stream = open_stream(path, report, probe)
    tables = _tables(stream.data, report)
    records = tables[49]
    if not len(records):
        text = f"{path}: no record 49 (navigation) in {len(stream.data)} bytes, {report.bad_checksums} bad checksums"
        raise DamagedError(text, "let the unit send INS full navigation (49)")
    offset = _utc_offset(tables[16], options, report)
    near = _near_week(records, options, stream.captured_unix_s)
    stamps = {number: _stamps(table, near, offset) for number, table in tables.items()}
    native = {
        f"gsof_{number}": native_table(
            table, stamps[number], {name: unit for name, _, unit in _FIELDS[number]}
        )
        for number, table in tables.items()
        if len(table)
    }
    aligning = int((records["alignment"] != FULL_NAVIGATION).sum())
    if aligning:
        report.notes.append(f"{aligning} of {len(records)} records are not in full navigation (alignment 4)")
    return navigation_of(report, records, stamps[49], tables[50], stamps[50], native)


def _tables(data: Buffer, report: ReadReport) -> dict[int, Records]:
    rows: defaultdict[int, bytearray] = defaultdict(bytearray)
    for body in transmissions(data, report):
        offset = 0
        while offset < len(body):
            if offset + 2 > len(body) or offset + 2 + body[offset + 1] > len(body):
                report.drop("record that is longer than its transmission")
                break
            number, size = body[offset], body[offset + 1]
            record = body[offset + 2 : offset + 2 + size]
            if number in _DTYPES and size == _DTYPES[number].itemsize:
                rows[number] += record
            else:
                known = f" of {size} bytes, not {_DTYPES[number].itemsize}" if number in _DTYPES else ""
                report.leave(f"GSOF {number}{known}")
            offset += 2 + size
    return {number: np.frombuffer(rows[number], dtype=dtype) for number, dtype in _DTYPES.items()}


def _utc_offset(records: Records, options: ReadOptions, report: ReadReport) -> int | None:
    """GPS − UTC (s): the user's, the stream's, or None for the table's."""
    if options.leap_seconds is not None:
        return options.leap_seconds
    offsets = records["utc_offset"][((records["flags"] & _OFFSET_VALID) != 0) & (records["utc_offset"] < 100)]
    if not len(offsets):
        report.notes.append("leap seconds of the table: the stream states none")
        return None
    values, counts = np.unique(offsets, return_counts=True)
    report.notes.append(f"leap seconds of the stream (record 16): {', '.join(map(str, values))}")
    return int(values[np.argmax(counts)])


def _near_week(records: Records, options: ReadOptions, captured_unix_s: float | None) -> int | None:
    """A week close to the stream's, from the user or the capture, for receivers that count modulo 1024."""
    first = float(records["time"][0]) * 1e-3
    given = options.given_week(first)
    if given is None and captured_unix_s is not None:
        return gps_time.week_near(gps_time.gps_seconds(captured_unix_s), first)
    return given


def _stamps(records: Records, near: int | None, offset: int | None) -> Stamps:
    """Unix ns of (week, ms); 0 where the week is 0, which is a receiver without the time, or none at all."""
    weeks, milliseconds = records["week"].astype(np.int64), records["time"].astype(np.int64)
    valid = (weeks > 0) & (weeks <= gps_time.MAX_WEEK) & (milliseconds < gps_time.WEEK_S * 1000)
    if near is not None:
        found, places = np.unique(weeks, return_inverse=True)
        weeks = np.array([gps_time.full_week(int(week), near) for week in found], dtype=np.int64)[places]
    gps_ns = (np.where(valid, weeks, 0) * gps_time.WEEK_S * 1000 + milliseconds) * 10**6
    return np.where(valid, gps_time.utc_ns(gps_ns, offset), 0)
