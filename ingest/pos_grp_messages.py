"""The messages of a POS LV or POS MV: finding them in a stream, and the layouts of groups 1, 2 and 3.

Layout (FORMATS, Applanix real time): little-endian ``<4sHH`` of ``$GRP`` or ``$MSG``, id and byte count of
everything after; for a group 26 bytes of time and distance (time 1, time 2, distance tag, time types, distance
type), the body, padding to 4, a u16 checksum, ``$#``. All u16 words of a message sum to 0 modulo 65536.
"""

from __future__ import annotations

import re
import struct
from collections import defaultdict
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.byte_streams import Buffer
from scpf.ingest.read_report import ReadReport
from scpf.ingest.real_time_records import AXES

Records = NDArray[np.void]

_START: Final = re.compile(rb"\$(?:GRP|MSG)")
_HEADER: Final = struct.Struct("<4sHH")
_TAGFIELDS: Final = (
    ("time1", "<f8", "s"),
    ("time2", "<f8", "s"),
    ("distance", "<f8", "m"),
    ("time_types", "u1", ""),
    ("distance_type", "u1", ""),
)
_NAMES_2: Final = (
    "north_position_rms east_position_rms down_position_rms north_velocity_rms east_velocity_rms "
    "down_velocity_rms roll_rms pitch_rms heading_rms error_ellipse_major error_ellipse_minor "
    "error_ellipse_orientation"
)
_UNITS_2: Final = ["m"] * 3 + ["m/s"] * 3 + ["deg"] * 3 + ["m"] * 2 + ["deg"]
FIELDS: Final[dict[int, tuple[tuple[str, str, str], ...]]] = {
    1: (
        *_TAGFIELDS,
        ("latitude", "<f8", "deg"),
        ("longitude", "<f8", "deg"),
        ("altitude", "<f8", "m"),
        *((f"{axis}_velocity", "<f4", "m/s") for axis in ("north", "east", "down")),
        *((name, "<f8", "deg") for name in ("roll", "pitch", "heading", "wander_angle")),
        ("track", "<f4", "deg"),
        ("speed", "<f4", "m/s"),
        *((f"{axis}_angular_rate", "<f4", "deg/s") for axis in AXES),
        *((f"{axis}_acceleration", "<f4", "m/s²") for axis in AXES),
        ("alignment_status", "u1", ""),
    ),
    2: (*_TAGFIELDS, *zip(_NAMES_2.split(), ["<f4"] * 12, _UNITS_2, strict=True)),
    # Group 3 without its 20 bytes a satellite: solution status, satellites, then what follows the channels.
    3: (
        *_TAGFIELDS,
        ("solution_status", "i1", ""),
        ("satellites", "u1", ""),
        ("hdop", "<f4", ""),
        ("vdop", "<f4", ""),
        ("dgps_latency", "<f4", "s"),
        ("dgps_station", "<u2", ""),
        ("gps_week", "<u4", "week"),
        ("utc_offset", "<f8", "s"),
        ("message_latency", "<f4", "s"),
        ("geoidal_separation", "<f4", "m"),
        ("receiver_type", "<u2", ""),
        ("receiver_status", "<u4", ""),
    ),
}
_DTYPES: Final = {k: np.dtype([(name, kind) for name, kind, _ in fields]) for k, fields in FIELDS.items()}
_TAG_BYTES: Final = 26


class Message(NamedTuple):
    """A message whose checksum is right: ``$GRP`` or ``$MSG``, its id, and what lies before checksum and padding."""

    kind: str
    id: int
    body: bytes


def messages(data: Buffer, report: ReadReport) -> Iterator[Message]:
    """The whole and right messages of a stream; bytes between them and wrong checksums are counted."""
    offset = covered = 0
    while (found := _START.search(data, offset)) is not None:
        start = found.start()
        offset = start + 1
        if start + 8 > len(data):
            break
        _, number, count = _HEADER.unpack_from(data, start)
        end = start + 8 + count
        if count < 4 or count % 2 or end > len(data) or data[end - 2 : end] != b"$#":
            continue
        message = data[start:end]
        if int(np.frombuffer(message, dtype="<u2").sum(dtype=np.int64)) % 65536:
            report.bad_checksums += 1
            continue
        report.records += 1
        report.skipped_bytes += start - covered
        offset = covered = end
        yield Message(message[:4].decode("ascii"), number, message[8:-4])
    report.skipped_bytes += len(data) - covered


def read_tables(data: Buffer, report: ReadReport) -> dict[int, Records]:
    """Groups 1, 2 and 3 as structured arrays; the other messages are counted."""
    rows: defaultdict[int, bytearray] = defaultdict(bytearray)
    for kind, number, body in messages(data, report):
        row = _row(number, body) if kind == "$GRP" and number in _DTYPES else None
        if row is None:
            report.leave(f"{kind} {number}")
        else:
            rows[number] += row
    return {number: np.frombuffer(rows[number], dtype=dtype) for number, dtype in _DTYPES.items()}


def _row(number: int, body: bytes) -> bytes | None:
    if number == 3 and len(body) >= _TAG_BYTES + 4:
        # Status, satellites, then the byte count of the channels, then the channels: left out here.
        (channels,) = struct.unpack_from("<H", body, _TAG_BYTES + 2)
        body = body[: _TAG_BYTES + 2] + body[_TAG_BYTES + 4 + channels :]
    size = _DTYPES[number].itemsize
    return body[:size] if len(body) >= size else None
