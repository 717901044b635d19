"""The pictures of a log as a recording of their own, which many runs over that log share.

The viewer shows files of one recording id as one recording. With ``--images separate`` the id comes from the log's
bytes and the stretch alone: every run of both has it, and so has the file of their pictures.
"""

from __future__ import annotations

import math
import os
import uuid
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from scpf.ingest.drive_log import DriveLog
from scpf.replay.frames import Window, pictures
from scpf.replay.recording_camera import log_image
from scpf.replay.recording_stream import FLUSH_EVERY, new_stream

SUFFIX: Final = ".images.rrd"
NAMESPACE: Final = uuid.UUID("0b1d9a52-8f5e-4a86-9d0b-1a4f0d5c2c37")
LAYOUT: Final = 1
"""Another number is another recording id: files of an older layout are then written anew."""


@dataclass(frozen=True)
class SharedImages:
    """Where the pictures lie, LOG.images.rrd or LOG.10s-15s.13hz.images.rrd of a stretch, and their recording id."""

    path: Path
    identity: str

    @staticmethod
    def of(directory: Path, log_path: Path, log_sha256: str, window: Window) -> SharedImages:
        """Those of a window of the log, in the folder of the runs."""
        stretch = ""
        if window.start_s > 0.0 or not math.isinf(window.stop_s):
            end = "end" if math.isinf(window.stop_s) else f"{window.stop_s:g}s"
            stretch += f".{window.start_s:g}s-{end}"
        if not math.isinf(window.rate_hz):
            stretch += f".{window.rate_hz:g}hz"
        identity = uuid.uuid5(NAMESPACE, repr((LAYOUT, log_sha256, window)))
        return SharedImages(directory / f"{log_path.stem}{stretch}{SUFFIX}", str(identity))

    def write_unless_there(self, log: DriveLog, window: Window) -> None:
        """Write the file, unless a run over the same bytes and stretch has left it already."""
        if recording_id(self.path) == self.identity:
            return
        partial = self.path.with_suffix(f".{os.getpid()}.partial.rrd")  # two runs may begin at once
        rec = new_stream(self.identity)
        try:
            rec.save(partial)
            for count, (index, _, picture) in enumerate(pictures(log, window), 1):
                rec.set_time("frame", sequence=index)
                rec.set_time("time", timestamp=np.datetime64(picture.stamp_ns, "ns"))
                log_image(rec, picture.data, picture.format)
                if count % FLUSH_EVERY == 0:
                    rec.flush()
            rec.disconnect()  # writes the footer
        except BaseException:
            rec.disconnect()
            partial.unlink(missing_ok=True)
            raise
        partial.replace(self.path)


def recording_id(rrd: Path) -> str:
    """The id of the recording in a file; "" where there is none, or a killed process left the file without its end."""
    from rerun.chunk import RrdReader

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return next((str(entry.recording_id) for entry in RrdReader(rrd).recordings()), "")
        except (OSError, RuntimeError, ValueError):
            return ""


def with_images(rrd: Path) -> list[Path]:
    """The recording and, after it, the files beside it that hold its pictures."""
    identity = recording_id(rrd)
    beside = [path for path in sorted(rrd.parent.glob(f"*{SUFFIX}")) if path != rrd]
    return [rrd, *(path for path in beside if identity and recording_id(path) == identity)]
