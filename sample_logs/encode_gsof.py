"""GSOF, as a POS LVX sends it: records 49 (navigation), 50 (its RMS) and 16 (UTC), in pages with checksums.

Big-endian. Packet: 02h, status, 40h, length, data, sum of status … data modulo 256, 03h. The data are transmission
number, page, last page and at most 247 bytes of the transmission's records; a record may lie on two pages. Record:
type, length, body; 49 is ``>HI2B3d3ff3dd3f3f``, 50 ``>HI2B9f``, 16 ``>IHHB``.
"""

from __future__ import annotations

import struct

import numpy as np

from scpf.sample_logs.gps_week import LEAP_SECONDS, weeks_of
from scpf.sample_logs.sensors import InsLog

RATE_HZ = 50
PAGE_BYTES = 0xFA - 3
FULL_NAVIGATION, RTK_FIXED = 4, 4
TIME_AND_OFFSET_VALID = 3

_NAVIGATION = struct.Struct(">HI2B3d3ff3dd3f3f")
_ACCURACY = struct.Struct(">HI2B9f")
_UTC = struct.Struct(">IHHB")


def gsof(ins: InsLog, rate_hz: int = RATE_HZ, page_bytes: int = PAGE_BYTES) -> bytes:
    """The stream of an INS log: 49 at ``rate_hz``, 16 and 50 before it once a second.

    Times are whole milliseconds: rates that divide 1000 lose nothing.
    """
    ins = ins.at_rate(rate_hz)
    weeks, nanoseconds = weeks_of(ins.stamps_ns)
    milliseconds = nanoseconds // 10**6
    north, east, _ = ins.velocity_ned_mps.T
    speed, track = np.hypot(north, east), np.degrees(np.arctan2(east, north)) % 360.0
    stream = []
    for k in range(len(ins)):
        week, ms = int(weeks[k]), int(milliseconds[k])
        records = b""
        if k == 0 or ms % 1000 == 0:
            accuracies = (*ins.position_rms_m[k], *ins.velocity_rms_mps[k], *ins.attitude_rms_deg[k])
            records += _record(16, _UTC.pack(ms, week, LEAP_SECONDS, TIME_AND_OFFSET_VALID))
            records += _record(50, _ACCURACY.pack(week, ms, FULL_NAVIGATION, RTK_FIXED, *accuracies))
        place = (ins.latitude_deg[k], ins.longitude_deg[k], ins.height_m[k])
        motion = (*ins.velocity_ned_mps[k], speed[k], *ins.attitude_deg[k], track[k])
        inertial = (*ins.rates_degps[k], *ins.accelerations_mps2[k])
        records += _record(
            49, _NAVIGATION.pack(week, ms, FULL_NAVIGATION, RTK_FIXED, *place, *motion, *inertial)
        )
        stream.append(_transmission(records, k % 256, page_bytes))
    return b"".join(stream)


def _record(number: int, body: bytes) -> bytes:
    return bytes([number, len(body)]) + body


def _transmission(records: bytes, number: int, page_bytes: int) -> bytes:
    pages = [records[at : at + page_bytes] for at in range(0, len(records), page_bytes)]
    packets = b""
    for page, part in enumerate(pages):
        data = bytes([number, page, len(pages) - 1]) + part
        summed = bytes([0, 0x40, len(data)]) + data
        packets += b"\x02" + summed + bytes([sum(summed) % 256]) + b"\x03"
    return packets
