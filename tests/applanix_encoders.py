"""Encoders of Applanix formats for the tests, written from the format notes and not from the readers.

Values are those of a drive: ``drive(n)`` gives them, the encoders put them into bytes, and the tests compare what
the readers say with the drive. Also deterministic damage: ``mutated``.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime, timedelta
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


def nmea_sentence(body: str) -> bytes:
    check = 0
    for byte in body.encode():
        check ^= byte
    return f"${body}*{check:02X}\r\n".encode()


def nmea_bodies(d: Drive, talker: str = "IN", dated: bool = True) -> list[str]:
    """GGA, RMC (where dated), VTG, HDT and PASHR at every time."""
    out = []
    for k, unix in enumerate(d.unix_s):
        at = datetime.fromtimestamp(0, UTC) + timedelta(milliseconds=round(unix * 1000))
        clock = at.strftime("%H%M%S.") + f"{at.microsecond // 1000:03d}"
        latitude, longitude = _dm(d.latitude[k], 2), _dm(d.longitude[k], 3)
        sides = ("N" if d.latitude[k] >= 0 else "S", "E" if d.longitude[k] >= 0 else "W")
        place = f"{latitude},{sides[0]},{longitude},{sides[1]}"
        vn, ve, _ = d.velocity_ned[k]
        speed, track = np.hypot(vn, ve), np.degrees(np.arctan2(ve, vn)) % 360
        roll, pitch, heading = d.attitude_deg[k]
        out.append(f"{talker}GGA,{clock},{place},4,14,0.7,{d.height[k] + 36:.4f},M,-36.0000,M,1.0,0001")
        if dated:
            knots = speed * 3600 / 1852
            out.append(f"{talker}RMC,{clock},A,{place},{knots:.6f},{track:.5f},{at:%d%m%y},,,A")
        out.append(f"{talker}VTG,{track:.5f},T,,M,{speed * 3600 / 1852:.6f},N,{speed * 3.6:.6f},K,D")
        out.append(f"{talker}HDT,{heading + 0.5:.5f},T")
        out.append(f"PASHR,{clock},{heading:.5f},T,{roll:+.5f},{pitch:+.5f},+0.00,0.010,0.020,0.050,2,1")
    return out


def nmea(d: Drive, talker: str = "IN", dated: bool = True) -> bytes:
    return b"".join(nmea_sentence(body) for body in nmea_bodies(d, talker, dated))


def _dm(angle: float, width: int) -> str:
    degrees = int(abs(angle))
    return f"{degrees:0{width}d}{(abs(angle) - degrees) * 60:011.8f}"


POSPAC_HEADER = """\
****************************************
 POS Export Utility
 Copyright (C) 1997-2018 by Applanix Corporation      [May 17 2018]
****************************************

 Mission Start Time:
   Date of Mission: 2021-06-15
   Start Time: 18:30:00
 Mapping frame epoch: 2021.453
 Mapping frame datum: WGS84  ; Mapping frame projection : TM;
 central meridian = -81.000000 deg;
 latitude of the grid origin = 0.000000 deg; grid scale factor = 0.999600:
 false easting = 500000.000000 m; false northing = 0.000000 m;
