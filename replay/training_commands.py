"""``scpf train distance``: from drive logs to a distance model and a table of its errors."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from scpf.models.whole_files import whole
from scpf.replay.status_line import StatusLine


def train_distance(
    logs: list[Path],
    /,
    *,
    output: Annotated[Path, Parameter(alias="-o")],
    cross_fitted: Path | None = None,
    folds: int = 10,
    segmenter: str = "polenet",
    threshold: float = 0.9,
    preset: Literal["paper", "default"] = "paper",
    experts: int | None = None,
    close: tuple[str, ...] = (),
    far: tuple[str, ...] = (),
    warped: bool | None = None,
    every: int = 1,
    max_distance_m: float = 60.0,
    seed: int = 0,
    repetitions: int = 100,
    overwrite: bool = False,
    report: Path | None = None,
    figures: Path | None = None,
    quiet: Annotated[bool, Parameter(alias="-q")] = False,
    format: Literal["text", "json"] = "text",
) -> int:
    """Fit the distance experts to drive logs with calibration, reference trajectory and map.

    Every instance that the segmenter finds is matched to a mapped pole by the reference pose; its box and the
    thickness of its mask, with the distance to that pole, are a sample. Prints errors of held-out samples, and the
    paper's two comparisons by Tukey's test: box or box and mask, one expert or a mixture. Each landmark class gets a
    model of its own.

    Examples:

        scpf train distance drive.mcap -o distance.npz

        scpf train distance mon.mcap tue.mcap -o distance.npz --segmenter recorded --report errors.json

        scpf train distance drive.mcap -o distance.npz --preset default --figures figures

    Parameters
    ----------
    logs
        Drive logs of one camera.
    output
        The model file to write (.npz).
    cross_fitted
        Also write a model for a replay of these very logs: each distance by a model that never saw the pole.
    folds
        Into how many parts the poles are dealt for that.
    segmenter
        `polenet`, `thorough` (three looks at each picture), `recorded` (masks that the log holds), or a
        .safetensors file.
    preset
        `paper`, or `default`: this project's best, with further features of the mask, and warped.
    experts
        How many experts share the distances, 1 to 5 (default: the preset's); 1 for a single one.
    close
        A feature of the expert for close poles, and of all but the farthest; repeat it (default: the preset's).
    far
        A feature of the expert for the farthest poles; repeat it (default: the preset's).
    warped
        Each expert learns the power of the distance that is likeliest, so that its bands grow with the distance as
        errors do (default: the preset's).
    threshold
        Detections of a lower score are left out.
    every
        Take every n-th frame.
    max_distance_m
        Poles further away are not learnt.
    seed
        Seed of gate, hyperparameter search and hold-outs.
    repetitions
        Repetitions of each hold-out.
    overwrite
        Replace files of that name.
    report
        Also write all figures to this JSON file.
    figures
        Also draw predictions, errors, coverage and comparisons into this folder, as PNG (needs `scpf[figures]`).
    quiet
        No progress on stderr.
    format
        How to print the figures on stdout.
    """
    import json
    from dataclasses import replace

    from scpf.models.distance_gate import GATE_FEATURES
    from scpf.models.distance_settings import PRESETS
    from scpf.models.errors import UsageError
    from scpf.models.features import check_names
    from scpf.replay.distance_classes import Judged, by_class, judge, together
    from scpf.replay.distance_figures import check_matplotlib, draw, drawn
    from scpf.replay.distance_report import table
    from scpf.replay.distance_training import gather

    if every < 1 or folds < 2 or repetitions < 1 or max_distance_m <= 0:
        raise UsageError("--every, --repetitions and --max-distance-m are at least 1, --folds at least 2")
    if experts is not None and not 1 <= experts <= 5:
        raise UsageError(f"--experts {experts}: 1 to 5 experts can share the distances")
    there = [] if figures is None else drawn(figures)
    written = [path for path in (output, cross_fitted, report) if path is not None]
    for path in (*written, *there):
        if path.exists() and not overwrite:
            raise UsageError(f"{path} exists", "choose another name, or give --overwrite")
    if figures is not None:
        check_matplotlib()  # before the long work, not after it

    status = StatusLine(quiet)
    settings = PRESETS[preset]
    settings = replace(
        settings,
        experts=experts or settings.experts,
        close=close or settings.close,
        far=far or settings.far,
        warped=settings.warped if warped is None else warped,
    )
    check_names(settings.features)
    samples = gather(
        logs,
        segmenter,
        threshold,
        every,
        max_distance_m,
        lambda frames, n: status.show(f"{frames} frames, {n} samples"),
        tuple(dict.fromkeys((*GATE_FEATURES, *settings.features))),
    )
    classes, few = by_class(samples)
    notes = {
        "logs": ", ".join(log.name for log in logs),
        "segmenter": Path(segmenter).name,
        "score_threshold": f"{threshold:g}",
        "every": str(every),
        "max_distance_m": f"{max_distance_m:g}",
        "preset": preset,
        "seed": str(seed),
    }
    judged: dict[str, Judged] = {}
    for name, mine in classes.items():
        parts = None if cross_fitted is None else folds
        judged[name] = judge(mine, settings, seed, repetitions, notes, parts, status.show)
    together({name: each.model for name, each in judged.items()}).save(output)
    if cross_fitted is not None:
        fitted = {name: each.cross_fitted for name, each in judged.items() if each.cross_fitted is not None}
        together(fitted).save(cross_fitted)
    results: dict[str, Any] = {
        "frames": samples.frames,
        "unreadable_frames": samples.unreadable,
        "dropped": dict(samples.dropped),
        "too_few_samples": few,
        "classes": {name: each.figures for name, each in judged.items()},
    }
    if figures is not None:
        for name, each in judged.items():
            about = (
                f"{len(classes[name])} samples of {each.figures['poles']} poles, {notes['logs']}, {preset}"
            )
            held_out, comparisons = each.by_pole.validation, each.figures["comparisons"]
            written += draw(figures, name, each.model.names, held_out, comparisons, about)
    status.clear()
    text = json.dumps(results, indent=1, allow_nan=False)
    if report is not None:
        with whole(report) as partial:
            partial.write_text(text + "\n")
    print(text if format == "json" else table(results, written))
    if samples.unreadable:
        print(f"scpf: {samples.unreadable} of {samples.frames} frames could not be decoded", file=sys.stderr)
    for name, count in few.items():
        print(f"scpf: no model for {name}: {count} samples are too few", file=sys.stderr)
    return 3 if samples.unreadable or few else 0
