"""Work in several processes: how many are worth it, and that none outlives the program."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import Any


def usable_cores() -> int:
    """The CPU cores that the system grants this process, which may be fewer than the machine has."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def worker_pool(
    workers: int, initializer: Callable[..., object], initargs: tuple[Any, ...] = ()
) -> ProcessPoolExecutor:
    """Fresh processes, each begun with ``initializer(*initargs)``, that end when this one does.

    The standard library's wait for work for ever where this process is killed: each holds an end of the pipe that the
    others read from.
    """
    spawn = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(
        workers, mp_context=spawn, initializer=_begin, initargs=(initializer, initargs)
    )


def _begin(initializer: Callable[..., object], initargs: tuple[Any, ...]) -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()
    initializer(*initargs)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
