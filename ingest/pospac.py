"""The ASCII export of POSPac (POS Export Utility).

Layout (FORMATS, POSPac ASCII export; as a published header has it): a block of header lines with ``Date of
Mission:`` and the mapping frame, a line of column names with commas, a line of units in parentheses, then rows of
numbers with blanks. Columns are found by name, whatever their order. The heading is taken as true.
"""

from __future__ import annotations

import re
from datetime import date
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest import gps_time
from scpf.ingest.navigation import NativeColumn, NativeTable, Navigation, make_navigation
from scpf.ingest.read_report import ReadOptions, ReadReport
from scpf.ingest.text_tables import MAX_COLUMNS, header_lines, read_head, read_rows
from scpf.models import grids
from scpf.models.errors import DamagedError, MissingError
from scpf.models.geodesy import wrap_angle

Array = NDArray[np.float64]

_HINT: Final = (
    "export with TIME, LATITUDE and LONGITUDE (or EASTING and NORTHING), ELLIPSOID HEIGHT and HEADING"
)
_NUMBER: Final = r"\s*[:=]\s*([-+0-9.eE]+)"
_FRAME: Final = {
    "central_meridian_deg": "central meridian",
    "origin_latitude_deg": "latitude of the grid origin",
    "scale": "grid scale factor",
    "false_easting_m": "false easting",
    "false_northing_m": "false northing",
}
_UNITS: Final = (
    (("TIME",), "s"),
    (("LATITUDE", "LONGITUDE"), "deg"),
    (("ROLL", "PITCH", "HEADING"), "angle"),
    (("VELOCITY",), "m/s"),
    (("EASTING", "NORTHING", "HEIGHT", "DISTANCE", "EAST SD", "NORTH SD"), "m"),
)


def probe(head: bytes, size: int) -> str | None:
    """Why the beginning of a file looks like a POSPac export, or None."""
    lines = header_lines(head)
    found = _names_line(lines)
    if found is None:
        return None
    by_name = any("POS Export Utility" in line for line in lines)
    return (
        "header of the POS Export Utility" if by_name else "POSPac column names"
    ) + f" in line {found + 1}"


def read(path: Path, options: ReadOptions) -> Navigation:
    """The navigation of an export. Raises DamagedError naming the line, MissingError without week or date."""
    lines = header_lines(read_head(path))
    at = _names_line(lines)
    if at is None:
        raise DamagedError(
            f"{path}: no line of column names with TIME in the first {len(lines)} lines", _HINT
        )
    if len(_split(lines[at])) > MAX_COLUMNS:
        raise DamagedError(f"{path}:{at + 1}: more than {MAX_COLUMNS} columns", _HINT)
    names = _unique([name.strip().upper() for name in _split(lines[at])])
    start = next((k for k in range(at + 1, len(lines)) if re.match(r"\s*[-+]?[0-9.]", lines[k])), len(lines))
    unit_line = " ".join(lines[at + 1 : start])
    rows = read_rows(path, start, len(names), None)
    report = ReadReport(str(path), "pospac", total_bytes=path.stat().st_size, records=len(rows))
    columns = {name: np.ascontiguousarray(rows[:, k]) for k, name in enumerate(names)}
    stamps = _stamps(str(path), columns["TIME"], "\n".join(lines[:at]), unit_line, options, report)
    angle = "rad" if re.search(r"orientation angles[^,()]*in\s+rad", unit_line, re.IGNORECASE) else "deg"
    native = {
        "pospac": NativeTable(
            stamps, {name: NativeColumn(values, _unit(name, angle)) for name, values in columns.items()}
        )
    }
    with np.errstate(invalid="ignore", over="ignore"):  # damaged numbers are left out by make_navigation
        place = _place(str(path), columns, "\n".join(lines[:at]), options, report)
        return make_navigation(report, stamps, place, native, _standard(columns, angle))


def _standard(columns: dict[str, Array], angle: str) -> dict[str, Array]:
    """The standard columns that the export has."""
    scale = 1.0 if angle == "rad" else np.pi / 180.0
    triples = {
        "velocity_enu_mps": (("EAST VELOCITY", "NORTH VELOCITY", "UP VELOCITY"), 1.0),
        "position_rms_m": (("EAST SD", "NORTH SD", "HEIGHT SD"), 1.0),
        "velocity_rms_mps": (("EAST VELOCITY SD", "NORTH VELOCITY SD", "UP VELOCITY SD"), 1.0),
        "attitude_rms_rad": (("ROLL SD", "PITCH SD", "HEADING SD"), scale),
    }
    found = {
        target: np.column_stack([columns[name] for name in names]) * factor
        for target, (names, factor) in triples.items()
        if all(name in columns for name in names)
    }
    for name in ("ROLL", "PITCH", "HEADING"):
        if name in columns:
            found[f"{name.lower()}_rad"] = wrap_angle(columns[name] * scale)
    return found


