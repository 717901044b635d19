"""NMEA 0183 sentences: finding them in a stream, and reading their fields.

A sentence is ``$``, talker and kind, fields between commas, ``*`` and the XOR of all between the two as two hex digits.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import date
from functools import reduce
from operator import xor
from typing import Final, NamedTuple

import numpy as np

from scpf.ingest.byte_streams import Buffer
from scpf.ingest.read_report import ReadReport

_SENTENCE: Final = re.compile(
    rb"\$([A-Z][A-Z0-9]{3,7})((?:,[\x20-\x23\x25-\x29\x2b\x2d-\x7e]*)+)\*([0-9A-Fa-f]{2})"
)
MAX_SENTENCE_BYTES: Final = 256
"""The standard has 82; vendors' own sentences are longer."""


class Sentence(NamedTuple):
    """A sentence whose checksum is right: its kind (``GGA``, whatever the talker), its fields, its text."""

    kind: str
    fields: list[str]
    text: bytes


def sentences(data: Buffer, report: ReadReport) -> Iterator[Sentence]:
    """The whole and right sentences; other bytes (line ends aside) and wrong checksums are counted."""
    covered = offset = 0
    while (start := data.find(b"$", offset)) >= 0:
        line = data[start : start + MAX_SENTENCE_BYTES]
        found = _SENTENCE.match(line)
        offset = start + 1
        if found is None:
            continue
        content = line[1 : found.end() - 3]
        if reduce(xor, content) != int(found[3], 16):
            report.bad_checksums += 1
            continue
        report.records += 1
        report.skipped_bytes += _lost(data, covered, start)
        covered = offset = start + found.end()
        name = found[1].decode("ascii")
        kind = name if name.startswith("P") else name[2:]
        yield Sentence(kind, content.decode("ascii").split(",")[1:], found[0])
    report.skipped_bytes += _lost(data, covered, len(data))


def _lost(data: Buffer, start: int, end: int) -> int:
    """How many bytes, line ends aside, lie between two sentences."""
    if data[start:end] == b"\r\n":
        return 0
    lost = 0
    for at in range(start, end, 1 << 20):
        part = data[at : min(at + (1 << 20), end)]
        lost += len(part) - part.count(b"\r") - part.count(b"\n")
    return lost


def number(text: str) -> float:
    """A field; NaN where it is empty. ValueError for what no receiver sends."""
    value = float(text) if text else np.nan
    if np.isinf(value) or abs(value) > 1e9:
        raise ValueError(text)
    return value


def time_of_day(text: str) -> int:
    """Nanoseconds of the day of hhmmss.sss; a leap second is 60."""
    hours, minutes, seconds = int(text[:2]), int(text[2:4]), float(text[4:])
    if not (0 <= hours < 24 and 0 <= minutes < 60 and 0.0 <= seconds < 61.0):
        raise ValueError(text)
    return (hours * 3600 + minutes * 60) * 10**9 + round(seconds * 1e9)


def degrees(text: str, side: str, sides: str, limit: float) -> float:
    """Degrees of (d)ddmm.mmm and N, S, E or W; NaN where the field is empty."""
    if not text:
        return np.nan
    whole = text.split(".")[0]
    degrees, minutes = int(whole[:-2] or 0), float(text[len(whole) - 2 :])
    value = degrees + minutes / 60.0
    if side not in sides or not side or not 0.0 <= minutes < 60.0 or not 0.0 <= value <= limit:
        raise ValueError(text)
    return value if side == sides[0] else -value


def two_digit_date(text: str) -> date:
    """The day of ddmmyy; 80 … 99 is last century (there was no GPS before)."""
    year = int(text[4:6])
    return date(1900 + year if year >= 80 else 2000 + year, int(text[2:4]), int(text[:2]))
