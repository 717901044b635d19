"""GPS time and UTC: weeks, seconds of the week, leap seconds, and both kinds of roll-over.

Unix time = 315964800 + 604800·week + seconds of week − leap seconds (FORMATS, GPS time). A time of week alone
says nothing about the week: it comes from the stream, from the user, or from the time of a capture.
"""

from __future__ import annotations

from datetime import UTC, date, datetime
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

GPS_EPOCH_UNIX_S: Final = 315_964_800
"""1980-01-06T00:00:00Z, the beginning of GPS week 0."""
WEEK_S: Final = 604_800
DAY_S: Final = 86_400
SHORT_WEEKS: Final = 1024
"""Receivers that broadcast the week in 10 bits begin again at 0 after this many."""
MAX_WEEK: Final = 10_000
"""A week of the year 2171: a larger one is damage, and would run out of 64 bits of nanoseconds."""

_JULY: Final = (1981, 1982, 1983, 1985, 1992, 1993, 1994, 1997, 2012, 2015)
_JANUARY: Final = (1988, 1990, 1991, 1996, 1999, 2006, 2009, 2017)
_STEPS: Final = sorted([date(year, 7, 1) for year in _JULY] + [date(year, 1, 1) for year in _JANUARY])
"""From these days on (UTC) GPS is 1, 2, … 18 s ahead of UTC (IERS Bulletin C)."""


def unix_of(day: date) -> int:
    """Unix seconds of a day's beginning, UTC."""
    return int(datetime(day.year, day.month, day.day, tzinfo=UTC).timestamp())


_UTC_STEPS: Final = np.array([unix_of(day) for day in _STEPS], dtype=np.int64)
_GPS_STEPS_NS: Final = (_UTC_STEPS - GPS_EPOCH_UNIX_S + np.arange(1, len(_STEPS) + 1)) * 10**9


def leap_seconds(unix_s: float) -> int:
    """GPS − UTC (s) at a Unix time, by the table: 15 in June 2012, 18 since 2017-01-01."""
    return int(np.searchsorted(_UTC_STEPS, unix_s, side="right"))


def utc_ns(gps_ns: Stamps, offset_s: int | None = None) -> Stamps:
    """Unix time (UTC, ns) of nanoseconds since the GPS epoch.

    ``offset_s`` is GPS − UTC where the stream or the user states it; else the table's, time by time.
    """
    offsets = np.searchsorted(_GPS_STEPS_NS, gps_ns, side="right") if offset_s is None else np.int64(offset_s)
    stamps: Stamps = np.asarray(gps_ns + (GPS_EPOCH_UNIX_S - offsets) * 10**9, dtype=np.int64)
    return stamps


def gps_seconds(unix_s: float) -> float:
    """Seconds since the GPS epoch of a Unix time, by the table."""
    return unix_s - GPS_EPOCH_UNIX_S + leap_seconds(unix_s)


def week_near(reference_gps_s: float, seconds_of_week: float) -> int:
    """The week in which ``seconds_of_week`` comes closest to a time known otherwise (s since the GPS epoch)."""
    return max(round((reference_gps_s - seconds_of_week) / WEEK_S), 0)


def week_on(day: date, seconds_of_week: float) -> int:
    """The week in which ``seconds_of_week`` falls on a day (or comes closest to its noon)."""
    return week_near(gps_seconds(unix_of(day) + DAY_S / 2), seconds_of_week)


def full_week(week: int, near_week: int) -> int:
    """The full week of one that may be counted modulo 1024: the one closest to ``near_week``."""
    if week >= SHORT_WEEKS:
        return week
    return max(week + SHORT_WEEKS * round((near_week - week) / SHORT_WEEKS), 0)


def check_week(week: int) -> int:
    """The week given by a user; InputError where it is none."""
    if not 0 <= week <= MAX_WEEK:
        hint = "weeks are counted from 1980-01-06 without roll-over: 2000 begins on 2018-05-06"
        raise InputError(f"{week} is not a GPS week", hint)
    return week


def in_week(seconds_of_week: Array) -> NDArray[np.bool_]:
    """Which values can be seconds of a week; some programs count on, past its end, for a while."""
    # A comparison with NaN is false, so that this also finds the values which are not numbers.
    valid: NDArray[np.bool_] = (seconds_of_week >= 0.0) & (seconds_of_week < 2.0 * WEEK_S)
    return valid


def unrolled(seconds_of_week: Array) -> Array:
    """Seconds that run on over the week's end, where the given ones (N,) fall back from 604800 to 0.

    A single value that is out of order by more than half a week is brought to its neighbours likewise.
    """
    steps = np.diff(seconds_of_week)
    turns = (steps < -WEEK_S / 2).astype(np.int64) - (steps > WEEK_S / 2)
    if not turns.any():
        return seconds_of_week
    continued: Array = seconds_of_week + WEEK_S * np.concatenate([[0], np.cumsum(turns)])
    return continued


def stamps_of_week(week: int, seconds_of_week: Array, offset_s: int | None = None) -> Stamps:
    """Unix time (UTC, ns) of seconds of the week (N,), the first of them in ``week``.

    0 where a value cannot be a time of week. Roll-overs inside are followed. Whole nanoseconds: a float holds
    the time of week to 0.1 ns.
    """
    valid = in_week(seconds_of_week)
    everything = bool(valid.all())
    seconds = unrolled(seconds_of_week if everything else seconds_of_week[valid])
    gps_ns = np.rint(seconds * 1e9).astype(np.int64) + np.int64(week) * WEEK_S * 10**9
    stamps = utc_ns(gps_ns, offset_s)
    if everything:
        return stamps
    filled = np.zeros(len(seconds_of_week), dtype=np.int64)
    filled[valid] = stamps
    return filled
