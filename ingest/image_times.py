"""When each picture was taken: from names, EXIF, a sidecar, a stated rate, or the video itself."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta, timezone
from pathlib import Path, PurePath
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.image_names import Counters, begin_in_name, counters, stamp_in_name
from scpf.ingest.images import parse_time
from scpf.ingest.pictures import Picture
from scpf.ingest.raw_images import DAMAGE, PILLOW_FORMATS
from scpf.ingest.sidecar import UNITS, read_sidecar
from scpf.models.errors import InputError, UsageError

Stamps = NDArray[np.int64]

LAST_NS: Final = 2**31 * 10**9
"""Stamps of ROS messages have 31 bits of seconds: to January 2038."""
_EXIF_TIMES: Final = ((36867, 37521, 36881), (306, 37520, 36880))
"""Tags of date, fraction and offset from UTC: of the exposure, then of the file."""
_CHANGES_SHOWN: Final = 5


@dataclass
class Timed:
    """Pictures with times that increase. ``dropped``: why and how many were left out; ``notes``: what was found."""

    pictures: list[Picture]
    stamps_ns: Stamps
    dropped: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def from_names(pictures: Sequence[Picture]) -> list[int | None]:
    """Times out of ROS-style names. Raises InputError where fewer than half of the names hold one."""
    stamps = [stamp_in_name(PurePath(picture.name).stem) for picture in pictures]
    if sum(stamp is not None for stamp in stamps) * 2 < len(stamps):
        begin = begin_in_name(PurePath(pictures[0].name).stem)
        hint = "give --timestamps, or --rate"
        if begin is not None:
            hint += (
                "; the date in the name is when the recording began: --start-time name uses it with --rate"
            )
        raise InputError(f"{pictures[0].name}: no time in the name", hint)
    return stamps


def from_exif(paths: Sequence[Path], notes: list[str]) -> list[int | None]:
    """Times out of EXIF: DateTimeOriginal, SubSecTimeOriginal, OffsetTimeOriginal (UTC where there is none)."""
    found = [_exif(path) for path in paths]
    if sum(stamp is not None for stamp, _ in found) * 2 < len(found):
        raise InputError(f"{paths[0]}: no EXIF time (DateTimeOriginal)", "give --timestamps, or --rate")
    without = sum(stamp is not None and not zoned for stamp, zoned in found)
    if without:
        notes.append(f"{without} EXIF times without an offset from UTC: taken as UTC")
    return [stamp for stamp, _ in found]


def from_rate(names: Sequence[str], rate_hz: float, start: str) -> list[int | None]:
    """Times at a fixed rate. Missing counters take their time: what was dropped does not shift the rest.

    ``start``: time of the first image (UTC), or ``name`` for the one in Basler's names.
    """
    if not 0.0 < rate_hz < 1e6:
        raise UsageError(f"an image rate of {rate_hz} Hz", "give a positive rate, such as 13")
    start_ns = start_time(start, names[0])
    numbers = counters([PurePath(name).stem for name in names])
    positions = range(len(names)) if numbers is None else numbers.positions()
    if positions[-1] * (1e9 / rate_hz) >= LAST_NS:
        raise InputError(f"{names[-1]} is frame {positions[-1]}, years after the first", "check the names")
    return [start_ns + round(position * 1e9 / rate_hz) for position in positions]


def start_time(text: str, first_name: str) -> int:
    """``--start-time`` in ns: seconds, ns, a date, or ``name``. Raises InputError."""
    if text != "name":
        return parse_time(text, "--start-time")
    begin = begin_in_name(PurePath(first_name).stem)
    if begin is None:
        raise InputError(f"{first_name}: no date of the form 20220818_183353703 in the name", "give the time")
    return begin


def from_sidecar(path: Path, names: Sequence[str], unit: str | None, notes: list[str]) -> list[int | None]:
    """Times of a sidecar file, as ``read_sidecar`` finds them."""
    sidecar = read_sidecar(path, names, unit)
    notes += sidecar.notes
    return sidecar.stamps_ns


def clock_offset_ns(text: str, unit: str | None) -> int:
    """What ``--clock-offset`` adds to each stamp, in ns.

    ``DEVICE=UTC`` is one moment by the camera's clock (a plain number in ``unit``, ns if not said) and in UTC; a
    number alone is seconds to add. Raises UsageError.
    """
    device, pair, utc = text.partition("=")
    try:
        if not pair:
            return round(float(text) * 1e9)
        if not re.fullmatch(r"\s*[0-9]{1,19}(\.[0-9]{0,9})?\s*", device):
            raise ValueError(f"{device[:40]!r} is not a number")
        whole, _, fraction = device.strip().partition(".")
        scale = UNITS[unit or "ns"]
        device_ns = int(whole) * scale + int((fraction or "0").ljust(9, "0")) * scale // 10**9
        return parse_time(utc.strip(), "--clock-offset") - device_ns
    except (ValueError, OverflowError, KeyError, InputError) as error:
        hint = "give DEVICE=UTC, such as 52000123456789=1660847613.703, or seconds to add"
        raise UsageError(f"--clock-offset {text[:60]!r} ({error})", hint) from error


def settle(
    pictures: Sequence[Picture], stamps: Sequence[int | None], offset_ns: int = 0, notes: Sequence[str] = ()
) -> Timed:
    """Pictures with their times, those without a time, or whose time does not increase, left out and counted.

    Raises InputError where that would be more than half of them, and for times that a log cannot hold.
    """
    timed = Timed([], np.zeros(0, dtype=np.int64), notes=list(notes))
    kept: list[int] = []
    complaints: list[str] = []
    last_ns: int | None = None
    for picture, stamp in zip(pictures, stamps, strict=True):
        if stamp is None:
            reason = "image without a time"
        elif last_ns is not None and stamp <= last_ns:
            reason = (
                "image with the time of the one before"
                if stamp == last_ns
                else "image with an earlier time than one before"
            )
        else:
            last_ns = stamp
            kept.append(stamp + offset_ns)
            timed.pictures.append(picture)
            continue
        timed.dropped[reason] = timed.dropped.get(reason, 0) + 1
        complaints.append(f"{picture.name}: {reason}")
    if not kept or len(kept) * 2 < len(pictures):
        first = complaints[0] if complaints else "no image"
        raise InputError(
            f"{len(complaints)} of {len(pictures)} images have no time of their own ({first})",
            "are these the times of these images, in the right unit and order?",
        )
    if min(kept) < 0 or max(kept) >= LAST_NS:
        wrong = min(kept) if min(kept) < 0 else max(kept)
        hint = "is the unit right? see --time-unit and --clock-offset"
        raise InputError(f"a time of {wrong} ns since 1970 does not fit a log", hint)
    timed.stamps_ns = np.array(kept, dtype=np.int64)
    timed.notes += complaints[:_CHANGES_SHOWN]
    if len(complaints) > _CHANGES_SHOWN:
        timed.notes.append(f"and {len(complaints) - _CHANGES_SHOWN} more images left out")
    return timed


def missing_frames(names: Sequence[str]) -> tuple[int, list[str]]:
    """How many frames the counters in the names lack, and where, in words."""
    found: Counters | None = counters([PurePath(name).stem for name in names])
    if found is None or not found.missing:
        return 0, []
    notes = [f"counter jumps from {a} to {b}: {count} frames dropped" for a, b, count in found.gaps]
    more = len(notes) - _CHANGES_SHOWN
    return found.missing, notes[:_CHANGES_SHOWN] + ([f"and {more} more jumps"] if more > 0 else [])


def _exif(path: Path) -> tuple[int | None, bool]:
    """The time of a picture in ns, and whether the file says how far that is from UTC."""
    from PIL import Image

    try:
        with Image.open(path, formats=PILLOW_FORMATS) as image:
            exif = image.getexif()
            tags: dict[int, Any] = {**exif, **exif.get_ifd(0x8769)}
    except (*DAMAGE, Image.DecompressionBombError):
        return None, False
    for date_tag, fraction_tag, offset_tag in _EXIF_TIMES:
        date, fraction, offset = (
            str(tags.get(tag, "")).strip("\0 ") for tag in (date_tag, fraction_tag, offset_tag)
        )
        try:
            moment = datetime.strptime(date, "%Y:%m:%d %H:%M:%S")
        except ValueError:
            continue
        zone = re.fullmatch(r"([+-])([0-9]{2}):([0-9]{2})", offset)
        minutes = 0 if zone is None else int(zone[2]) * 60 + int(zone[3])
        if minutes >= 24 * 60:
            return None, False
        sign = -1 if zone is not None and zone[1] == "-" else 1
        moment = moment.replace(tzinfo=timezone(sign * timedelta(minutes=minutes)))
        part = fraction[:9] if re.fullmatch(r"[0-9]+", fraction) else ""
        return int(moment.timestamp()) * 10**9 + int(part.ljust(9, "0")), zone is not None
    return None, False
