"""``scpf view`` and ``scpf screenshot``: a recording in the viewer, and as pictures without a screen."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

LOCAL: str = "127.0.0.1"


def view(rrd: Path, *, web: bool = False, port: int = 9876) -> int:
    """Open a recording in the Rerun viewer, with the file of its pictures beside it. It listens on this machine alone.

    Over SSH, use --web with the viewer's two ports forwarded: ssh -L 9090:localhost:9090 -L 9876:localhost:9876 HOST

    Examples:

        scpf view out/ring_road.rrd

        scpf view out/ring_road.rrd --web

    Parameters
    ----------
    rrd
        The recording; also the NAME.partial.rrd of an interrupted replay.
    web
        Serve the viewer to a browser instead of opening a window.
    port
        Port of the viewer's data; the browser's page has 9090.
    """
    import subprocess

    from scpf.models.errors import InputError
    from scpf.replay.recording_images import with_images
    from scpf.replay.viewer import viewer_executable

    if not rrd.is_file():
        raise InputError(f"{rrd} is not there", "scpf replay makes one")
    options = ["--bind", LOCAL, "--port", str(port), *(["--web-viewer"] if web else [])]
    return subprocess.call([str(viewer_executable()), *options, *map(str, with_images(rrd))])


def screenshot(
    rrd: Path,
    *,
    frame: Annotated[tuple[int, ...], Parameter(alias="-f")] = (0,),
    output: Annotated[Path, Parameter(alias="-o")] = Path(),
    size: tuple[int, int] = (1600, 1000),
) -> int:
    """Render frames of a recording to PNG, without a screen. Needs a Vulkan driver; a software one will do.

    Examples:

        scpf screenshot out/ring_road.rrd --frame 90 -o frame90.png

        scpf screenshot out/ring_road.rrd --frame 60 --frame 90 -o pictures

    Parameters
    ----------
    rrd
        The recording.
    frame
        Index of a frame; may be given several times.
    output
        A .png file where there is one frame, else a folder.
    size
        Width and height, px.
    """
    from scpf.models.errors import UsageError
    from scpf.replay.viewer import screenshot as render

    named = output.suffix.lower() == ".png"
    if named and len(frame) != 1:
        raise UsageError(f"{output}: one picture for {len(frame)} frames", "give a folder")
    for path in render(rrd, frame, output, size, paths=[output] if named else None):
        print(path)
    return 0