def _place(
    path: str, columns: dict[str, Array], header: str, options: ReadOptions, report: ReadReport
) -> tuple[Array, Array, Array]:
    """Latitude, longitude (deg), height (m)."""
    height = columns.get("ELLIPSOID HEIGHT")
    if height is None:
        height = columns.get("ORTHOMETRIC HEIGHT")
        if height is None:
            raise DamagedError(f"{path}: no column ELLIPSOID HEIGHT", _HINT)
        report.notes.append(
            "WARNING: heights are orthometric (above the geoid), taken as above the ellipsoid"
        )
    if "LATITUDE" in columns and "LONGITUDE" in columns:
        return columns["LATITUDE"], columns["LONGITUDE"], height
    if "EASTING" not in columns or "NORTHING" not in columns:
        raise DamagedError(f"{path}: neither LATITUDE and LONGITUDE nor EASTING and NORTHING", _HINT)
    if options.utm_zone is not None:
        grid = grids.utm(options.utm_zone)
    else:
        found = {key: re.search(re.escape(text) + _NUMBER, header) for key, text in _FRAME.items()}
        values = {key: _float(match[1]) for key, match in found.items() if match is not None}
        if "central_meridian_deg" not in values:
            raise MissingError(f"{path}: the mapping frame is not known", "give the UTM zone, such as 17N")
        grid = grids.Grid(**values)
        report.notes.append(f"mapping frame of the header: {grid}")
    latitude, longitude, _ = grids.to_geodetic(grid, columns["EASTING"], columns["NORTHING"])
    return latitude, longitude, height


def _stamps(
    path: str, times: Array, header: str, unit_line: str, options: ReadOptions, report: ReadReport
) -> NDArray[np.int64]:
    known = gps_time.in_week(times)
    if not known.any():
        raise DamagedError(f"{path}: no TIME is a time of week", "export the time as GPS seconds of the week")
    first = float(times[int(np.argmax(known))])
    week = options.given_week(first)
    if week is None and (found := re.search(r"Date of Mission:\s*(\d{4})-(\d\d)-(\d\d)", header)):
        try:
            week = gps_time.week_on(date(*(int(part) for part in found.groups())), first)
            report.notes.append(f"GPS week {week} by the date of mission {found[0].split(':')[1].strip()}")
        except ValueError:
            report.notes.append(f"WARNING: {found[0]!r} is no date")
    if week is None:
        week = options.needed_week(path, first)
    utc = re.search(r"\bUTC\b", unit_line) is not None
    if utc:
        report.notes.append("times are UTC, by the line of units")
    elif float(times[known].max()) < gps_time.DAY_S:
        report.notes.append("WARNING: all times lie on the first day of the week: seconds of the day?")
    return gps_time.stamps_of_week(week, times, 0 if utc else options.leap_seconds)


def _names_line(lines: list[str]) -> int | None:
    for k, line in enumerate(lines):
        names = [name.strip().upper() for name in _split(line)]
        if names[0] == "TIME" and ("LATITUDE" in names or "EASTING" in names):
            return k
    return None


def _split(line: str) -> list[str]:
    """Names between commas, or else between tabs or at least two blanks (a name may hold one)."""
    line = line.strip()
    return line.split(",") if "," in line else re.split(r"\t+|\s{2,}", line)


def _unique(names: list[str]) -> list[str]:
    """ELLIPSOID HEIGHT comes twice: the second gets a number."""
    return [
        name if name not in names[:k] else f"{name} {names[:k].count(name) + 1}"
        for k, name in enumerate(names)
    ]


def _unit(name: str, angle: str) -> str:
    unit = next((unit for words, unit in _UNITS if any(word in name for word in words)), "")
    return angle if unit == "angle" else unit


def _float(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value) or abs(value) > 1e8:
        raise DamagedError(f"the mapping frame says {text!r}", "give the UTM zone, such as 17N")
    return value
