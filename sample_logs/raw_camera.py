"""Pictures as a camera's own software leaves them: a folder with Basler's names, or an MP4, and a file of times.

Neither says exactly when its pictures were taken: names hold the begin of the recording and a counter without leading
zeros, and a video's times are rounded to its clock. The sidecar does, in ns.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable
from datetime import UTC, datetime
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

from scpf.models.errors import InputError, MissingError

MODEL, SERIAL = "acA2040-55uc", "23734412"
VIDEO_CLOCK = Fraction(1, 90_000)
RATE_HZ = 13


class RecordedPicture(NamedTuple):
    """An encoded picture: when it was taken (UTC, ns), the camera's counter, a baseline JPEG."""

    stamp_ns: int
    number: int
    jpeg: bytes


def write_basler_folder(folder: Path, sidecar: Path, pictures: Iterable[RecordedPicture]) -> int:
    """Write the pictures into ``folder``, and their times into ``sidecar`` (CSV); how many there were.

    Names are those that Basler's recorder gives. Raises InputError where one of the two is there already.
    """
    _refuse_existing(folder, sidecar)
    folder.mkdir(parents=True)
    rows, begin = [], ""
    for picture in pictures:
        begin = begin or _begin(picture.stamp_ns)
        name = f"Basler_{MODEL}__{SERIAL}__{begin}_{picture.number}.jpg"
        (folder / name).write_bytes(picture.jpeg)
        rows.append((name, picture.stamp_ns))
    _write_times(sidecar, "image", rows)
    return len(rows)


def write_mp4(path: Path, sidecar: Path, pictures: Iterable[RecordedPicture]) -> int:
    """Write the pictures into a video, Motion-JPEG in MP4, byte for byte, and their times into ``sidecar`` (CSV).

    Rows of the sidecar count the video's frames from 0. Returns how many there were. Raises MissingError without PyAV,
    InputError for an existing file, and where the pictures are of several sizes or no JPEG.
    """
    try:
        import av
    except ImportError as error:
        raise MissingError(
            f"{path}: a video, and PyAV is not installed", "pip install 'scpf[video]'"
        ) from error
    _refuse_existing(path, sidecar)
    rows: list[tuple[str, int]] = []
    with av.open(str(path), "w", options={"fflags": "+bitexact"}) as container:
        stream: Any = container.add_stream("mjpeg", rate=RATE_HZ)
        stream.pix_fmt, stream.time_base = "yuvj420p", VIDEO_CLOCK
        first: RecordedPicture | None = None
        for index, picture in enumerate(pictures):
            size_px = _size_px(picture)
            if first is None:
                first = picture
                stream.width, stream.height = size_px
            elif size_px != (stream.width, stream.height):
                raise InputError(f"picture {picture.number} has another size: {size_px[0]}×{size_px[1]} px")
            packet = av.Packet(picture.jpeg)
            packet.stream, packet.is_keyframe = stream, True
            packet.pts = packet.dts = round((picture.stamp_ns - first.stamp_ns) / 10**9 / VIDEO_CLOCK)
            packet.time_base = VIDEO_CLOCK
            container.mux(packet)
            rows.append((str(index), picture.stamp_ns))
    _write_times(sidecar, "frame", rows)
    return len(rows)


def _size_px(picture: RecordedPicture) -> tuple[int, int]:
    from io import BytesIO

    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(BytesIO(picture.jpeg), formats=("JPEG",)) as image:
            return image.size
    except (UnidentifiedImageError, OSError) as error:
        raise InputError(f"picture {picture.number} is no JPEG ({error})") from error


def _begin(stamp_ns: int) -> str:
    """The date of a recording as Basler's names have it, to the millisecond."""
    seconds, rest = divmod(stamp_ns, 10**9)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y%m%d_%H%M%S}{rest // 10**6:03d}"


def _write_times(sidecar: Path, column: str, rows: list[tuple[str, int]]) -> None:
    with sidecar.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([column, "timestamp_ns"])
        writer.writerows(rows)


def _refuse_existing(*paths: Path) -> None:
    for path in paths:
        if path.exists():
            raise InputError(f"{path} exists", "choose another name, or remove it")
