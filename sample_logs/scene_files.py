"""Painted street scenes as files: pictures and the ids of the poles in them, painted in several processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError
from scpf.models.whole_files import write_whole
from scpf.models.worker_processes import worker_pool
from scpf.sample_logs.street_scenes import scene

JPEG_QUALITY = 92
TOGETHER = 8  # scenes that a process takes at a time


def scene_paths(folder: Path, seed: int) -> tuple[Path, Path]:
    """Where `write_scenes` leaves the picture of a scene, and its ids."""
    return folder / f"toy_{seed:06d}.jpg", folder / f"toy_{seed:06d}.png"


def is_whole(folder: Path, seed: int) -> bool:
    """Whether the two files of a scene are there."""
    return all(path.is_file() for path in scene_paths(folder, seed))


def write_scenes(
    folder: Path,
    seeds: Sequence[int],
    *,
    workers: int = 1,
    progress: Callable[[int], None] = lambda done: None,
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
    picture, truth = scene_paths(folder, seed)
    image, ids = scene(seed)
    _save(picture, image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    _save(truth, ids, [])


def _save(path: Path, picture: NDArray[np.uint8], settings: list[int]) -> None:
    _, encoded = cv2.imencode(path.suffix, picture, settings)
    try:
        write_whole(path, encoded.tobytes())
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"{path} cannot be written ({reason})", "is there room, may you write?") from error
