"""Bags with bytes changed, cut out and put in: an error with a name, or a conversion that says what it lost."""

from __future__ import annotations

import random
import resource
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from bag_builders import numbers_bag, watonobus_bag
from rosbags.rosbag2 import StoragePlugin
from test_bags import rosbag2

from scpf.ingest.bag_report import Encoding, Options
from scpf.ingest.bags import convert
from scpf.models.errors import ScpfError

COUNTS = {"none": 900, "bz2": 350, "lz4": 450, "drive": 500}
INTERESTING = (
    b"\xff\xff\xff\xff",
    b"\x00\x00\x00\x00",
    b"\xff\xff\xff\x7f",
    b"\x00\x00\x00\x80",
    b"\x01\x00\x00\x00",
)
MAX_S = 5.0
MAX_GROWTH_KB = 400_000


def mutate(data: bytes, rng: random.Random) -> bytes:
    """A few changes: bits, numbers, cuts, repeats; most of them where there are headers."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 4, 16))):
        at = rng.randrange(len(out))
        kind = rng.randrange(7)
        if kind < 3:
            names = [name for name in (b"=", b"op=", b"size=", b"conn=", b"count=", b"time=") if name in out]
            found = out.find(rng.choice(names), at) if names else -1
            at = found + rng.randrange(-4, 8) if found > 4 else at
            out[at % len(out)] ^= 1 << rng.randrange(8)
        elif kind == 3:
            out[at] ^= 1 << rng.randrange(8)
        elif kind == 4:
            out[at : at + 4] = rng.choice(INTERESTING)
        elif kind == 5:
            del out[at : at + rng.choice((1, 4, 100, 5000))]
        else:
            out[at:at] = out[at : at + rng.choice((1, 4, 100, 3000))]
        if not out:
            return b""
    return bytes(out) if rng.random() > 0.1 else bytes(out[: rng.randrange(len(out) + 1)])


@pytest.fixture(autouse=True)
def _no_fsync(monkeypatch: pytest.MonkeyPatch) -> None:
    """Thousands of small files need not reach the disk."""
    monkeypatch.setattr("scpf.ingest.bag_output.os.fsync", lambda _: None)


def run(make: Callable[[int], Path], count: int, tmp_path: Path) -> tuple[int, int]:
    """Convert ``count`` mutants; how many raised a ScpfError, and how many were converted with a loss."""
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    refused = lossy = 0
    for k in range(count):
        source = make(k)
        begun_s = time.process_time()
        try:
            encoding: Encoding = "ros1" if k % 3 == 0 and source.suffix == ".bag" else "ros2"
            options = Options(encoding, overwrite=True, verify=k % 5 == 0)
            lossy += not convert([source], tmp_path / "out.mcap", options).lossless
        except ScpfError:
            refused += 1
        assert time.process_time() - begun_s < MAX_S, f"mutant {k}"
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb < MAX_GROWTH_KB
    return refused, lossy


@pytest.mark.parametrize("kind", COUNTS)
def test_mutated_ros1_bags(tmp_path: Path, kind: str) -> None:
    """2,200 of them in all."""
    if kind == "drive":
        data = watonobus_bag(tmp_path / "a.bag", frames=6).read_bytes()
    else:
        data = numbers_bag(tmp_path / "a.bag", count=20, compression=kind, chunk_bytes=600).read_bytes()
    # The bag header is padded to 4 kB, which a mutation would hit most of the time.
    sound, rng = data[:200], random.Random(kind)

    def make(k: int) -> Path:
        path = tmp_path / "mutant.bag"
        head = mutate(sound, rng) if k % 20 == 0 else sound
        path.write_bytes(head + data[200:4117] + (mutate(data[4117:], rng) if k % 20 else data[4117:]))
        return path

    refused, lossy = run(make, COUNTS[kind], tmp_path)
    assert refused + lossy > COUNTS[kind] // 4


def test_mutated_databases(tmp_path: Path) -> None:
    folder = rosbag2(tmp_path / "bag", StoragePlugin.SQLITE3, count=60)
    data = next(folder.glob("*.db3")).read_bytes()
    rng = random.Random(3)

    def make(_: int) -> Path:
        path = tmp_path / "mutant.db3"
        path.write_bytes(mutate(data, rng))
        return path

    refused, lossy = run(make, 250, tmp_path)
    assert refused + lossy > 20
