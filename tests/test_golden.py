"""The sample drive, replayed as the README does, against the figures it gave when this was last looked at.

A change that moves a figure beyond its tolerance is either a defect or an improvement: look at the recording,
then store the new figure with the reason in the commit.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

SAMPLE = Path(__file__).parent.parent / "sample_logs" / "ring_road.mcap"
SCPF = Path(sys.executable).with_name("scpf")
RERUN = Path(sys.executable).with_name("rerun")


def replay(folder: Path, *options: str) -> dict[str, Any]:
    done = subprocess.run([SCPF, "replay", SAMPLE, "-o", folder, *options], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == str(folder / "ring_road.json")
    return dict(json.loads((folder / "ring_road.json").read_text()))


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, dict[str, Any]]:
    first, second = (tmp_path_factory.mktemp(name) for name in ("first", "second"))
    summary = replay(first)
    again = replay(second)
    for one in (summary, again):
        one.pop("timing_ms")
        one.pop("rate")
    assert again == summary
    return first, second, summary


def test_two_runs_leave_equal_recordings(runs: tuple[Path, Path, dict[str, Any]]) -> None:
    first, second, _ = runs
    recordings = [folder / "ring_road.rrd" for folder in (first, second)]
    for recording in recordings:
        assert subprocess.run([RERUN, "rrd", "verify", recording], capture_output=True).returncode == 0
    compared = subprocess.run(
        [RERUN, "rrd", "compare", "--unordered", *recordings], capture_output=True, text=True
    )
    assert compared.returncode == 0, compared.stderr[-2000:]


def test_the_sample_drive_gives_the_stored_figures(runs: tuple[Path, Path, dict[str, Any]]) -> None:
    summary = runs[2]
    assert summary["frames"] == 107
    assert summary["warnings"] == []
    errors, distances = summary["errors"], summary["distance_errors"]
    # The plain filter sees neither images nor map: only numerics can move it.
    assert errors["baseline_position"]["mean"] == pytest.approx(1.306, abs=0.01)
    # The others follow the network, whose scores differ in the last digits from machine to machine.
    assert errors["position"]["mean"] == pytest.approx(0.83, abs=0.12)
    assert errors["position"]["p95"] == pytest.approx(1.78, abs=0.3)
    assert distances["expert close"]["mean_absolute_m"] == pytest.approx(0.76, abs=0.1)
    assert distances["expert far"]["mean_absolute_m"] == pytest.approx(1.91, abs=0.2)
    assert 0.90 <= distances["all"]["coverage_95"] <= 0.98
    detections = summary["detections"]
    assert detections["matched"] == pytest.approx(179, abs=15)
    assert detections["matched_wrong"] == 0
    assert set(summary["states"]) == {"tracking", "unconstrained"}  # 15 frames have no pole within 48 m


def test_the_default_preset_is_better(tmp_path: Path) -> None:
    summary = replay(tmp_path, "--preset", "default")
    assert summary["errors"]["baseline_position"]["mean"] == pytest.approx(1.306, abs=0.01)
    assert summary["errors"]["position"]["mean"] == pytest.approx(0.59, abs=0.12)
    assert set(summary["states"]) == {"tracking", "unconstrained"}  # 15 frames have no pole within 48 m
