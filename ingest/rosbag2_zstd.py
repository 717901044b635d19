"""Compressed rosbag2 recordings (zstd, by file or by message), unpacked within bounds."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Final

from scpf.ingest.bag_source import BagMessage, BagSource
from scpf.models.errors import DamagedError, InputError

MAX_MESSAGE_BYTES: Final = 512 << 20
MAX_RATIO: Final = 1000
"""No recording of a camera or a lidar shrinks to a thousandth: what claims to is a trap."""
SPARE_BYTES: Final = 64 << 20
MAX_METADATA_BYTES: Final = 16 << 20
_MODE: Final = re.compile(r"^\s*compression_mode:\s*[\"']?(file|message)\b", re.MULTILINE | re.IGNORECASE)
_FORMAT: Final = re.compile(r"^\s*compression_format:\s*[\"']?(\w+)", re.MULTILINE)


def compression_of(folder: Path) -> str:
    """``file``, ``message`` or empty: how a rosbag2 folder says that it is compressed. InputError for another way."""
    metadata = folder / "metadata.yaml"
    if not metadata.exists():
        return ""
    with metadata.open(encoding="utf-8", errors="replace") as file:
        text = file.read(MAX_METADATA_BYTES)
    mode, form = _MODE.search(text), _FORMAT.search(text)
    if mode is None:
        return ""
    if form is not None and form[1].lower() != "zstd":
        raise InputError(f"{folder}: compression {form[1]!r} is not read", "known: zstd")
    return mode[1].lower()


def unpack_file(path: Path, stack: ExitStack) -> Path:
    """A ``.zstd`` file unpacked into a temporary folder, which ``stack`` removes. DamagedError where it cannot be."""
    import zstandard

    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="scpf_")))
    target = folder / path.stem
    limit = path.stat().st_size * MAX_RATIO + SPARE_BYTES
    made = 0
    try:
        decoder = zstandard.ZstdDecompressor(max_window_size=1 << 29)
        with path.open("rb") as source, target.open("wb") as output:
            for part in decoder.read_to_iter(source):
                made += len(part)
                if made > limit:
                    raise DamagedError(
                        f"{path}: unpacks to more than {limit >> 20} MiB", "is this a recording?"
                    )
                output.write(part)
    except zstandard.ZstdError as error:
        raise DamagedError(f"{path}: cannot be unpacked ({error})") from error
    return target


class Unpacked:
    """A recording whose messages are compressed one by one."""

    def __init__(self, source: BagSource) -> None:
        self._source = source
        self.channels = source.channels
        self.start_ns = source.start_ns
        self.losses = source.losses

    def messages(
        self, wanted: Collection[int], start_ns: int | None, end_ns: int | None
    ) -> Iterator[BagMessage]:
        """See BagSource."""
        import zstandard

        decoder = zstandard.ZstdDecompressor(max_window_size=1 << 29)
        damaged = 0
        for message in self._source.messages(wanted, start_ns, end_ns):
            try:
                size = zstandard.get_frame_parameters(message.data).content_size
                if size == zstandard.CONTENTSIZE_UNKNOWN:
                    with decoder.stream_reader(message.data) as reader:
                        data = reader.read(MAX_MESSAGE_BYTES + 1)
                elif size <= MAX_MESSAGE_BYTES:
                    data = decoder.decompress(message.data)
                else:
                    raise zstandard.ZstdError("too large")
                if len(data) > MAX_MESSAGE_BYTES:
                    raise zstandard.ZstdError("too large")
            except (zstandard.ZstdError, MemoryError):
                damaged += 1
                continue
            yield message._replace(data=data)
        text = f"{damaged} messages cannot be unpacked"
        if damaged and text not in self.losses:
            self.losses.append(text)
