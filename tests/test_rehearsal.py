"""The rehearsal compiles what the steps use, and touches nothing of theirs."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scpf.ingest.drive_log import DriveLog
from scpf.replay.drive import Drive
from scpf.replay.rehearsal import rehearse
from scpf.replay.settings import PRESETS

SAMPLE = Path(__file__).parent.parent / "sample_logs" / "ring_road.mcap"
SCRIPT = """
import sys
from dataclasses import replace
from pathlib import Path
from numba.core.dispatcher import Dispatcher
from scpf.replay import engine
from scpf.replay.frames import Window
from scpf.replay.outputs import Outputs
from scpf.replay.settings import preset

def compiled():
    modules = [m for name, m in sys.modules.items() if name.startswith("scpf.")]
    kernels = {id(v): v for m in modules for v in vars(m).values() if isinstance(v, Dispatcher)}
    return {k.__qualname__: len(k.signatures) for k in kernels.values() if k.signatures}

settings = replace(preset(sys.argv[1]), segmenter="recorded")
rehearsed = {}
rehearse = engine.rehearse
def then_look(*given):
    rehearse(*given)
    rehearsed.update(compiled())
engine.rehearse = then_look
log, folder = Path(sys.argv[2]), Path(sys.argv[3])
engine.replay(log, Outputs.of(folder, "x"), settings, Window(0.0, 2.0), lambda step, done, total: None)
assert rehearsed, "nothing was compiled"
print(sorted(set(compiled().items()) - set(rehearsed.items())))
"""


@pytest.mark.parametrize("preset", ["paper", "default"])
def test_no_step_compiles_what_the_rehearsal_did_not(preset: str, tmp_path: Path) -> None:
    command = [sys.executable, "-c", SCRIPT, preset, SAMPLE, tmp_path]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("missing", ["camera", "road_map", "model"])
def test_a_drive_that_lacks_something_is_not_rehearsed(missing: str) -> None:
    settings = PRESETS["paper"]
    with DriveLog(SAMPLE) as log:
        drive = Drive.of(log, settings)
    rehearse(settings, replace(drive, **{missing: None}))


def test_a_camera_that_looks_back_is_not_rehearsed() -> None:
    settings = PRESETS["paper"]
    with DriveLog(SAMPLE) as log:
        drive = Drive.of(log, settings)
    assert drive.camera is not None
    turned = drive.camera.T_body_camera.copy()
    turned[:3, :3] = np.diag([-1.0, -1.0, 1.0]) @ turned[:3, :3]
    rehearse(settings, replace(drive, camera=replace(drive.camera, T_body_camera=turned)))


def test_a_picture_of_any_size_that_a_log_claims_takes_no_memory() -> None:
    settings = PRESETS["paper"]
    with DriveLog(SAMPLE) as log:
        drive = Drive.of(log, settings)
    assert drive.camera is not None
    for focal_px in (800.0, 1e9):
        matrix = np.array([[focal_px, 0.0, 2e9], [0.0, focal_px, 2e9], [0.0, 0.0, 1.0]])
        vast = replace(drive.camera, width_px=2**32 - 1, height_px=2**32 - 1, matrix=matrix)
        rehearse(settings, replace(drive, camera=vast))
