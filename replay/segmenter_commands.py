"""``scpf train segmenter``: from labelled pictures to weights of the small network."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter


def train_segmenter(
    data: list[Path] | None = None,
    *,
    output: Annotated[Path, Parameter(alias="-o")],
    validate: list[Path] | None = None,
    scenes: int = 0,
    scenes_folder: Path = Path("street_scenes"),
    steps: int = 2500,
    minutes: float = float("inf"),
    start: Path | None = None,
    seed: int = 0,
    overwrite: bool = False,
    quiet: Annotated[bool, Parameter(alias="-q")] = False,
    format: Literal["text", "json"] = "text",
) -> int:
    """Train PoleNet on folders of pictures with instance ids, and on street scenes that it paints itself.

    A folder holds NAME.jpg beside NAME.png with the instance ids: 0 background, 255 not judged, else one number a pole.
    Prints precision, recall and thickness error on the held-out pictures. The same seed gives the same weights on
    one machine, unless --minutes cut the schedule short.

    Examples:

        scpf train segmenter --scenes 1500 --steps 2500 -o polenet.safetensors

        scpf train segmenter campus_train --validate campus_val --start polenet.safetensors -o campus.safetensors

    Parameters
    ----------
    data
        Folders of labelled pictures; each is drawn equally often, whatever its size.
    output
        The weights to write (.safetensors).
    validate
        Folders of held-out pictures, for the figures and the calibration of the score.
    scenes
        Also train on this many painted street scenes, and hold out a tenth as many more.
    scenes_folder
        Where the painted scenes are kept.
    steps
        Optimizer steps of eight crops each.
    minutes
        Squeeze the schedule into this time where the steps would take longer.
    start
        Weights to go on from.
    seed
        Seed of weights, crops and augmentation.
    overwrite
        Replace the output.
    quiet
        No progress on stderr.
    format
        How to print the figures on stdout.
    """
    import json

    from scpf.models.errors import InputError, UsageError
    from scpf.models.polenet_training import TrainingSettings, train
    from scpf.sample_logs.street_scenes import write_scenes

    training, held_out = list(data or []), list(validate or [])
    if scenes < 0 or steps < 1 or minutes <= 0:
        raise UsageError("--steps and --minutes are positive, --scenes is not negative")
    if not training and not scenes:
        raise UsageError("nothing to train on", "name folders of labelled pictures, or give --scenes")
    if output.exists() and not overwrite:
        raise InputError(f"{output} exists", "use --overwrite, or another --output")

    def report(line: str) -> None:
        if not quiet:
            print(line, file=sys.stderr, flush=True)

    if scenes:
        # Seeds of the held-out scenes lie apart, so that a larger --scenes never trains on them.
        for name, seeds, folders in (
            ("train", range(scenes), training),
            ("held_out", range(10**6, 10**6 + max(scenes // 10, 8)), held_out),
        ):
            report(f"painting {len(seeds)} scenes into {scenes_folder / name}")
            (scenes_folder / name).mkdir(parents=True, exist_ok=True)
            write_scenes(scenes_folder / name, seeds)
            folders.append(scenes_folder / name)
    if not held_out:
        raise UsageError("nothing is held out to judge by", "give --validate, or --scenes")
    sources = ", ".join(folder.name for folder in training)
    settings = TrainingSettings(steps=steps, limit_s=60 * minutes, start=start)
    info = train(
        training, held_out, output, settings, seed, report, f"{sources} (seed {seed}, {steps} steps)"
    )
    if format == "json":
        print(json.dumps({"output": str(output), "figures": dict(info.figures)}, indent=1))
    else:
        for name, value in info.figures.items():
            print(f"{name:<32} {value:.3f}")
        print(output)
    return 0
