"""The clock of the MCAP writer: what was written reaches the file also when nothing more is written.

A replay may think for seconds between two messages; if it is killed meanwhile, the last ones must be in the file.
"""

from __future__ import annotations

import threading
import weakref
from typing import Protocol


class _Flushable(Protocol):
    def flush_if_due(self) -> None: ...


def start_flushing(writer: _Flushable, every_s: float) -> threading.Event:
    """Ask ``writer`` every so often to flush, until the event that is returned is set or the writer is gone."""
    stop = threading.Event()
    reference = weakref.ref(writer)

    def keep_flushing() -> None:
        while not stop.wait(every_s):
            target = reference()
            if target is None:
                return
            target.flush_if_due()
            del target

    threading.Thread(target=keep_flushing, name="mcap-flush", daemon=True).start()
    return stop
