"""What an installation holds, and what the README promises."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGES = ("ingest", "models", "replay", "sample_logs")


def test_every_sub_package_is_listed() -> None:
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    folders = {p.parent.relative_to(ROOT) for name in PACKAGES for p in (ROOT / name).rglob("__init__.py")}
    names = {"scpf." + ".".join(folder.parts) for folder in folders}
    assert names == set(listed["packages"]) == set(listed["package-dir"])
    assert all((ROOT / folder / "py.typed").exists() for folder in folders)


def test_floors_import_downwards_only() -> None:
    floor = {"models": 1, "ingest": 2, "sample_logs": 3, "replay": 4}
    for name in PACKAGES:
        for path in (ROOT / name).glob("*.py"):
            for other in re.findall(r"(?:from|import) scpf\.(\w+)", path.read_text()):
                assert floor[other] < floor[name] or other == name, f"{path.name} imports {other}"


def test_only_the_recording_side_imports_rerun() -> None:
    users = {
        p.stem for name in PACKAGES for p in (ROOT / name).glob("*.py") if "import rerun" in p.read_text()
    }
    assert all(name.startswith("recording") or name in ("blueprint", "viewer") for name in users), users


def test_help_loads_no_heavy_library() -> None:
    code = "import sys; from scpf.replay.cli import run; run(['--help']); print(sorted(sys.modules), file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "replay" in done.stdout
    loaded = set(re.findall(r"'([^']+)'", done.stderr))
    assert not loaded & {"torch", "rerun", "cv2", "numpy", "scipy", "sklearn", "rosbags", "mcap"}


def test_the_readme_s_test_command_is_the_one_that_is_run() -> None:
    command = re.search(r"^python3 -m venv \.venv-test .*$", (ROOT / "README.md").read_text(), re.MULTILINE)
    assert command is not None
    run = (ROOT / ".ci" / "run").read_text().replace("pip install -q ", "pip install ")
    assert command.group(0) in run
