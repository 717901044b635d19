"""Rendering many frames: in parallel processes, resumed after an interruption, the same whoever renders which.

A frame depends on its index and the settings alone, never on the frames before it or on the worker. Finished frames
lie in a folder beside the hash of the settings that made them; a later run with equal settings renders what is missing.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import signal
from collections.abc import Callable, Mapping
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from itertools import groupby
from pathlib import Path
from typing import Any, Final

from scpf.models.errors import InputError, ScpfError
from scpf.models.whole_files import write_whole
from scpf.models.worker_processes import worker_pool
from scpf.sample_logs.finished_frames import FinishedFrame, load_frame, save_frame

Make = Callable[[int], FinishedFrame]
"""Renders the frame of an index."""
Prepare = Callable[[], Make]
"""Builds world and renderer, once a process; has to be picklable."""

SETTINGS_FILE: Final = "settings.json"


def settings_hash(settings: Mapping[str, Any]) -> str:
    """SHA-256 of the settings as JSON with sorted keys."""
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()


def open_folder(folder: Path, settings: Mapping[str, Any], *, overwrite: bool) -> None:
    """Make the folder of the frames, or take up one that equal settings left.

    Raises InputError for a folder of other settings, unless ``overwrite`` allows to empty it.
    """
    note, digest = folder / SETTINGS_FILE, settings_hash(settings)
    if folder.exists():
        try:
            known = json.loads(note.read_bytes())["sha256"]
        except (OSError, ValueError, KeyError, TypeError):
            known = ""
        if known == digest:
            return
        if not known and (not folder.is_dir() or any(folder.iterdir())):
            # Never empty a folder that this program did not fill.
            raise InputError(f"{folder} exists and holds no frames of a simulation", "choose another output")
        if known and not overwrite:
            hint = "give the same settings to go on, or --overwrite to begin anew"
            raise InputError(f"{folder} holds frames of other settings", hint)
        shutil.rmtree(folder)
    folder.mkdir(parents=True)
    write_whole(note, json.dumps({"sha256": digest, "settings": settings}, indent=1).encode())


def render_all(
    folder: Path,
    count: int,
    prepare: Prepare,
    *,
    workers: int = 1,
    together: int = 1,
    progress: Callable[[int, int, int], None] | None = None,
) -> int:
    """Render the frames 0 to ``count`` - 1 that ``folder`` lacks; returns how many were rendered.

    ``together``: so many consecutive frames share something costly, and go to one worker. ``progress(done, resumed,
    count)`` is called after each such job, ``done`` counting the resumed ones. Raises ScpfError where a worker
    process dies.
    """
    missing = [index for index in range(count) if load_frame(folder, index) is None]
    resumed = done = count - len(missing)
    if progress is not None:
        progress(done, resumed, count)
    if not missing:
        return 0
    if workers == 1:
        make = prepare()
        for index in missing:
            save_frame(folder, index, make(index))
            done += 1
            if progress is not None:
                progress(done, resumed, count)
        return len(missing)
    jobs = [list(job) for _, job in groupby(missing, key=lambda index: index // together)]
    pool = worker_pool(min(workers, len(jobs)), _start, (prepare, folder))
    try:
        for future in as_completed([pool.submit(_render, job) for job in jobs]):
            done += future.result()
            if progress is not None:
                progress(done, resumed, count)
    except BrokenProcessPool as error:
        hint = "was memory short? fewer --workers need less; the finished frames are kept"
        raise ScpfError("a rendering process died", hint) from error
    finally:
        pool.shutdown(cancel_futures=True)
    return len(missing)


_prepare: Prepare | None = None
_make: Make | None = None
_folder = Path()


def _start(prepare: Prepare, folder: Path) -> None:
    """In a worker: an interrupt is the parent's business, which lets the frames at hand be finished."""
    global _prepare, _folder
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _prepare, _folder = prepare, folder


def _render(indices: list[int]) -> int:
    # Prepared here and not in _start: an error of its own then reaches the caller instead of breaking the pool.
    global _make
    if _make is None:
        assert _prepare is not None
        _make = _prepare()
    for index in indices:
        save_frame(_folder, index, _make(index))
    return len(indices)
