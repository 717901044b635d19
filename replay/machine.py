"""Examining the machine: versions beside the tested ones, what is missing, and whether the shipped models load."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

from scpf.ingest.findings import SEVERITIES, Finding
from scpf.models.errors import ScpfError
from scpf.models.worker_processes import usable_cores

TESTED_PYTHON: Final = "3.11"
TESTED: Final = {
    "cyclopts": "5.4.0",
    "joblib": "1.6.0",
    "lz4": "4.4.5",
    "mcap": "1.6.0",
    "numba": "0.68.1",
    "numpy": "2.4.6",
    "opencv-python-headless": "5.0.0.93",
    "pillow": "13.0.0",
    "pyproj": "3.7.2",
    "pyyaml": "6.0.3",
    "rerun-sdk": "0.41.0",
    "rosbags": "0.11.9",
    "safetensors": "0.8.0",
    "scikit-learn": "1.9.1",
    "scipy": "1.17.1",
    "threadpoolctl": "3.8.0",
    "torch": "2.13.0",
    "zstandard": "0.25.0",
}
OPTIONAL: Final = {
    "av": ("reads videos", "pip install 'scpf[video]'"),
    "matplotlib": ("draws figures", "pip install 'scpf[figures]'"),
}
OTHER_OPENCV: Final = ("opencv-python", "opencv-contrib-python")
"""These install the same module as opencv-python-headless, over it."""


@dataclass
class Machine:
    """What scpf runs on, and what was found."""

    python: str
    platform: str
    cpus: int
    versions: dict[str, str] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)

    @property
    def fine(self) -> bool:
        """Whether nothing was found but notes."""
        return all(finding.severity == "note" for finding in self.findings)


def examine_machine() -> Machine:
    """Everything that can be wrong with an installation, collected."""
    found = Machine(platform.python_version(), platform.platform(), usable_cores())
    for name in ("scpf", *TESTED, *OPTIONAL):
        found.versions[name] = _version(name)
    findings = [*_python(), *_packages(found.versions), *_vulkan(), *_models()]
    found.findings = sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))
    return found


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


def _python() -> Iterator[Finding]:
    running = ".".join(platform.python_version_tuple()[:2])
    if running != TESTED_PYTHON:
        yield Finding("note", "python", f"{running}, tested is {TESTED_PYTHON}", "3.11 or newer should do")


def _packages(versions: dict[str, str]) -> Iterator[Finding]:
    for name, tested in TESTED.items():
        if not versions[name]:
            yield Finding(
                "error", name, "not installed", "install scpf again: pip install -c constraints.txt ."
            )
        elif _release(versions[name])[:2] != _release(tested)[:2]:
            remedy = f"if something fails: pip install '{name}=={tested}'"
            yield Finding("note", name, f"{versions[name]}, tested is {tested}", remedy)
    for name, (what, remedy) in OPTIONAL.items():
        if not versions[name]:
            yield Finding("note", name, f"not installed; it {what}", remedy)
    for name in OTHER_OPENCV:
        if _version(name):
            text = "installed beside opencv-python-headless: both are the module cv2"
            remedy = f"pip uninstall {name}; pip install --force-reinstall opencv-python-headless"
            yield Finding("warning", name, text, remedy)


def _release(text: str) -> list[str]:
    return text.partition("+")[0].split(".")


def _vulkan() -> Iterator[Finding]:
    try:
        from scpf.replay.viewer import HINT, missing_driver
    except ImportError:  # named among the packages already
        return
    problem = missing_driver()
    if problem:
        yield Finding("note", "scpf screenshot", problem, HINT)


def _models() -> Iterator[Finding]:
    """Load what is shipped, as a replay does."""
    import scpf.models

    folder = Path(scpf.models.__file__).parent
    for about, load in (("polenet", _load_polenet), ("distance model", _load_distance)):
        try:
            load(folder)
        except (ScpfError, ImportError, OSError) as error:
            message = error.message if isinstance(error, ScpfError) else str(error)
            hint = error.hint if isinstance(error, ScpfError) else ""
            remedy = hint or "install scpf again: pip install -c constraints.txt ."
            yield Finding("error", about, message, remedy)


def _load_polenet(folder: Path) -> None:
    from scpf.models import polenet

    polenet.load(folder / "polenet.safetensors")


def _load_distance(folder: Path) -> None:
    from scpf.models import distance_file

    distance_file.load(folder / "distance.npz")
