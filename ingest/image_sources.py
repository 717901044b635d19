"""Where pictures come from: a folder of JPEG, PNG, TIFF, PGM or raw files, or a video."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Final

from scpf.ingest.image_names import natural_order
from scpf.ingest.images import list_images
from scpf.ingest.pictures import Encoding, Picture
from scpf.ingest.raw_images import PixelFile, RawDump, RawLayout, is_deep, picture_size
from scpf.ingest.video import VIDEO_SUFFIXES, Video, open_video
from scpf.models.errors import InputError, UsageError

SUFFIXES: Final = {
    ".jpg": "encoded", ".jpeg": "encoded", ".png": "encoded", ".tif": "pixels", ".tiff": "pixels", ".pgm": "pixels",
    ".raw": "raw", ".bin": "raw",
}  # fmt: skip
"""What files of a folder are, by their names' ends."""


@dataclass
class Source:
    """Pictures in order. ``encoding``: how their pixels are encoded, "" where the files' own bytes are kept.

    ``video`` is there for a video; ``notes``: what was found on the way.
    """

    path: Path
    pictures: list[Picture]
    encoding: str = ""
    video: Video | None = None
    notes: list[str] = field(default_factory=list)

    @property
    def names(self) -> list[str]:
        """File names, or numbers of frames."""
        return [picture.name for picture in self.pictures]


def open_source(
    path: Path, layout: RawLayout | None = None, encoding: Encoding | None = None, jpeg_quality: int = 95
) -> Source:
    """The pictures of a folder or a video; nothing but headers is read.

    ``encoding`` is used where pixels have to be encoded: if not given, PNG for files, and for videos JPEG at
    ``jpeg_quality``. Raises InputError for a folder of no or of mixed kinds, or of mixed sizes.
    """
    layout = layout or RawLayout()
    if not path.is_dir():
        if path.suffix.lower() in VIDEO_SUFFIXES:
            return _video(path, layout, encoding or Encoding("jpeg", jpeg_quality))
        what = "is not there" if not path.exists() else "is neither a folder nor a video of a known kind"
        raise InputError(f"{path} {what}", f"videos are named {', '.join(VIDEO_SUFFIXES)}")
    files = sorted(
        (entry for entry in path.iterdir() if entry.is_file()), key=lambda file: natural_order(file.name)
    )
    by_kind: dict[str, list[Path]] = {}
    others: Counter[str] = Counter()
    for file in files:
        kind = SUFFIXES.get(file.suffix.lower())
        if kind is None:
            others[file.suffix.lower() or "no ending"] += 1
        else:
            by_kind.setdefault(kind, []).append(file)
    if not by_kind:
        hint = f"known are files named {', '.join(SUFFIXES)}"
        if any(ending in VIDEO_SUFFIXES for ending in others):
            hint = "give the video file itself"
        raise InputError(f"{path} holds no image", hint)
    if len(by_kind) > 1:
        mixed = " and ".join(f"{len(found)} such as {found[0].name}" for found in by_kind.values())
        raise InputError(f"{path} holds images of several kinds: {mixed}", "keep one kind in a folder")
    kind, chosen = next(iter(by_kind.items()))
    source = _FOLDERS[kind](path, chosen, layout, encoding or Encoding("png"))
    source.notes += [
        f"{count} files with {ending} in the folder are no images" for ending, count in others.items()
    ]
    return source


def _video(path: Path, layout: RawLayout, encoding: Encoding) -> Source:
    if layout != RawLayout():
        raise UsageError(
            f"{path} is a video: --bayer, --raw-size and --raw-bits are for folders of raw images"
        )
    video = open_video(path, encoding)
    pictures: list[Picture] = list(video.pictures())
    text = "" if video.untouched else f"{encoding}, from {video.codec}"
    return Source(path, pictures, text, video, video.notes)


def _encoded(path: Path, files: list[Path], layout: RawLayout, encoding: Encoding) -> Source:
    if layout == RawLayout():
        return Source(path, list(list_images(path)))
    lossy = [file.name for file in files if file.suffix.lower() != ".png"]
    if lossy:
        raise UsageError(
            f"{lossy[0]} is a JPEG: no raw pixels", "--bayer is for PNG, TIFF, PGM and raw files"
        )
    return _pixels(path, files, layout, encoding)


def _pixels(path: Path, files: list[Path], layout: RawLayout, encoding: Encoding) -> Source:
    if layout.size_px is not None:
        raise UsageError("--raw-size is for files without a header", "omit it")
    pictures: list[Picture] = [PixelFile(file, *picture_size(file), layout, encoding) for file in files]
    _same_size(path, pictures)
    return Source(path, pictures, f"{encoding}, from {_what(files, layout)}")


def _raw(path: Path, files: list[Path], layout: RawLayout, encoding: Encoding) -> Source:
    if layout.size_px is None:
        hint = "give --raw-size, such as 2048x1536, and --bayer where the sensor has a colour mosaic"
        raise UsageError(f"{files[0].name} does not say how large its picture is", hint)
    pictures: list[Picture] = [RawDump(file, *layout.size_px, layout, encoding) for file in files]
    _same_size(path, pictures)
    return Source(path, pictures, f"{encoding}, from {_what(files, layout)}")


_FOLDERS: Final[dict[str, Callable[[Path, list[Path], RawLayout, Encoding], Source]]] = {
    "encoded": _encoded,
    "pixels": _pixels,
    "raw": _raw,
}


def _what(files: list[Path], layout: RawLayout) -> str:
    parts = [files[0].suffix.lower().lstrip(".")]
    if layout.bayer:
        parts.append(f"Bayer {layout.bayer}")
    bits = layout.bits or (16 if layout.size_px is None and is_deep(files[0]) else 8)
    if bits > 8:
        parts.append(f"{bits} bit cut to 8")
    return ", ".join(parts)


def _same_size(path: Path, pictures: list[Picture]) -> None:
    """Refuse doubled numbers and differing sizes: either is two recordings in one folder."""
    for one, other in pairwise(pictures):
        if natural_order(one.name)[0] == natural_order(other.name)[0]:
            raise InputError(f"{one.name} and {other.name} in {path} have one number")
        if (one.width_px, one.height_px) != (other.width_px, other.height_px):
            sizes = f"{one.width_px}×{one.height_px} and {other.width_px}×{other.height_px} px"
            raise InputError(f"{one.name} and {other.name} in {path} differ in size: {sizes}")
