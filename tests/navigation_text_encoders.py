"""Encoders of navigation in text for the tests: NMEA and POSPac exports of an `applanix_encoders.Drive`, and Boreas."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

import numpy as np
from applanix_encoders import Drive
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
