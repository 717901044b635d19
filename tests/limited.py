"""Runs readers on files in a process of its own, each file in a fork with 1 GB of memory and 5 s."""

from __future__ import annotations

import json
import os
import resource
import signal
import sys
import time
from pathlib import Path

from scpf.ingest.drive_log import DriveLog
from scpf.ingest.recover import recover
from scpf.models.errors import ScpfError

MEMORY_BYTES = 1 << 30
SECONDS = 5


def read(path: Path) -> str:
    """Everything of a log."""
    try:
        with DriveLog(path) as log:
            count = sum(1 for _ in log.messages())
            log.attachments(), log.metadata()
        return f"{count} messages"
    except ScpfError as error:
        return f"error: {error.message}"


def save(path: Path) -> str:
    """What recover saves, and whether it says that something was lost."""
    try:
        report = recover(path, path.with_suffix(".saved"), overwrite=True)
    except ScpfError as error:
        return f"error: {error.message}"
    with DriveLog(path.with_suffix(".saved")) as log:
        count = sum(1 for _ in log.messages())
    assert count == report.messages
    return f"{report.messages} saved, {report.messages_lost} lost, {'whole' if report.lossless else 'loss'}"


def main(folder: Path) -> None:
    """Print a JSON object: file name → task → [outcome, seconds, peak memory in MB]."""
    import lz4.frame  # noqa: F401  (forks share what is imported before)
    import zstandard  # noqa: F401

    outcomes: dict[str, dict[str, list[object]]] = {}
    for path in sorted(folder.glob("*.mcap")):
        outcomes[path.name] = {task.__name__: list(limited(task, path)) for task in (read, save)}
    print(json.dumps(outcomes))


def limited(task: object, path: Path) -> tuple[str, float, float]:
    reading, writing = os.pipe()
    begun = time.monotonic()
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_AS, (_virtual_bytes() + MEMORY_BYTES,) * 2)
        signal.alarm(SECONDS)
        try:
            outcome = task(path)  # type: ignore[operator]
        except BaseException as error:
            outcome = f"TRACEBACK {type(error).__name__}: {error}"
        os.write(writing, outcome.encode()[:4000])
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        outcome = pipe.read()
    _, status, usage = os.wait4(child, 0)
    seconds = time.monotonic() - begun
    return outcome if status == 0 else f"KILLED {status}", seconds, usage.ru_maxrss / 1024


def _virtual_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
