"""What a conversion costs, beside ``rosbags-convert``: CPU in one paired, interleaved run, and peak memory.

Not run by default. By hand (a few minutes, 6 GB of free disk):

    SCPF_BENCHMARK=1 pytest tests/benchmarks/test_convert_cost.py -s
"""

from __future__ import annotations

import os
import resource
import shutil
import statistics
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

pytestmark = pytest.mark.skipif(
    "SCPF_BENCHMARK" not in os.environ, reason="a benchmark: SCPF_BENCHMARK=1 runs it"
)

ROUNDS = 7
T0 = 1_600_000_000_000_000_000
STORE = get_typestore(Stores.ROS1_NOETIC)


def drive_bag(path: Path, megabytes: int) -> Path:
    """A ROS 1 bag of pictures of 500 kB at 10 Hz and an IMU at 200 Hz."""
    make = STORE.types
    rng = np.random.default_rng(0)
    picture = rng.integers(0, 256, 500_000, dtype=np.uint8)
    vector, turn = make["geometry_msgs/msg/Vector3"], make["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)

    def header(seq: int, stamp_ns: int) -> Any:
        stamp = make["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
        return make["std_msgs/msg/Header"](seq=seq, stamp=stamp, frame_id="camera")

    with Writer(path) as bag:
        image = bag.add_connection(
            "/camera/image/compressed", "sensor_msgs/msg/CompressedImage", typestore=STORE
        )
        imu = bag.add_connection("/imu", "sensor_msgs/msg/Imu", typestore=STORE)
        for k in range(megabytes * 2):
            stamp_ns = T0 + k * 100_000_000
            picture[:8] = rng.integers(0, 256, 8)
            message = make[image.msgtype](header(k, stamp_ns), "jpeg", picture)
            bag.write(image, stamp_ns, STORE.serialize_ros1(message, image.msgtype))
            for j in range(20):
                at_ns, a = stamp_ns + j * 5_000_000, rng.standard_normal(6)
                message = make[imu.msgtype](
                    header(20 * k + j, at_ns),
                    turn,
                    np.zeros(9),
                    vector(*a[:3]),
                    np.zeros(9),
                    vector(*a[3:]),
                    np.zeros(9),
                )
                bag.write(imu, at_ns, STORE.serialize_ros1(message, imu.msgtype))
    return path


def cpu_s(words: list[str], output: Path) -> float:
    """User and system time of a command; its output is removed first."""
    shutil.rmtree(output, ignore_errors=True)
    output.unlink(missing_ok=True)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(words, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def test_cpu_beside_rosbags_convert(tmp_path: Path) -> None:
    """The raw conversion takes at most 0.65 of its time, transcoding at most 1.0: medians of paired rounds."""
    bag = drive_bag(tmp_path / "a.bag", 300)
    tools = Path(sys.executable).parent
    ways = {
        "rosbags-convert": [
            f"{tools}/rosbags-convert",
            "--src",
            str(bag),
            "--dst",
            "OUT",
            "--dst-storage",
            "mcap",
        ],
        "raw": [f"{tools}/scpf", "convert", str(bag), "-q", "--encoding", "ros1", "-o", "OUT.mcap"],
        "transcoded": [f"{tools}/scpf", "convert", str(bag), "-q", "-o", "OUT.mcap"],
    }
    times: dict[str, list[float]] = {name: [] for name in ways}
    for round_ in range(ROUNDS + 1):  # the first one fills the caches
        for name, words in ways.items():
            output = tmp_path / "out" if name == "rosbags-convert" else tmp_path / "out.mcap"
            taken = cpu_s([word.replace("OUT", str(tmp_path / "out")) for word in words], output)
            if round_:
                times[name].append(taken)
    medians = {}
    for name, taken in times.items():
        ratios = [mine / theirs for mine, theirs in zip(taken, times["rosbags-convert"], strict=True)]
        medians[name] = statistics.median(ratios)
        rounds = " ".join(f"{ratio:.2f}" for ratio in ratios)
        print(f"{name:16} {statistics.median(taken):5.2f} s CPU   ratio {medians[name]:.2f}   ({rounds})")
    assert medians["raw"] <= 0.65
    assert medians["transcoded"] <= 1.0


@pytest.mark.parametrize("encoding", ["ros1", "ros2"])
def test_memory_of_a_large_bag(tmp_path: Path, encoding: str) -> None:
    """Peak resident memory below 300 MB for a bag of 2 GB."""
    bag = drive_bag(tmp_path / "a.bag", 2000)
    code = """
import resource, sys
from scpf.replay.cli import run
code = run(sys.argv[1:])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, file=sys.stderr)
sys.exit(code)
"""
    words = [
        sys.executable,
        "-c",
        code,
        "convert",
        str(bag),
        "-q",
        "--encoding",
        encoding,
        "-o",
        str(tmp_path / "a.mcap"),
    ]
    done = subprocess.run(words, check=True, capture_output=True, text=True)
    peak_mb = int(done.stderr.split()[-1]) / 1024
    print(f"{encoding}: peak {peak_mb:.0f} MB for {bag.stat().st_size / 1e9:.2f} GB")
    assert peak_mb < 300
