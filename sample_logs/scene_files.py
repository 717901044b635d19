"""Painted street scenes as files: pictures and the ids of the poles in them, painted in several processes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError
from scpf.models.worker_processes import worker_pool
from scpf.sample_logs.street_scenes import scene

JPEG_QUALITY = 92
TOGETHER = 8  # scenes that a process takes at a time


def write_scenes(
    folder: Path, seeds: range, *, workers: int = 1, progress: Callable[[int], None] = lambda done: None
) -> None:
    """Writes ``toy_SEED.jpg`` and ``toy_SEED.png`` (ids) of every seed into ``folder``, the same with any ``workers``.

    Raises InputError where a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write = partial(_write, folder)
    if workers == 1:
        for done, seed in enumerate(seeds, start=1):
            write(seed)
            progress(done)
        return
    with worker_pool(workers, cv2.setNumThreads, (1,)) as pool:
        for done, _ in enumerate(pool.map(write, seeds, chunksize=TOGETHER), start=1):
            progress(done)


def _write(folder: Path, seed: int) -> None:
    image, ids = scene(seed)
    _save(folder / f"toy_{seed:06d}.jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    _save(folder / f"toy_{seed:06d}.png", ids, [])


def _save(path: Path, picture: NDArray[np.uint8], settings: list[int]) -> None:
    if not cv2.imwrite(str(path), picture, settings):
        raise InputError(f"{path} cannot be written", "is there room, and may you write there?")
