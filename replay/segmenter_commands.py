"""``scpf train segmenter``: from labelled pictures to weights of the small network, and how good weights are."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter


def train_segmenter(
    data: list[Path] | None = None,
    *,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    validate: list[Path] | None = None,
    held_out: float = 0.2,
    classes: Annotated[
        list[str] | None, Parameter(name="--class", consume_multiple=False, negative="")
    ] = None,
    scenes: int = 0,
    scenes_folder: Path = Path("street_scenes"),
    steps: int = 2500,
    minutes: float = float("inf"),
    patience: int = 6,
    start: Path | None = None,
    device: Literal["auto", "cpu", "cuda", "mps"] = "auto",
    workers: int = 1,
    run: Path | None = None,
    resume: bool = False,
    licence: str | None = None,
    seed: int = 0,
    overwrite: bool = False,
    quiet: Annotated[bool, Parameter(alias="-q")] = False,
    format: Literal["text", "json"] = "text",
) -> int:
    """Train PoleNet on labelled pictures, and on street scenes that it paints itself.

    DATA are folders of labelme files (polygons, rectangles, masks), COCO files, or folders with NAME.jpg beside
    NAME.png of instance ids: 0 background, 255 not judged, else one number a pole. A fifth of each is held out,
    drawn by the seed, to find the best weights and to print precision, recall and thickness error. Curves,
    configuration and the state that --resume goes on from lie in the run folder. The same seed gives the same weights
    on one machine, unless --minutes cut the schedule short.

    Examples:

        scpf train segmenter labelled_campus --start polenet.safetensors -o campus.safetensors

        scpf train segmenter --scenes 1500 --steps 2500 -o polenet.safetensors

        scpf train segmenter campus simulated/instances.json --validate campus_other_day -o campus.safetensors

    Parameters
    ----------
    data
        Labelled pictures; each folder or file is drawn from equally often, whatever its size.
    output
        The weights to write (.safetensors).
    validate
        Pictures to judge by; nothing of DATA is held out then. Take another drive: the frames of one resemble each
        other.
    held_out
        The share of each of DATA that is held out.
    classes
        A label that means a light pole (default: light_pole); repeat it.
    scenes
        Also train on this many painted street scenes, and hold out a tenth as many more.
    scenes_folder
        Where the painted scenes are kept.
    steps
        Optimizer steps of eight crops each.
    minutes
        Squeeze the schedule into this time where the steps would take longer.
    patience
        Stop after so many validations (one every 300 steps) without a better mask AP; 0 never does.
    start
        Weights to go on from.
    device
        Where to compute; a GPU computes in mixed precision.
    workers
        Threads that make the crops; a GPU needs several.
    run
        The run folder (default: the output's name with _run).
    resume
        Go on with the training in the run folder, with the same options.
    licence
        The licence of the weights, to be written into them.
    seed
        Seed of split, weights, crops and augmentation.
    overwrite
        Replace the output and the run folder's training.
    quiet
        No progress on stderr.
    format
        How to print the figures on stdout.
    """
    import json
    import shutil
    from dataclasses import asdict
    from importlib.metadata import version

    from scpf.ingest.labelled_folders import DEFAULT_CLASSES
    from scpf.models import devices, polenet
    from scpf.models.errors import InputError, UsageError
    from scpf.models.polenet_training import BEST, STATE, TrainingSettings, train
    from scpf.replay.segmenter_data import gather
    from scpf.replay.training_run import TrainingRun

    if output is None:
        raise UsageError("no --output", "name the weights to write: -o NAME.safetensors")
    if scenes < 0 or steps < 1 or minutes <= 0 or patience < 0 or workers < 1:
        raise UsageError(
            "--steps, --minutes and --workers are positive, --scenes and --patience not negative"
        )
    if not 0 < held_out < 1:
        raise UsageError(f"--held-out {held_out:g}: a share between 0 and 1")
    if output.exists() and not overwrite and not resume:
        raise InputError(f"{output} exists", "use --overwrite, or another --output")

    def report(line: str) -> None:
        if not quiet:
            print(line, file=sys.stderr, flush=True)

    chosen = devices.choose(device)
    wanted = tuple(classes or DEFAULT_CLASSES)
    painted = (scenes, scenes_folder)
    pictures = gather(list(data or []), list(validate or []), wanted, held_out, seed, painted, report)
    report(f"{pictures.counted}, on {chosen}")
    settings = TrainingSettings(
        steps=steps, limit_s=60 * minutes, patience=patience, start=start, device=chosen.type, workers=workers
    )
    configuration = {
        "scpf": version("scpf"),
        "seed": seed,
        "classes": wanted,
        "pictures": pictures.names,
        **asdict(settings),
        "start": None if start is None else str(start),
        "limit_s": None if minutes == float("inf") else 60 * minutes,
    }
    folder = run or output.with_name(f"{output.stem}_run")
    opened = TrainingRun(folder, configuration, resume=resume, overwrite=overwrite, files=(BEST, STATE))
    if not opened.has_tensorboard:
        report("curves as CSV alone: TensorBoard's need scpf[train]")
    about = polenet.WeightsInfo(
        f"{pictures.counted} (seed {seed}, at most {steps} steps)",
        licence=licence or ("not stated" if data else "Apache-2.0"),
    )
    try:
        info = train(
            pictures.training, pictures.held_out, folder, settings, seed, about,
            resume=resume, report=report, curves=opened.curves,
        )  # fmt: skip
    except KeyboardInterrupt:
        report(f"{folder} holds the best weights so far ({BEST}); go on with --resume")
        raise
    finally:
        opened.close()
    partial = output.with_name(output.name + ".partial")
    shutil.copyfile(folder / BEST, partial)
    partial.replace(output)
    if format == "json":
        document = {"output": str(output), "run": str(folder), "figures": dict(info.figures)}
        print(json.dumps(document, indent=1))
    else:
        for name, value in info.figures.items():
            print(f"{name:<32} {value:.3f}")
        print(output)
    return 0
