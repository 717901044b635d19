"""Encoders of Applanix' binary formats for the tests, written from the format notes and not from the readers.

Values are those of a drive: ``drive(n)`` gives them, the encoders put them into bytes, and the tests compare what
the readers say with the drive.
"""

from __future__ import annotations

import struct
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GPS_EPOCH = datetime(1980, 1, 6, tzinfo=UTC)
LEAP = 18


class Drive(NamedTuple):
    """Truth: unix_s (N,), degrees, metres, m/s (north, east, down), roll, pitch, heading (deg)."""

    unix_s: Array
    latitude: Array
    longitude: Array
    height: Array
    velocity_ned: Array
    attitude_deg: Array

    def week(self, k: int) -> int:
        return int(self.gps_s(k) // 604800)

    def gps_s(self, k: int) -> float:
        return float(self.unix_s[k]) - GPS_EPOCH.timestamp() + LEAP

    def tow(self, k: int) -> float:
        return self.gps_s(k) % 604800


def drive(n: int, start: datetime = datetime(2021, 6, 15, 18, 30, tzinfo=UTC), rate: float = 10.0) -> Drive:
    """A straight drive at 10 m/s towards 70°, in Waterloo."""
    t = np.arange(n) / rate
    heading = np.radians(70.0)
    north, east = 10.0 * np.cos(heading), 10.0 * np.sin(heading)
    latitude0 = np.radians(43.4723)
    curvature = 1.0 - 6.69437999014e-3 * np.sin(latitude0) ** 2
    meridian = 6378137.0 * (1.0 - 6.69437999014e-3) / curvature**1.5
    normal = 6378137.0 / np.sqrt(curvature)
    return Drive(
        start.timestamp() + t,
        43.4723 + np.degrees(north * t / (meridian + 300.0)),
        -80.5449 + np.degrees(east * t / ((normal + 300.0) * np.cos(latitude0))),
        300.0 + 0.1 * t,
        np.tile([north, east, -0.1], (n, 1)),
        np.column_stack([0.5 + 0.01 * t, -0.25 * np.ones(n), 70.0 + 0.001 * t]),
    )


def sbet(d: Drive, wander: float = -0.02) -> bytes:
    """17 little-endian doubles: velocities North-West-Up turned by the wander, platform heading."""
    out = b""
    for k in range(len(d.unix_s)):
        vn, ve, vd = d.velocity_ned[k]
        c, s = np.cos(wander), np.sin(wander)
        # (north, west) = R(wander) (x, y), hence (x, y) = R(−wander) (north, west).
        x, y = c * vn + s * -ve, -s * vn + c * -ve
        roll, pitch, heading = np.radians(d.attitude_deg[k])
        place = (np.radians(d.latitude[k]), np.radians(d.longitude[k]), d.height[k])
        values = (d.tow(k), *place, x, y, -vd, roll, pitch, heading + wander, wander, 1, 2, 3, 0.1, 0.2, 0.3)
        out += struct.pack("<17d", *values)
    return out


def smrmsg(d: Drive, every: int = 10) -> bytes:
    """10 little-endian doubles: the accuracies are told apart by their values."""
    rms = (0.01, 0.02, 0.03, 0.004, 0.005, 0.006, 0.6, 1.2, 3.0)
    return b"".join(struct.pack("<10d", d.tow(k), *rms) for k in range(0, len(d.unix_s), every))


def gsof_record(kind: int, body: bytes) -> bytes:
    return struct.pack(">BB", kind, len(body)) + body


def gsof_49(d: Drive, k: int, week: int | None = None) -> bytes:
    ms = round(d.tow(k) * 1000)
    vn, ve, vd = d.velocity_ned[k]
    head = struct.pack(">HI2B", d.week(k) if week is None else week, ms, 4, 4)
    place = struct.pack(">3d", d.latitude[k], d.longitude[k], d.height[k])
    speed = struct.pack(">4f", vn, ve, vd, np.hypot(vn, ve))
    return head + place + speed + struct.pack(">3dd6f", *d.attitude_deg[k], 70.0, 1, 2, 3, 0.1, 0.2, 0.3)


def gsof_50(d: Drive, k: int) -> bytes:
    rms = (0.01, 0.02, 0.03, 0.004, 0.005, 0.006, 0.01, 0.02, 0.05)
    return struct.pack(">HI2B9f", d.week(k), round(d.tow(k) * 1000), 4, 4, *rms)


def gsof_16(d: Drive, k: int, offset: int = LEAP) -> bytes:
    return struct.pack(">IHHB", round(d.tow(k) * 1000), d.week(k), offset, 3)


def gsof_packets(records: bytes, number: int, page_bytes: int = 0xF7) -> list[bytes]:
    """The pages of one transmission."""
    parts = [records[i : i + page_bytes] for i in range(0, len(records), page_bytes)] or [b""]
    out = []
    for page, part in enumerate(parts):
        data = bytes([number % 256, page, len(parts) - 1]) + part
        middle = bytes([0, 0x40, len(data)]) + data
        out.append(b"\x02" + middle + bytes([sum(middle) % 256]) + b"\x03")
    return out


def gsof(d: Drive, page_bytes: int = 0xF7) -> bytes:
    """A stream of 16, 49 and 50 in each transmission."""
    out = b""
    for k in range(len(d.unix_s)):
        records = (
            gsof_record(16, gsof_16(d, k)) + gsof_record(49, gsof_49(d, k)) + gsof_record(50, gsof_50(d, k))
        )
        out += b"".join(gsof_packets(records, k, page_bytes))
    return out


def pos_message(kind: bytes, number: int, content: bytes) -> bytes:
    """A $GRP or $MSG with padding and checksum."""
    content += b"\0" * (-(len(content) + 4) % 4)
    start = kind + struct.pack("<HH", number, len(content) + 4) + content
    total = sum(struct.unpack(f"<{len(start) // 2}H", start)) + struct.unpack("<H", b"$#")[0]
    return start + struct.pack("<H", -total % 65536) + b"$#"


def grp_head(d: Drive, k: int, types: int = 0x01) -> bytes:
    """Time 1 is GPS time, time 2 the time since power-on."""
    return struct.pack("<dddBB", d.tow(k), 100.0 + k, 0.0, types, 1)


def grp_1(d: Drive, k: int) -> bytes:
    vn, ve, vd = d.velocity_ned[k]
    body = struct.pack("<ddd", d.latitude[k], d.longitude[k], d.height[k])
    body += struct.pack("<fff", vn, ve, vd) + struct.pack("<dddd", *d.attitude_deg[k], 0.0)
    return body + struct.pack("<ff", 70.0, 10.0) + struct.pack("<ffffffB", 1, 2, 3, 0.1, 0.2, 0.3, 0)


def grp_2() -> bytes:
    return struct.pack("<12f", 0.01, 0.02, 0.03, 0.004, 0.005, 0.006, 0.01, 0.02, 0.05, 0, 0, 0)


def grp_3(week: int, offset: float, satellites: int = 2) -> bytes:
    channels = b"\x07" * (20 * satellites)
    tail = struct.pack("<fffHId", 0.6, 0.8, 0.0, 65535, week, offset) + struct.pack(
        "<ffHI", 0.1, -34.5, 16, 0
    )
    return struct.pack("<bBH", 2, satellites, len(channels)) + channels + tail


def grp(d: Drive, offset: float = LEAP, group_3: bool = True) -> bytes:
    """Group 1 at every time; groups 2, 3 and a message the decoder does not know once in ten."""
    out = b""
    for k in range(len(d.unix_s)):
        out += pos_message(b"$GRP", 1, grp_head(d, k) + grp_1(d, k))
        if k % 10 == 0:
            out += pos_message(b"$GRP", 2, grp_head(d, k) + grp_2())
            out += pos_message(b"$MSG", 50, b"\0" * 4)
            if group_3:
                out += pos_message(b"$GRP", 3, grp_head(d, k) + grp_3(d.week(k), offset))
    return out
