"""Freed memory is kept: the next picture's pages are there already."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

SCRIPT = """
import resource, threading
import numpy as np
from scpf.models.memory import keep_freed_memory

def faults_of_pictures():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(20):
        _ = [np.ones(9 << 20, np.uint8) for _ in range(5)]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

def in_a_thread():
    found = []
    thread = threading.Thread(target=lambda: (faults_of_pictures(), found.append(faults_of_pictures())))
    thread.start()
    thread.join()
    return found[0]

before = in_a_thread()
kept = keep_freed_memory()
print(kept, before, in_a_thread())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another malloc")
def test_pictures_after_the_first_fault_no_pages_in() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    kept, before, after = done.stdout.split()
    assert kept == "True"
    assert int(after) < 100 and int(before) > 10 * int(after)
