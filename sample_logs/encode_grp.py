"""$GRP messages of a POS LV: groups 1 (navigation), 2 (its RMS) and 3 (GNSS status), as it sends them by UDP.

Little-endian. Message: ``<4sHH`` ($GRP, group, bytes that follow), 26 bytes ``<dddBB`` (time 1, time 2, distance tag,
time types, distance type), body, padding to 4, u16 checksum, ``$#``; all u16 words of a message sum to 0 modulo 65536.
Time 1 is GPS seconds of week, time 2 the time since power-on. Group 1: ``<ddd fff dddd ff fff fff B``, group 2:
``<12f``. Group 3 has 20 bytes a satellite: number, state, azimuth, elevation (deg), signal to noise of L1 and L2 (dB).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scpf.sample_logs.gps_week import LEAP_SECONDS, weeks_of
from scpf.sample_logs.sensors import InsLog

RATE_HZ = 50
UDP_PORT = 5600
POWERED_ON_BEFORE_S = 754.0
TIME_TYPES = 0x01
"""Time 1 (low four bits) is GPS time, time 2 the time since power-on."""
ODOMETER = 1
FULL_NAVIGATION = 0
"""The reverse of GSOF's alignment."""
RTK_FIXED, SATELLITES, TRACKED, RECEIVER_TYPE = 8, 17, 5, 16
HDOP, VDOP, NO_STATION, GEOID_M = 0.6, 0.9, 65535, -36.0

_HEAD = struct.Struct("<dddBB")
_NAVIGATION = struct.Struct("<ddd fff dddd ff fff fff B".replace(" ", ""))
_ACCURACY = struct.Struct("<12f")
_STATUS = struct.Struct("<bBH")
_CHANNEL = struct.Struct("<HHffff")
_STATUS_END = struct.Struct("<fffHIdffHI")


class Datagram(NamedTuple):
    """What is sent at a moment (UTC, ns)."""

    stamp_ns: int
    payload: bytes


def grp(ins: InsLog, rate_hz: int = RATE_HZ) -> Iterator[Datagram]:
    """The messages of an INS log: group 1 at ``rate_hz``, groups 2 and 3 before it once a second."""
    ins = ins.at_rate(rate_hz)
    weeks, nanoseconds = weeks_of(ins.stamps_ns)
    north, east, _ = ins.velocity_ned_mps.T
    speed, track = np.hypot(north, east), np.degrees(np.arctan2(east, north)) % 360.0
    elapsed = (ins.stamps_ns - ins.stamps_ns[0]) * 1e-9
    distance = np.concatenate([[0.0], np.cumsum(speed[1:] * np.diff(elapsed))])
    for k in range(len(ins)):
        stamp, seconds = int(ins.stamps_ns[k]), float(nanoseconds[k] * 1e-9)
        head = _HEAD.pack(seconds, POWERED_ON_BEFORE_S + elapsed[k], distance[k], TIME_TYPES, ODOMETER)
        if k == 0 or stamp % 10**9 == 0:
            yield Datagram(stamp, _message(2, head + _accuracy(ins, k)))
            yield Datagram(stamp, _message(3, head + _gnss_status(int(weeks[k]))))
        place = (ins.latitude_deg[k], ins.longitude_deg[k], ins.height_m[k])
        attitude = (*ins.attitude_deg[k], 0.0, track[k], speed[k])
        inertial = (*ins.rates_degps[k], *ins.accelerations_mps2[k], FULL_NAVIGATION)
        yield Datagram(
            stamp,
            _message(1, head + _NAVIGATION.pack(*place, *ins.velocity_ned_mps[k], *attitude, *inertial)),
        )


def _accuracy(ins: InsLog, k: int) -> bytes:
    north, east, _ = ins.position_rms_m[k]
    ellipse = (max(north, east), min(north, east), 0.0 if north >= east else 90.0)
    return _ACCURACY.pack(
        *ins.position_rms_m[k], *ins.velocity_rms_mps[k], *ins.attitude_rms_deg[k], *ellipse
    )


def _gnss_status(week: int) -> bytes:
    channels = b"".join(
        _CHANNEL.pack(number, TRACKED, 360.0 * k / SATELLITES, 45.0, 44.0, 38.0)
        for k, number in enumerate(range(1, SATELLITES + 1))
    )
    latency_s, message_latency_s, receiver_status = 0.8, 0.1, 0
    quality = (HDOP, VDOP, latency_s, NO_STATION)
    clock = (week, LEAP_SECONDS, message_latency_s, GEOID_M, RECEIVER_TYPE, receiver_status)
    head = _STATUS.pack(RTK_FIXED, SATELLITES, len(channels))
    return head + channels + _STATUS_END.pack(*quality, *clock)


def _message(group: int, body: bytes) -> bytes:
    body += bytes(-(len(body) + 4) % 4)
    start = struct.pack("<4sHH", b"$GRP", group, len(body) + 4) + body
    words: NDArray[np.uint16] = np.frombuffer(start + b"$#", dtype="<u2")
    return start + struct.pack("<H", -int(words.sum(dtype=np.int64)) % 65536) + b"$#"
