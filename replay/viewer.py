"""Pictures of a recording from the headless Rerun viewer: to look at a replay on a machine without a screen."""

from __future__ import annotations

import io
import os
import socket
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError, MissingError
from scpf.replay.recording_images import with_images

Pixels = NDArray[np.uint8]

DRIVERS: Final = (
    Path("/usr/share/vulkan/icd.d"),
    Path("/etc/vulkan/icd.d"),
    Path("/usr/local/share/vulkan/icd.d"),
)
HINT: Final = "on Debian or Ubuntu: apt-get install --no-install-recommends mesa-vulkan-drivers libvulkan1"

STARTUP_S: Final = 40.0
OPENING_S: Final = 20.0
NOTICES_S: Final = 9.0
"""The viewer's start-up notices fade after about 8 s."""
SETTLED_DIFFERENCE: Final = 12
"""Pixels that differ by more than this, of 255, have changed."""


def screenshot(
    rrd_path: Path,
    frame_indices: Sequence[int],
    out_dir: Path,
    size: tuple[int, int] = (1600, 1000),
    *,
    paths: Sequence[Path] | None = None,
    timeout_s: float = 120.0,
) -> list[Path]:
    """Render ``rrd_path`` at each frame of ``frame_indices``; returns the PNG files.

    They are called ``NAME_000042.png`` in ``out_dir``, or as ``paths`` say. MissingError without a Vulkan driver;
    InputError where the viewer shows an error in one of the views, or its picture does not come to rest.
    """
    if not rrd_path.is_file():
        raise InputError(f"{rrd_path} is not there")
    targets = list(paths or (out_dir / f"{rrd_path.stem}_{index:06d}.png" for index in frame_indices))
    with headless_viewer(size) as viewer:
        for path in with_images(rrd_path):
            _open(viewer, path)
        opened_s = time.monotonic()
        for index, target in zip(frame_indices, targets, strict=True):
            viewer.set_time("frame", sequence=index, play_state="paused")
            picture = _settled(viewer, opened_s + NOTICES_S, timeout_s)
            problems = reports(viewer)
            if problems:
                raise InputError(f"{rrd_path}, frame {index}: {problems[0]}")
            _save(picture, target)
    return targets


def missing_driver() -> str:
    """Why pictures cannot be made here; "" where they can."""
    named = os.environ.get("VK_DRIVER_FILES") or os.environ.get("VK_ICD_FILENAMES")
    if not named and not any(next(folder.glob("*.json"), None) for folder in DRIVERS):
        return "the viewer needs a Vulkan driver, and there is none"
    return ""


@contextmanager
def headless_viewer(size: tuple[int, int]) -> Iterator[Any]:
    """A viewer without a window that only this machine can reach; yields its client."""
    from rerun.experimental import ViewerClient

    problem = missing_driver()
    if problem:
        raise MissingError(problem, HINT)
    port = _free_port()
    command = [str(viewer_executable()), "--headless", "--bind", "127.0.0.1", "--port", str(port)]
    command += ["--window-size", f"{size[0]}x{size[1]}", "--hide-welcome-screen", "--memory-limit", "4GB"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            yield _connect(ViewerClient, f"rerun+http://127.0.0.1:{port}/proxy", process)
        finally:
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()


def viewer_executable() -> Path:
    """The viewer's own binary: the ``rerun`` on the path is a Python script around it."""
    spec = find_spec("rerun_cli")
    if spec is None or not spec.origin:
        raise MissingError("the Rerun viewer is not installed", "pip install 'rerun-sdk~=0.41.0'")
    name = "rerun.exe" if os.name == "nt" else "rerun"
    return Path(spec.origin).with_name(name)


def reports(viewer: Any) -> list[str]:
    """What the views report about what they cannot show."""
    views = viewer.get_state().views
    return [f"view {view.name!r}: {report.summary}" for view in views for report in view.reports]


def _connect(client: Any, url: str, process: subprocess.Popen[bytes]) -> Any:
    deadline_s = time.monotonic() + STARTUP_S
    while time.monotonic() < deadline_s:
        if process.poll() is not None:
            raise MissingError(f"the viewer ended at once (exit {process.returncode})", HINT)
        try:
            viewer = client.connect(url)
            viewer.get_state()
        except (ConnectionError, TimeoutError, RuntimeError, ValueError):
            time.sleep(0.25)
        else:
            return viewer
    raise MissingError(f"the viewer did not answer within {STARTUP_S:.0f} s", HINT)


def _open(viewer: Any, rrd_path: Path) -> None:
    """Open a recording; returns when the viewer has it."""
    viewer.open(str(rrd_path.resolve()))
    deadline_s = time.monotonic() + OPENING_S
    while True:
        try:
            viewer.set_time("frame", sequence=0, play_state="paused")
        except (ConnectionError, RuntimeError, ValueError) as error:
            if time.monotonic() > deadline_s:
                raise InputError(f"{rrd_path}: the viewer does not open it ({_first_line(error)})") from error
            time.sleep(0.25)
        else:
            return


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0]


def _picture(viewer: Any, view_id: Any = None) -> Pixels:
    """A screenshot (H, W, 3); the first ones may take longer than the viewer's own limit."""
    from PIL import Image

    for _ in range(8):
        try:
            data = viewer.take_screenshot(view_id)
        except (TimeoutError, ConnectionError):
            continue
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))
    raise InputError("the viewer makes no picture")


def _settled(viewer: Any, not_before_s: float, timeout_s: float) -> Pixels:
    """The picture once three in a row are alike: data and shaders arrive on demand."""
    deadline_s = time.monotonic() + timeout_s
    last, alike = _picture(viewer), 0
    while time.monotonic() < deadline_s:
        time.sleep(0.4)
        picture = _picture(viewer)
        changed = np.abs(picture.astype(np.int16) - last).max(axis=-1) > SETTLED_DIFFERENCE
        alike = alike + 1 if int(changed.sum()) < 50 else 0
        last = picture
        if alike >= 2 and time.monotonic() > not_before_s:
            return picture
    raise InputError(f"the viewer's picture did not come to rest within {timeout_s:.0f} s")


def _save(picture: Pixels, target: Path) -> None:
    from PIL import Image

    target.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(picture).save(target, "PNG")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
