"""Pictures and their times, whichever way the two were recorded: one call for the command line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from scpf.ingest.image_sources import Source
from scpf.ingest.image_times import (
    Timed,
    clock_offset_ns,
    from_exif,
    from_names,
    from_rate,
    from_sidecar,
    missing_frames,
    settle,
    start_time,
)
from scpf.models.errors import MissingError, UsageError

TIMES: Final = ("names", "exif")


@dataclass(frozen=True)
class Clock:
    """Where times come from: a file, a rate, or ``inside`` the images (names, exif); a video has its own.

    ``start``: time of the first image, with a rate or a video: UTC, or ``name`` for Basler's names. ``unit``: of plain
    numbers in the file. ``offset``: added to each time, as ``clock_offset_ns`` reads it.
    """

    timestamps: Path | None = None
    rate_hz: float | None = None
    inside: str | None = None
    start: str = "0"
    unit: str | None = None
    offset: str | None = None


def time_pictures(source: Source, clock: Clock) -> tuple[Timed, int]:
    """The pictures with their times, and how many frames their counters lack.

    Raises UsageError for two sources of times, MissingError for none, InputError for times that do not fit.
    """
    given = [way for way in (clock.timestamps, clock.rate_hz, clock.inside) if way is not None]
    if len(given) > 1:
        raise UsageError(
            "the times come from more than one place", "give one of --timestamps, --rate, --times"
        )
    if clock.inside is not None and (clock.inside not in TIMES or source.video is not None):
        raise UsageError(
            f"--times {clock.inside} for {source.path}", f"known for folders of images: {', '.join(TIMES)}"
        )
    notes = list(source.notes)
    missing, where = (0, []) if source.video is not None else missing_frames(source.names)
    stamps: list[int | None]
    if clock.timestamps is not None:
        stamps = from_sidecar(clock.timestamps, source.names, clock.unit, notes)
    elif clock.rate_hz is not None:
        stamps = from_rate(source.names, clock.rate_hz, clock.start)
    elif clock.inside == "names":
        stamps = from_names(source.pictures)
    elif clock.inside == "exif":
        stamps = from_exif([source.path / name for name in source.names], notes)
    elif source.video is not None and source.video.times:
        stamps = list(source.video.stamps_ns(start_time(clock.start, source.path.name)))
    else:
        reason = "; ".join(["the images have no times of their own", *(source.notes if source.video else [])])
        raise MissingError(f"{source.path}: {reason}", "give --timestamps, --rate, or --times names|exif")
    offset_ns = 0 if clock.offset is None else clock_offset_ns(clock.offset, clock.unit)
    return settle(source.pictures, stamps, offset_ns, notes + where), missing
