"""Videos (AVI, MP4, MOV, MKV, H.264 and H.265 streams): frames with the presentation times of their container.

FFmpeg reads them, through PyAV. Frames of Motion-JPEG and PNG videos go on byte for byte; others are decoded.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from scpf.ingest.mjpeg import as_jpeg
from scpf.ingest.pictures import MAX_PIXELS, Encoded, Encoding, check_size
from scpf.models.errors import DamagedError, InputError, MissingError

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.frame import Frame
    from av.packet import Packet
    from av.video.stream import VideoStream

VIDEO_SUFFIXES: Final = (
    ".avi", ".mp4", ".m4v", ".mov", ".mkv", ".webm", ".ts", ".h264", ".264", ".h265", ".265", ".hevc", ".mjpeg",
)  # fmt: skip
DEMUXERS: Final = "avi,mov,mp4,matroska,webm,mpegts,h264,hevc,mjpeg"
"""What FFmpeg may take a file for: no playlist, which could name other files or addresses."""
WITHOUT_TIMES: Final = ("h264", "hevc", "mjpeg")
"""Bare streams: FFmpeg makes up 25 frames a second for them."""
UNTOUCHED: Final = {"mjpeg": "jpeg", "png": "png"}
MAX_FRAMES: Final = 10_000_000


@dataclass
class Video:
    """A video file. ``times``: presentation times of its frames, ascending, in units of ``time_base`` seconds;
    empty where the file has none. ``undecodable`` counts packets that FFmpeg refused.
    """

    path: Path
    codec: str
    width_px: int
    height_px: int
    frames: int
    times: list[int]
    time_base: Fraction
    encoding: Encoding
    in_order: bool = False
    """Whether times are those of decoding: AVI has no others, and what FFmpeg derives from them is off by a frame."""
    notes: list[str] = field(default_factory=list)
    undecodable: int = 0
    _reader: Iterator[tuple[int, Encoded]] | None = field(default=None, repr=False)
    _position: int = field(default=-1, repr=False)
    _held: Encoded | None = field(default=None, repr=False)

    @property
    def untouched(self) -> bool:
        """Whether the frames' own bytes go into the log."""
        return self.codec in UNTOUCHED

    def stamps_ns(self, start_ns: int) -> list[int]:
        """Times of the frames, the first at ``start_ns``; each rounded to a ns once, so that nothing drifts."""
        return [start_ns + round((time - self.times[0]) * self.time_base * 10**9) for time in self.times]

    def pictures(self) -> list[VideoFrame]:
        """The frames, to be read in ascending order: going back starts from the file's beginning."""
        return [VideoFrame(self, index) for index in range(self.frames)]

    def read(self, index: int) -> Encoded:
        """The frame at ``index`` of the presentation. Raises InputError for one that cannot be decoded."""
        if self._reader is None or index < self._position:
            self._reader, self._position, self._held = self._decode(), -1, None
        while self._position < index:
            try:
                self._position, self._held = next(self._reader)
            except StopIteration:
                self._position, self._held = self.frames, None
        if self._position != index or self._held is None:
            raise DamagedError(f"{self.path}: frame {index} cannot be decoded")
        return self._held

    def _time(self, timed: Packet[Any] | Frame) -> int | None:
        """Of a packet or a frame, by the clock that ``times`` uses."""
        return timed.dts if self.in_order else timed.pts

    def _decode(self) -> Iterator[tuple[int, Encoded]]:
        """Index and bytes of each frame, ascending; frames that are damaged are left out."""
        import av
        import numpy as np

        index_of: dict[int | None, int] = {time: index for index, time in enumerate(self.times)}
        size_px = (self.width_px, self.height_px)
        count = 0
        with open_container(self.path) as (container, stream):
            for packet in container.demux(stream):
                if packet.size and self.codec == "mjpeg":
                    untouched = as_jpeg(bytes(packet), size_px)
                    if untouched is not None:
                        yield index_of.get(self._time(packet), count), Encoded(untouched, "jpeg")
                        count += 1
                        continue
                elif packet.size and self.codec == "png":
                    yield index_of.get(self._time(packet), count), Encoded(bytes(packet), "png")
                    count += 1
                    continue
                try:
                    decoded = packet.decode()
                except (av.FFmpegError, ValueError):
                    self.undecodable += 1
                    continue
                for frame in decoded:
                    index = index_of.get(self._time(frame)) if self.times else count
                    count += 1
                    if index is None or frame.is_corrupt or (frame.width, frame.height) != size_px:
                        continue
                    shape = "gray" if frame.format.name.startswith("gray") else "bgr24"
                    pixels = np.asarray(frame.to_ndarray(format=shape), dtype=np.uint8)
                    yield index, self.encoding.of(pixels, f"{self.path}: frame {index}")


