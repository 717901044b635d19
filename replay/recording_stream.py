"""The stream into a Rerun file, set so that the same content gives the same file."""

from __future__ import annotations

from typing import Final

import rerun as rr

APPLICATION: Final = "scpf"
FLUSH_EVERY: Final = 39
"""Steps between two flushes: by count, not by the clock, so that a run twice over cuts its chunks alike."""
NEVER_S: Final = 1e6


def new_stream(identity: str) -> rr.RecordingStream:
    """A stream of recording id ``identity``, without times of the wall clock; flushed when it is told to."""
    batches = rr.ChunkBatcherConfig(flush_tick=NEVER_S)  # one-row chunks would double the file
    rec = rr.RecordingStream(
        APPLICATION, recording_id=identity, send_properties=False, batcher_config=batches
    )
    rec.set_log_time_enabled(False)
    return rec
