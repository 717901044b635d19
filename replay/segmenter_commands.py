"""``scpf train segmenter``: from labelled pictures to weights of the small network, and how good weights are."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from scpf.models.whole_files import whole


def train_segmenter(
    data: list[Path] | None = None,
    /,
    *,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    evaluate: str | None = None,
    calibrate: Path | None = None,
    validate: Annotated[list[Path] | None, Parameter(consume_multiple=True)] = None,
    held_out: float = 0.2,
    classes: Annotated[list[str] | None, Parameter(name="--class", consume_multiple=False)] = None,
    scenes: int = 0,
    weigh_scenes: int = 0,
    scenes_folder: Path = Path("street_scenes"),
    steps: int = 2500,
    learning_rate: float = 3e-3,
    pasted: float = 0.0,
    small_crops: float = 0.0,
    minutes: float = float("inf"),
    patience: int = 6,
    start: Path | None = None,
    keep_start: float = 0.0,
    device: Literal["auto", "cpu", "cuda", "mps"] = "auto",
    workers: int = 1,
    run: Path | None = None,
    resume: bool = False,
    licence: str | None = None,
    threshold: float = 0.9,
    max_distance_m: float = 48.0,
    pictures: Path | None = None,
    report: Path | None = None,
    seed: int = 0,
    overwrite: bool = False,
    quiet: Annotated[bool, Parameter(alias="-q")] = False,
    format: Literal["text", "json"] = "text",
) -> int:
    """Train PoleNet on labelled pictures and on street scenes that it paints itself; or say how good weights are.

    DATA are folders of labelme files (polygons, rectangles, masks), COCO files, or folders with NAME.jpg beside
    NAME.png of instance ids: 0 background, 255 not judged, else one number a pole. A fifth of each is held out,
    drawn by the seed, to judge the weights by and to print precision, recall and thickness error. Curves,
    configuration, the weights of the last validation and the state that --resume goes on from lie in the run folder.
    The same seed gives the same weights on one machine, unless --minutes cut the schedule short.

    Examples:

        scpf train segmenter labelled_campus --start polenet -o campus.safetensors

        scpf train segmenter --scenes 1500 --steps 2500 -o polenet.safetensors

        scpf train segmenter campus simulated/instances.json --validate campus_other_day -o campus.safetensors

        scpf train segmenter --evaluate campus.safetensors campus_other_day --pictures false_positives

        scpf train segmenter --calibrate polenet labelled_campus -o campus.safetensors

    Parameters
    ----------
    data
        Labelled pictures; each folder or file is drawn from equally often, whatever its size.
    output
        The weights to write (.safetensors).
    evaluate
        Train nothing: print the figures of these weights, or of a segmenter by name, on DATA: COCO's mask and box AP,
        precision and recall, thickness error, by distance and visibility where the labels say them.
    calibrate
        Train nothing: fit the score of these weights (a file, or polenet) to every other picture of DATA, so that on a
        new site it means what it says, and write them to --output; the figures are of the other half. Fewer than 100
        candidates in these pictures leave the order of the scores as it is.
    validate
        Pictures to judge by; nothing of DATA is held out then. Take another drive: the frames of one resemble each
        other.
    held_out
        The share of each of DATA that is held out.
    classes
        A label that means a light pole (default: light_pole); repeat it.
    scenes
        Also train on this many painted street scenes, half of the time; and hold out a tenth as many more unless
        --validate is given.
    weigh_scenes
        After a training, or with --calibrate: weigh on so many painted street scenes, full of what resembles a lamp
        post, what speaks for one; 600 are enough. The held-out pictures then set the scale of the score alone.
    scenes_folder
        Where the painted scenes are kept.
    steps
        Optimizer steps of eight crops each.
    learning_rate
        The highest, after the first steps; it falls along half a cosine. Weights that are good already (--start) want
        less: 0.0006.
    pasted
        The share of the crops into which poles cut out of other pictures are pasted, some before drawn scaffolds: the
        network then finds poles in streets unlike those that it learnt. 0.3 is a good deal.
    small_crops
        The share of the steps, the first ones, that see crops of a third of the size: two in the time of one. For
        weights that begin at random: 0.5.
    minutes
        Squeeze the schedule into this time where the steps would take longer.
    patience
        Stop after so many validations (one every 300 steps) without a better mask AP, and write the best weights; 0
        never does, and writes the last.
    start
        Weights to go on from: a file, or polenet for those that come with scpf.
    keep_start
        Write the mean of the trained weights and those of --start, these with so large a share: it knows most of what
        is new, and forgets less. 0.5 is a good one.
    device
        Where to compute; a GPU computes in mixed precision.
    workers
        Threads that make the crops; a GPU needs several.
    run
        The run folder (default: the output's name with _run).
    resume
        Go on with the training in the run folder, with the same options; scenes that are painted stay.
    licence
        The licence of the weights, to be written into them.
    threshold
        With --evaluate: the score from which on a detection counts in precision and recall.
    max_distance_m
        With --evaluate: poles further away need not be found.
    pictures
        With --evaluate: draw each false positive into this new folder.
    report
        Also write all figures to this JSON file.
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

    from scpf.ingest.labelled_folders import DEFAULT_CLASSES
    from scpf.models import devices, polenet
    from scpf.models.errors import InputError, UsageError
    from scpf.models.segmentation_evaluation import EvaluationSettings
    from scpf.models.training_settings import TrainingSettings
    from scpf.replay.segmenter_calibration import calibrate_segmenter
    from scpf.replay.segmenter_data import PaintedScenes, gather
    from scpf.replay.segmenter_evaluation import evaluate_segmenter, table
    from scpf.replay.segmenter_training import run_training

    def say(line: str) -> None:
        if not quiet:
            print(line, file=sys.stderr, flush=True)

    def show(document: dict[str, Any], text: str) -> int:
        complete = json.dumps(document, indent=1, allow_nan=False)
        if report is not None:
            with whole(report) as partial:
                partial.write_text(complete + "\n")
        print(complete if format == "json" else text)
        return 0

    def written(info: polenet.WeightsInfo, **more: str) -> int:
        document = {"output": str(output), **more, "figures": dict(info.figures)}
        lines = [f"{name:<32} {value:.3f}" for name, value in info.figures.items()]
        return show(document, "\n".join([*lines, str(output)]))

    for path in (output, report):
        if path is not None and path.exists() and not overwrite and not resume:
            raise InputError(f"{path} exists", "use --overwrite, or another name")
    wanted = tuple(classes or DEFAULT_CLASSES)
    if evaluate is not None and calibrate is not None:
        raise UsageError("both --evaluate and --calibrate", "first the one, then the other")
    if evaluate is not None:
        if output is not None:
            raise UsageError("--evaluate writes no weights", "leave --output out; --report takes the figures")
        asked = EvaluationSettings(threshold=threshold, max_distance_m=max_distance_m)
        document = evaluate_segmenter(evaluate, list(data or []), wanted, asked, pictures, say)
        return show(document, table(document))
    if output is None:
        raise UsageError("no --output", "name the weights to write: -o NAME.safetensors")
    if (
        scenes < 0 or weigh_scenes < 0 or steps < 1 or minutes <= 0 or patience < 0 or workers < 1
        or not 0 < held_out < 1 or not 0 < learning_rate <= 1 or not 0 <= pasted <= 1 or not 0 <= keep_start < 1
        or not 0 <= small_crops < 1
    ):  # fmt: skip
        raise UsageError(
            "--steps, --minutes and --workers are positive, those of scenes and --patience not negative, "
            "--held-out, --learning-rate, --pasted, --small-crops and --keep-start are between 0 and 1"
        )
    if keep_start and start is None:
        raise UsageError("--keep-start without --start", "name the weights to go on from")
    painted = PaintedScenes(scenes, weigh_scenes, scenes_folder, keep=resume)
    if calibrate is not None:
        if scenes:
            raise UsageError(
                "--calibrate trains on no scenes", "--weigh-scenes weighs the score's evidence on them"
            )
        weights = polenet.weights_path(calibrate)
        return written(calibrate_segmenter(weights, list(data or []), wanted, output, painted, say))
    chosen = devices.choose(device)
    gathered = gather(list(data or []), list(validate or []), wanted, held_out, seed, painted, say)
    say(f"{gathered.counted}, on {chosen}")
    settings = TrainingSettings(
        steps=steps,
        learning_rate=learning_rate,
        pasted=pasted,
        small_crops=small_crops,
        limit_s=60 * minutes,
        patience=patience,
        start=None if start is None else polenet.weights_path(start),
        keep_start=keep_start,
        device=chosen.type,
        workers=workers,
    )
    folder = run or output.with_name(f"{output.stem}_run")
    licence = licence or ("not stated" if data else "Apache-2.0")
    info = run_training(
        gathered, wanted, output, folder, settings, seed, licence, say, resume=resume, overwrite=overwrite
    )
    return written(info, run=str(folder))
