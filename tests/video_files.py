"""Videos for tests: grey frames of known brightness at known presentation times."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

WIDTH, HEIGHT = 64, 48


def brightness(index: int) -> int:
    """Of the frame ``index``: distinct enough to survive any codec."""
    return 20 + 10 * index


def write_video(
    path: Path, codec: str, times: list[int], time_base: Fraction, colours: list[tuple[int, int, int]] | None = None,
    **options: str,
) -> None:  # fmt: skip
    """A video with a frame at each of ``times`` (units of ``time_base`` s); skips where the encoder is missing."""
    av: Any = pytest.importorskip("av")
    try:
        av.Codec(codec, "w")
    except Exception:
        pytest.skip(f"this PyAV has no encoder {codec}")
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25, options={"x265-params": "log-level=none", **options})
        stream.width, stream.height = WIDTH, HEIGHT
        stream.pix_fmt = {"mjpeg": "yuvj420p", "png": "rgb24"}.get(codec, "yuv420p")
        stream.codec_context.time_base = time_base
        for index, time in enumerate(times):
            colour = colours[index] if colours else (brightness(index),) * 3
            frame = av.VideoFrame.from_ndarray(
                np.full((HEIGHT, WIDTH, 3), colour, dtype=np.uint8), format="rgb24"
            )
            frame.pts, frame.time_base = time, time_base
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
