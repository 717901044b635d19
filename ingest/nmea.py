"""NMEA 0183: GGA, RMC, ZDA, VTG, HDT and PASHR of any talker.

Times are UTC of a day; only RMC and ZDA say which (FORMATS, NMEA), so that days are counted on over midnight from
the last sentence that did. Sentences of one time make one row; VTG and HDT, which carry no time, belong to the
time before them. PASHR: time, heading, ``T``, roll, pitch, heave, SDs of roll, pitch and heading (deg), two flags
that vary by vendor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest import gps_time
from scpf.ingest.byte_streams import open_stream
from scpf.ingest.navigation import NativeColumn, NativeTable, Navigation, make_navigation
from scpf.ingest.nmea_sentences import Sentence, degrees, number, sentences, time_of_day, two_digit_date
from scpf.ingest.read_report import ReadOptions, ReadReport
from scpf.models.errors import DamagedError, MissingError
from scpf.models.geodesy import wrap_angle

Array = NDArray[np.float64]

KNOT_MPS: Final = 1852 / 3600
DAY_NS: Final = gps_time.DAY_S * 10**9


@dataclass
class _Log:
    """Rows by (day counted from the first, time of day in ns), in the order of the file."""

    epochs: dict[tuple[int, int], dict[str, float]] = field(default_factory=dict)
    texts: list[tuple[tuple[int, int] | None, bytes]] = field(default_factory=list)
    dates: list[tuple[int, int]] = field(default_factory=list)
    """(number of the row, Unix day minus counted day) of each sentence with a date."""
    day: int = 0
    time_ns: int | None = None

    def epoch(self, time_ns: int) -> dict[str, float]:
        """The row of a time of day; half a day back is the next day."""
        if self.time_ns is not None:
            step = time_ns - self.time_ns
            self.day += int(step < -DAY_NS // 2) - int(step > DAY_NS // 2)
        self.time_ns = time_ns
        return self.epochs.setdefault((self.day, time_ns), {})

    def dated(self, day: date) -> None:
        """The current row lies on this day."""
        unix_day = gps_time.unix_of(day) // gps_time.DAY_S
        self.dates.append((len(self.epochs) - 1, unix_day - self.day))


def probe(head: bytes, size: int) -> str | None:
    """Why the beginning of a stream looks like NMEA, or None."""
    kinds = {sentence.kind for sentence in sentences(head, ReadReport("", "nmea"))}
    known = sorted(kinds & set(_KINDS))
    return f"sentences {', '.join(known)} with right checksums" if {"GGA", "RMC"} & kinds else None


def read(path: Path, options: ReadOptions) -> Navigation:
    """Positions (GGA, else RMC), velocities (VTG, else RMC), attitude (PASHR, else the heading of HDT).

    Raises DamagedError where no sentence has a position, MissingError where nothing tells the date.
    """
    report = ReadReport(str(path), "nmea")
    stream = open_stream(path, report, probe)
    log = _Log()
    for sentence in sentences(stream.data, report):
        _take(log, sentence, report)
    if not log.epochs:
        text = f"{path}: no sentence with a time in {len(stream.data)} bytes, {report.bad_checksums} bad checksums"
        raise DamagedError(text, "GGA or RMC sentences are needed")
    keys = list(log.epochs)
    stamps = dict(zip(keys, _stamps(path, log, options, stream.captured_unix_s, report), strict=True))
    names = np.array([text for _, text in log.texts])
    of_text = np.array([stamps.get(key, 0) if key is not None else 0 for key, _ in log.texts], dtype=np.int64)
    native = {"nmea": NativeTable(of_text, {"sentence": NativeColumn(names, "")})}
    return _navigation(log, np.array(list(stamps.values()), dtype=np.int64), native, report)


def _navigation(
    log: _Log, stamps: NDArray[np.int64], native: dict[str, NativeTable], report: ReadReport
) -> Navigation:
    def column(name: str) -> Array:
        return np.array([row.get(name, np.nan) for row in log.epochs.values()])

    latitude, longitude, height = column("latitude"), column("longitude"), column("height")
    if not np.isfinite(height).any():
        latitude, longitude = column("rmc_latitude"), column("rmc_longitude")
        height = np.where(np.isfinite(latitude), 0.0, np.nan)
        report.notes.append("RMC alone: no heights, 0 m above the ellipsoid taken")
    # A row without a position is no damage: heading and attitude may come at their own rate.
    placed = np.isfinite(latitude)
    report.leave("time without a position", int((~placed).sum()))
    heights = int((np.isfinite(height) & ~np.isfinite(column("separation")) & placed).sum())
    if heights and np.isfinite(column("height")).any():
        report.notes.append(
            f"{heights} GGA without geoid separation: heights above sea level, not the ellipsoid"
        )
    speed = np.where(np.isfinite(column("speed")), column("speed"), column("rmc_speed"))
    track = np.radians(np.where(np.isfinite(column("track")), column("track"), column("rmc_track")))
    heading = np.where(np.isfinite(column("heading")), column("heading"), column("hdt"))
    columns = {
        "velocity_enu_mps": np.column_stack(
            [speed * np.sin(track), speed * np.cos(track), np.full(len(speed), np.nan)]
        ),
        "roll_rad": np.radians(column("roll")),
        "pitch_rad": np.radians(column("pitch")),
        "heading_rad": wrap_angle(np.radians(heading)),
        "attitude_rms_rad": np.radians(
            np.column_stack([column("roll_sd"), column("pitch_sd"), column("heading_sd")])
        ),
    }
    kept = {name: values[placed] for name, values in columns.items()}
    return make_navigation(
        report, stamps[placed], (latitude[placed], longitude[placed], height[placed]), native, kept
    )


def _take(log: _Log, sentence: Sentence, report: ReadReport) -> None:
    """Put a sentence into its row; one with unreadable fields is counted."""
    key = None
    if sentence.kind not in _KINDS:
        report.leave(f"NMEA {sentence.kind}")
    else:
        try:
            _KINDS[sentence.kind](log, sentence.fields, report)
        except (ValueError, IndexError):
            report.drop(f"{sentence.kind} whose fields cannot be read")
    if log.time_ns is not None:
        key = (log.day, log.time_ns)
    log.texts.append((key, sentence.text))


def _gga(log: _Log, f: list[str], report: ReadReport) -> None:
    time_ns, quality = time_of_day(f[0]), int(f[5] or 0)
    position = degrees(f[1], f[2], "NS", 90), degrees(f[3], f[4], "EW", 180)
    height, separation = number(f[8]), number(f[10])
    row = log.epoch(time_ns)
    if quality == 0 or np.isnan(position).any():
        report.drop("GGA without a fix")
        return
    row["latitude"], row["longitude"] = position
    row["separation"] = separation
    row["height"] = height + (0.0 if np.isnan(separation) else separation)


def _rmc(log: _Log, f: list[str], report: ReadReport) -> None:
    time_ns = time_of_day(f[0])
    position = degrees(f[2], f[3], "NS", 90), degrees(f[4], f[5], "EW", 180)
    speed, track = number(f[6]), number(f[7])
    day = two_digit_date(f[8]) if f[8] else None
    row = log.epoch(time_ns)
    if f[1] != "A":
        report.leave("RMC that calls itself void")
        return
    row["rmc_latitude"], row["rmc_longitude"] = position
    row["rmc_speed"], row["rmc_track"] = speed * KNOT_MPS, track
    if day is not None:
        log.dated(day)


def _zda(log: _Log, f: list[str], report: ReadReport) -> None:
    time_ns, day = time_of_day(f[0]), date(int(f[3]), int(f[2]), int(f[1]))
    log.epoch(time_ns)
    log.dated(day)


def _vtg(log: _Log, f: list[str], report: ReadReport) -> None:
    track, knots = number(f[0]), number(f[4])
    if log.time_ns is not None:
        log.epochs[log.day, log.time_ns] |= {"track": track, "speed": knots * KNOT_MPS}


def _hdt(log: _Log, f: list[str], report: ReadReport) -> None:
    heading = number(f[0])
    if log.time_ns is not None:
        log.epochs[log.day, log.time_ns]["hdt"] = heading


def _pashr(log: _Log, f: list[str], report: ReadReport) -> None:
    time_ns = time_of_day(f[0])
    names = ("heading", "", "roll", "pitch", "heave", "roll_sd", "pitch_sd", "heading_sd")
    values = {name: number(text) for name, text in zip(names, f[1:9], strict=True) if name}
    log.epoch(time_ns).update(values)


_KINDS: Final[dict[str, Callable[[_Log, list[str], ReadReport], None]]] = {
    "GGA": _gga,
    "RMC": _rmc,
    "ZDA": _zda,
    "VTG": _vtg,
    "HDT": _hdt,
    "PASHR": _pashr,
}


def _stamps(
    path: Path, log: _Log, options: ReadOptions, captured_unix_s: float | None, report: ReadReport
) -> NDArray[np.int64]:
    """Unix ns of every row: each day from the last sentence with a date, or the first for those before it."""
    keys = np.array(list(log.epochs), dtype=np.int64)
    if log.dates:
        rows, bases = np.array(log.dates, dtype=np.int64).T
        latest = np.maximum(np.searchsorted(rows, np.arange(len(keys)), side="right") - 1, 0)
        base = bases[latest]
        if options.date is not None:
            report.notes.append("the date given is not used: the sentences carry theirs")
    elif options.date is not None:
        base = np.full(len(keys), gps_time.unix_of(options.date) // gps_time.DAY_S - keys[0, 0])
    elif captured_unix_s is not None:
        day = round((captured_unix_s - keys[0, 1] * 1e-9) / gps_time.DAY_S)
        base = np.full(len(keys), day - keys[0, 0])
        report.notes.append(
            f"date {datetime.fromtimestamp(day * gps_time.DAY_S, UTC):%Y-%m-%d} of the capture"
        )
    else:
        hint = "give the date of the drive: there is no RMC and no ZDA sentence with one"
        raise MissingError(f"{path}: the date is not known", hint)
    stamps: NDArray[np.int64] = (keys[:, 0] + base) * DAY_NS + keys[:, 1]
    return stamps
