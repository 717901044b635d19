"""Fixtures that several test modules share."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import hypothesis
import pytest

if TYPE_CHECKING:
    from label_files import Read

    from scpf.models.labelled_images import LabelledObject

# At home every run tries other examples; where a result decides over a change, it depends on the change alone.
hypothesis.settings.register_profile("ci", derandomize=True, deadline=None)
hypothesis.settings.register_profile("home", deadline=None)
hypothesis.settings.load_profile("ci" if os.environ.get("CI") else "home")

MOST_WORKERS = 8  # each holds torch, half a GB
if "PYTEST_XDIST_WORKER" in os.environ:
    # Each worker has a core, and threads of its own would only wait for another's. Read when torch is imported.
    os.environ.setdefault("OMP_NUM_THREADS", "1")


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """A worker a core; none for a single file, which is done before workers are up, nor where times are taken."""
    timed = "SCPF_BENCHMARK" in os.environ or config.getoption("--benchmark-only", False)
    single = len(config.args) == 1 and ".py" in config.args[0]
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return 0 if timed or single else min(MOST_WORKERS, usable)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real files that are not in the repository; the test is skipped where it is absent."""
    root = Path(__file__).resolve().parent.parent
    folder = Path(os.environ.get("SCPF_SHARED_DATA", root.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"real files not present: {folder} (set SCPF_SHARED_DATA)")
    return folder


@pytest.fixture(scope="session")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a simulated drive of two seconds, drive.mcap, and its raw files in raw/."""
    from scpf.replay.cli import run

    folder = tmp_path_factory.mktemp("simulated")
    options = ["--start-m", "300", "--duration", "2", "--seed", "3", "--weather", "cloudy", "--width", "128"]
    options += ["--map-error", "0.3", "--workers", "1", "--raw", str(folder / "raw"), "-q"]
    assert run(["simulate", "-o", str(folder / "drive.mcap"), *options]) == 0
    return folder


@pytest.fixture(scope="session")
def small_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The drive log of `small_logs`, to be read and not to be changed."""
    from small_logs import write

    return write(tmp_path_factory.mktemp("small_log") / "drive.mcap")


@pytest.fixture
def label_folder(tmp_path: Path) -> Path:
    """A folder with a picture to label, a.jpg."""
    import cv2
    import numpy as np
    from label_files import HEIGHT, WIDTH

    noise = np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "a.jpg"), noise)
    return tmp_path


@pytest.fixture
def read_labels(label_folder: Path) -> Read:
    """Reads labelme's or COCO's document for that picture to its objects."""
    from scpf.ingest.labelled_folders import labelled_images

    def of(document: dict[str, Any]) -> list[LabelledObject]:
        (label_folder / "a.json").write_text(json.dumps(document))
        return labelled_images(label_folder)[0].read().objects

    return of


@pytest.fixture
def one_thread() -> None:
    """Threads that wait for each other take seconds for small pictures where the machine is busy."""
    import torch

    torch.set_num_threads(1)


@pytest.fixture(scope="session")
def tiny_scenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of four painted scenes of 160×128 px, with ids; not to be written into."""
    from painted_scenes import write_painted_scenes

    return write_painted_scenes(tmp_path_factory.mktemp("scenes"), (160, 128))
