"""``scpf export WEIGHTS --onnx``: PoleNet as an ONNX file, quantised by pictures of the camera it shall run on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, Literal

import numpy as np

from scpf.ingest.drive_log import DriveLog
from scpf.models import polenet
from scpf.models.errors import InputError, MissingError, UsageError
from scpf.models.instances import Image
from scpf.models.labelled_images import read_image
from scpf.models.onnx_export import export, quantise
from scpf.replay.frames import decode

Precision = Literal["int8", "float32"]

PICTURES: Final = 24
"""So many pictures show the ranges well enough; each costs half a second."""

_FIRST_SEED: Final = 700_000  # of painted scenes that no training saw


def export_network(
    weights: str,
    output: Path,
    precision: Precision,
    sources: Sequence[Path],
    overwrite: bool,
    say: Callable[[str], None],
) -> str:
    """Writes ``output`` and returns what it holds, in words.

    ``weights``: a .safetensors file, or ``polenet`` for those that ship. ``sources``: drive logs and folders of
    pictures for int8; without any, painted street scenes serve. Raises InputError where the output exists, UsageError
    for another ending, and what reading and exporting raise.
    """
    if output.suffix != ".onnx":
        raise UsageError(f"{output}: an ONNX network ends in .onnx")
    if output.exists() and not overwrite:
        raise InputError(f"{output} exists", "use --overwrite, or another name")
    net, info = polenet.load(polenet.weights_path(weights))
    if precision == "float32":
        export(net, info, output)
        return f"{output}: single precision"
    pictures = [image for source in sources for image in _pictures(source)] if sources else _painted()
    say(f"ranges from {len(pictures)} pictures")
    whole = output.with_name(output.stem + ".float32.partial")
    try:
        export(net, info, whole)
        quantise(whole, output, pictures)
    finally:
        whole.unlink(missing_ok=True)
    return f"{output}: 8 bits, by the ranges of {len(pictures)} {'' if sources else 'painted '}pictures"


def _pictures(source: Path) -> list[Image]:
    """At most `PICTURES`, spread evenly over a drive log or a folder of JPEG and PNG files."""
    if source.is_dir():
        files = sorted(path for path in source.iterdir() if path.suffix in (".jpg", ".jpeg", ".png"))
        if not files:
            raise MissingError(f"{source}: no pictures (.jpg, .jpeg, .png)")
        return [read_image(files[k]) for k in _spread(len(files))]
    with DriveLog(source) as log:
        chosen = set(_spread(sum(1 for _ in log.images())))
        return [
            decode(image.data, f"{source}: frame {k}") for k, image in enumerate(log.images()) if k in chosen
        ]


def _spread(count: int) -> list[int]:
    return sorted({(2 * k + 1) * count // (2 * PICTURES) for k in range(PICTURES)}) if count else []


def _painted() -> list[Image]:
    from scpf.sample_logs.street_scenes import scene

    seeds = range(_FIRST_SEED, _FIRST_SEED + PICTURES)
    return [np.ascontiguousarray(scene(seed)[0][:, :, ::-1]) for seed in seeds]
