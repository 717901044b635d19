"""Unpacking a chunk that declares its size, without believing it: bombs make no more than they declare."""

from __future__ import annotations


def decompress(compression: str, data: memoryview, size: int) -> bytes | memoryview:
    """The ``size`` bytes of a chunk; ValueError for another number of bytes, or an unknown compression.

    Never makes more than ``size`` + 1 bytes, whatever the compressed data ask for.
    """
    if compression == "":
        unpacked: bytes | memoryview = data
    elif compression == "zstd":
        unpacked = _zstd(data, size)
    elif compression == "lz4":
        import lz4.frame

        try:
            unpacked = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
        except (RuntimeError, EOFError) as error:
            raise ValueError(f"lz4: {error}") from error
    else:
        raise ValueError(f"compression {compression[:40]!r} is not known (known: none, zstd, lz4)")
    if len(unpacked) != size:
        raise ValueError(f"it declares {size} bytes and holds another number")
    return unpacked


def _zstd(data: memoryview, size: int) -> bytes:
    import zstandard

    try:
        frame = zstandard.get_frame_parameters(data)
        if frame.content_size not in (size, zstandard.CONTENTSIZE_UNKNOWN):
            raise ValueError(f"it declares {size} bytes and its zstd frame {frame.content_size}")
        # A frame may ask for a window of gigabytes; no chunk below the limit needs more than its own size.
        decoder = zstandard.ZstdDecompressor(max_window_size=1 << 29)
        if frame.content_size == size:
            return decoder.decompress(data)
        with decoder.stream_reader(data) as reader:
            return reader.read(size + 1)
    except zstandard.ZstdError as error:
        raise ValueError(f"zstd: {error}") from error
