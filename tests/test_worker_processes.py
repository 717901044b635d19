"""Worker processes end with the process that began them, also where it is killed."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from scpf.models.worker_processes import usable_cores

PROGRAM = """
import os, time
from scpf.models.worker_processes import worker_pool

if __name__ == "__main__":
    pool = worker_pool(2, abs, (0,))
    pids = {future.result() for future in [pool.submit(os.getpid) for _ in range(20)]}
    print(*pids, flush=True)
    time.sleep(60)
"""


def running(pid: str) -> bool:
    """A process that ended, and for whose end nobody has asked yet, is not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks at processes in /proc")
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_workers_end_with_a_killed_program(how: signal.Signals, tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    with subprocess.Popen([sys.executable, program], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        pids = process.stdout.readline().split()
        assert pids and all(running(pid) for pid in pids)
        process.send_signal(how)
        process.wait()
        ends_s = time.monotonic() + 20
        while any(running(pid) for pid in pids) and time.monotonic() < ends_s:
            time.sleep(0.05)
        assert not any(running(pid) for pid in pids)


def test_there_is_a_core() -> None:
    assert usable_cores() >= 1
