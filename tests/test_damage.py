"""The table of damage: every case is an error or a stated loss, within 5 s and 1 GB."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from damaged_logs import cases

CASES = cases()
READABLE = {
    "sound", "sound, zstd", "sound, lz4", "chunk index without message index", "empty chunk",
    "times backwards in a chunk", "chunks backwards", "one id, two topics",
}  # fmt: skip
"""What the reader gives whole; the rest it refuses, naming file and place."""


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, tuple[str, float, float]]]:
    folder = tmp_path_factory.mktemp("damage")
    for k, (data, _, _) in enumerate(CASES.values()):
        (folder / f"{k}.mcap").write_bytes(data)
    script = Path(__file__).with_name("limited.py")
    done = subprocess.run(
        [sys.executable, str(script), str(folder)], capture_output=True, text=True, check=True, timeout=300
    )
    found = json.loads(done.stdout)
    return {name: found[f"{k}.mcap"] for k, name in enumerate(CASES)}


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits and /proc of Linux")
@pytest.mark.parametrize("name", CASES)
def test_every_case_ends_in_time_and_says_what_is_wrong(
    name: str, outcomes: dict[str, dict[str, tuple[str, float, float]]]
) -> None:
    _, saved, lost = CASES[name]
    for outcome, seconds, peak_mb in outcomes[name].values():
        assert not outcome.startswith(("TRACEBACK", "KILLED")), outcome
        assert seconds < 5.0
        assert peak_mb < 1024.0
    read, save = outcomes[name]["read"][0], outcomes[name]["save"][0]
    if name in READABLE:
        assert read == f"{saved} messages"
    else:
        assert re.match(r"error: .*\.mcap: byte \d+: ", read), read
    if saved is None:
        assert save.startswith("error: ")
        return
    counts = re.fullmatch(r"(\d+) saved, (\d+) lost, (whole|loss)", save)
    assert counts is not None, save
    assert int(counts[1]) == saved
    if lost >= 0:
        assert int(counts[2]) == lost
    assert (counts[3] == "loss") == (lost != 0 or name == "one id, two topics")