"""
POSPAC_UNITS = (
    "\n\n  (time in Sec, distance in Meters, position in Meters, lat, long in Degrees, orientation angles "
    "and SD in Degrees, velocity in Meter/Sec, position SD in Meters)\n\n"
)


def pospac(d: Drive, columns: Sequence[str] | None = None, grid: tuple[Array, Array] | None = None) -> bytes:
    """A POSPac export; ``grid``: eastings and northings."""
    n = len(d.unix_s)
    zero = np.zeros(n)
    easting, northing = grid if grid is not None else (zero, zero)
    values = {
        "TIME": np.array([d.tow(k) for k in range(n)]),
        "DISTANCE": zero,
        "EASTING": easting,
        "NORTHING": northing,
        "ELLIPSOID HEIGHT": d.height,
        "LATITUDE": d.latitude,
        "LONGITUDE": d.longitude,
        "ROLL": d.attitude_deg[:, 0],
        "PITCH": d.attitude_deg[:, 1],
        "HEADING": d.attitude_deg[:, 2],
        "EAST VELOCITY": d.velocity_ned[:, 1],
        "NORTH VELOCITY": d.velocity_ned[:, 0],
        "UP VELOCITY": -d.velocity_ned[:, 2],
        "EAST SD": zero + 0.02,
        "NORTH SD": zero + 0.01,
        "HEIGHT SD": zero + 0.03,
        "ROLL SD": zero + 0.01,
        "PITCH SD": zero + 0.02,
        "HEADING SD": zero + 0.05,
    }
    names = list(columns or values)
    lines = [" ".join(f"{values[name][k]:.10f}" for name in names) for k in range(n)]
    return (POSPAC_HEADER + " " + ", ".join(names) + POSPAC_UNITS + "\n".join(lines) + "\n").encode()


def boreas(unix_us: Sequence[int], easting: Array, northing: Array, velocity_enu: Array, rpy: Array) -> bytes:
    """The CSV; ``rpy`` (N, 3) as the file has them."""
    lines = [
        "GPSTime,easting,northing,altitude,vel_east,vel_north,vel_up,roll,pitch,heading,angvel_z,angvel_y,angvel_x"
    ]
    for k, stamp in enumerate(unix_us):
        numbers = [easting[k], northing[k], 300.0, *velocity_enu[k], *rpy[k], 0.3, 0.2, 0.1]
        lines.append(f"{stamp}," + ",".join(repr(float(value)) for value in numbers))
    return ("\n".join(lines) + "\n").encode()


def pcap(
    packets: Iterable[tuple[float, bytes]], link: int = 1, order: str = "<", magic: int = 0xA1B2C3D4
) -> bytes:
    """A libpcap file of (Unix s, packet)."""
    out = struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 65535, link)
    unit = 1e9 if magic == 0xA1B23C4D else 1e6
    for unix, packet in packets:
        fraction = round((unix % 1) * unit)
        out += struct.pack(order + "IIII", int(unix), fraction, len(packet), len(packet)) + packet
    return out


def ethernet(network: bytes, vlan: bool = False, kind: int = 0x0800) -> bytes:
    tag = b"\x81\x00\x00\x05" if vlan else b""
    return b"\x01" * 12 + tag + struct.pack(">H", kind) + network


def ipv4(protocol: int, payload: bytes, fragment: int = 0) -> bytes:
    head = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(payload), 7, fragment, 64, protocol, 0)
    return head + bytes([192, 168, 2, 3]) + bytes([192, 168, 2, 255]) + payload


def ipv6(protocol: int, payload: bytes, options: bool = False) -> bytes:
    if options:  # one empty hop-by-hop header
        payload, protocol = bytes([protocol, 0]) + b"\x01\x04\0\0\0\0" + payload, 0
    return struct.pack(">IHBB", 6 << 28, len(payload), protocol, 64) + b"\x20" * 16 + b"\x21" * 16 + payload


def udp(payload: bytes, target: int = 5600) -> bytes:
    return struct.pack(">HHHH", 4000, target, 8 + len(payload), 0) + payload


def tcp(sequence: int, payload: bytes, flags: int = 0x18, source: int = 5017) -> bytes:
    return struct.pack(">HHIIBBHHH", source, 40000, sequence % 2**32, 0, 5 << 4, flags, 8192, 0, 0) + payload


def pcapng(packets: Iterable[tuple[float, bytes]], link: int = 1, order: str = "<") -> bytes:
    """Section, interface with nanoseconds, enhanced packets."""

    def block(kind: int, body: bytes) -> bytes:
        body += b"\0" * (-len(body) % 4)
        size = len(body) + 12
        return struct.pack(order + "II", kind, size) + body + struct.pack(order + "I", size)

    out = block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1))
    out += block(1, struct.pack(order + "HHI", link, 0, 0) + struct.pack(order + "HHB3xHH", 9, 1, 9, 0, 0))
    for unix, packet in packets:
        stamp = int(unix) * 10**9 + round(unix % 1 * 1e9)
        head = struct.pack(order + "IIIII", 0, stamp >> 32, stamp & 0xFFFFFFFF, len(packet), len(packet))
        out += block(6, head + packet)
    return out


_BLOWN_UP = (b"\xff", b"\xff\xff", b"\x7f\xff\xff\xff", b"\xff\xff\xff\xff", b"\0\0\0\0")
_NUMBERS = (np.inf, -np.inf, np.nan, 1e308, -1e308, 5e-324, 604800.0, 0.0)
_TEXTS = (
    b"e999",
    b"nan",
    b"-",
    b",",
    b"\n",
    b"\0",
    b"\xe9",
    b"1e309",
    b"99999999999999999999",
    b"inf",
    b"*",
    b"$",
)


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """The same with one to three damages: flipped bits, cuts, splices, lengths blown up, numbers no one sends."""
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 4))):
        if not out:
            break
        at, other = (int(value) for value in rng.integers(0, len(out), 2))
        size = int(rng.integers(1, 40))
        match int(rng.integers(0, 8)):
            case 0:
                out[at] ^= 1 << int(rng.integers(0, 8))
            case 1:
                del out[at:]
            case 2:
                out[at:at] = out[other : other + size]
            case 3:
                del out[at : at + size]
            case 4:
                out[at : at + 4] = _BLOWN_UP[int(rng.integers(0, len(_BLOWN_UP)))]
            case 5:
                number = _NUMBERS[int(rng.integers(0, len(_NUMBERS)))]
                out[at - at % 8 : at - at % 8 + 8] = struct.pack("<>"[int(rng.integers(0, 2))] + "d", number)
            case 6:
                out[at : at + size] = rng.bytes(size)
            case _:
                out[at : at + 1] = _TEXTS[int(rng.integers(0, len(_TEXTS)))]
    return bytes(out)