@dataclass(frozen=True)
class VideoFrame:
    """A frame of a video, by its place in the presentation."""

    video: Video
    index: int

    @property
    def name(self) -> str:
        return str(self.index)

    @property
    def width_px(self) -> int:
        return self.video.width_px

    @property
    def height_px(self) -> int:
        return self.video.height_px

    def encoded(self) -> Encoded:
        return self.video.read(self.index)


def open_video(path: Path, encoding: Encoding) -> Video:
    """Look through a video without decoding it: codec, size, and the presentation time of each frame.

    Raises InputError for a file without pictures, DamagedError for a broken one, MissingError without PyAV.
    """
    notes: list[str] = []
    with open_container(path) as (container, stream):
        context, name = stream.codec_context, container.format.name
        if context is None:
            raise DamagedError(f"{path} holds a video of an unknown codec", "is the file whole?")
        check_size(context.width, context.height, str(path))
        times, count, empty = [], 0, 0
        for packet in container.demux(stream):
            if packet.is_discard or (packet.dts is None and packet.pts is None and not packet.size):
                continue  # outside the edit list, or the mark of the end
            if not packet.size:
                empty += 1
                continue
            count += 1
            if count > MAX_FRAMES:
                raise InputError(f"{path} has more than {MAX_FRAMES} frames", "cut it into parts")
            time = packet.dts if name == "avi" else packet.pts
            if time is not None:
                times.append(time)
        time_base, delayed = stream.time_base or Fraction(1), bool(context.has_b_frames)
        codec = context.name
    if not count:
        raise DamagedError(f"{path} holds no frame", "was the recording ended properly?")
    if len(times) != count or name in WITHOUT_TIMES:
        times = []
    elif name == "avi" and delayed:
        # AVI keeps the order of decoding alone; what FFmpeg makes of it is out of order by some frames.
        times = []
        notes.append("AVI with frames out of order (B-frames): it holds no presentation times")
    if empty:
        notes.append(f"{empty} frames of the video are empty: dropped by the recorder")
    repeated = len(times) - len(set(times))
    if repeated:
        raise DamagedError(
            f"{path}: {repeated} frames have the time of another", "give --rate, or --timestamps"
        )
    return Video(
        path,
        codec,
        context.width,
        context.height,
        count,
        sorted(times),
        time_base,
        encoding,
        name == "avi",
        notes,
    )


@contextmanager
def open_container(path: Path) -> Iterator[tuple[InputContainer, VideoStream]]:
    """The file, opened, and its first video stream."""
    try:
        import av
    except ImportError as error:
        raise MissingError(
            f"{path} is a video, and PyAV is not installed", "pip install 'scpf[video]'"
        ) from error
    if not path.is_file():
        raise InputError(f"{path} is not a file", "give a video file, or a folder of images")
    try:
        with av.open(
            f"file:{path}", options={"protocol_whitelist": "file", "format_whitelist": DEMUXERS}
        ) as container:
            if not container.streams.video:
                raise InputError(
                    f"{path} holds no pictures", "known: AVI, MP4, MOV, MKV, H.264 and H.265 streams"
                )
            stream = container.streams.video[0]
            if stream.codec_context is not None:
                stream.codec_context.options = {
                    "max_pixels": str(MAX_PIXELS)
                }  # of frames that grow on the way
                stream.thread_type = "AUTO"
            yield container, stream
    except (av.FFmpegError, UnicodeError, ValueError) as error:
        hint = "was the recording ended properly? FFmpeg may mend it: ffmpeg -i IN -c copy OUT"
        raise DamagedError(f"{path} is not a readable video ({error})", hint) from error
