"""What a reader was told, and what it says about a file: counts, losses, notes."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import date
from pathlib import Path

from scpf.ingest import gps_time
from scpf.models.errors import MissingError

WEEK_HINT = "give the GPS week or the date of the drive: this format carries the time of week only"


@dataclass(frozen=True)
class ReadOptions:
    """What a file does not say, given by the user. Everything is optional until a format needs it."""

    week: int | None = None
    """GPS week of the first record, counted from 1980 without roll-over."""
    date: date | None = None
    """UTC date of the first record: instead of the week, and for NMEA without a date."""
    leap_seconds: int | None = None
    """GPS − UTC (s); goes before the stream's own, and before the table. 0 where the times are UTC already."""
    utm_zone: str | None = None
    """Zone of eastings and northings, such as ``17N``."""
    smrmsg: Path | None = None
    """The accuracies that belong to an SBET."""
    sensor: str | None = None
    """Whose poses a CSV holds: ``camera`` (z forward, y down), ``body`` (x forward, z up), ``applanix`` (y forward)."""

    def given_week(self, first_second: float) -> int | None:
        """The week of the first record, where the user said week or date."""
        if self.week is not None:
            return gps_time.check_week(self.week)
        return None if self.date is None else gps_time.week_on(self.date, first_second)

    def needed_week(self, path: str, first_second: float) -> int:
        """The week of the first record; MissingError where nobody knows it."""
        week = self.given_week(first_second)
        if week is None:
            raise MissingError(f"{path}: the GPS week is not known", WEEK_HINT)
        return week


@dataclass
class ReadReport:
    """What was read from a file, what was not, and what was assumed."""

    path: str
    format: str
    container: str = "raw"
    """``raw``, or ``pcap`` with the flow that was read."""
    total_bytes: int = 0
    records: int = 0
    """Messages, records or lines that were whole and right."""
    rows: int = 0
    """Poses that came of them."""
    skipped_bytes: int = 0
    """Bytes that belong to no whole and right message."""
    bad_checksums: int = 0
    dropped: dict[str, int] = field(default_factory=dict)
    """Reason → how many records (or packets) could not be used."""
    undecoded: dict[str, int] = field(default_factory=dict)
    """Kind → how many messages were right, but are of a kind that this reader does not take apart."""
    notes: list[str] = field(default_factory=list)
    """What was assumed, and what looks wrong."""

    def drop(self, reason: str, count: int = 1) -> None:
        """Count records that are left out."""
        if count:
            self.dropped[reason] = self.dropped.get(reason, 0) + int(count)

    def leave(self, kind: str, count: int = 1) -> None:
        """Count messages of a kind that is not decoded."""
        if count:
            self.undecoded[kind] = self.undecoded.get(kind, 0) + int(count)

    @property
    def lossless(self) -> bool:
        """Whether nothing was damaged or left out; messages of other kinds are no loss."""
        return not (self.skipped_bytes or self.bad_checksums or self.dropped)
