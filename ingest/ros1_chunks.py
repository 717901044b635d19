"""A bound on what the chunks of a ROS 1 bag may unpack to; rosbags has none, and a few kilobytes become gigabytes."""

from __future__ import annotations

import bz2
from collections.abc import Callable
from typing import Any, Final

MAX_CHUNK_BYTES: Final = 512 << 20


def bound_chunks(reader: Any, limit: int = MAX_CHUNK_BYTES) -> None:
    """Give an open rosbags.rosbag1.Reader decompressors that raise ValueError above ``limit`` bytes."""
    from rosbags.rosbag1.reader import decompressors

    bounded: dict[Any, Callable[[bytes], bytes]] = {
        decompressors["bz2"]: lambda data: _whole(bz2.BZ2Decompressor(), data, limit),
        decompressors["lz4"]: lambda data: _lz4(data, limit),
    }
    for position, chunk in reader.chunks.items():
        if chunk.decompressor in bounded:
            reader.chunks[position] = chunk._replace(decompressor=bounded[chunk.decompressor])


def _lz4(data: bytes, limit: int) -> bytes:
    import lz4.frame

    return _whole(lz4.frame.LZ4FrameDecompressor(), data, limit)


def _whole(decompressor: Any, data: bytes, limit: int) -> bytes:
    unpacked: bytes = decompressor.decompress(data, max_length=limit + 1)
    if len(unpacked) > limit or not decompressor.eof:
        raise ValueError(f"a chunk unpacks to more than {limit >> 20} MiB, or is cut short")
    return unpacked
