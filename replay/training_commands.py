"""``scpf train distance``: from drive logs to a distance model and a table of its errors."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter


def train_distance(
    logs: list[Path],
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
    paper's two comparisons by Tukey's test: box or box and mask, one expert or a mixture.

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
        `polenet`, `recorded` (masks that the log holds), or a .safetensors file.
    preset
        Features of the experts: `paper`, or `default` (this project's best, with further features of the mask).
    experts
        How many experts share the distances, 1 to 5 (default: the preset's); 1 for a single one.
    close
        A feature of the expert for close poles, and of all but the farthest; repeat it (default: the preset's).
    far
        A feature of the expert for the farthest poles; repeat it (default: the preset's).
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
    from scpf.replay.distance_comparisons import compare
    from scpf.replay.distance_evaluation import bands, evaluate, hold_out, per_expert, residuals
    from scpf.replay.distance_figures import check_matplotlib, draw, figure_paths
    from scpf.replay.distance_report import table
    from scpf.replay.distance_training import cross_fit, gather, train

    if every < 1 or folds < 2 or repetitions < 1 or max_distance_m <= 0:
        raise UsageError("--every, --repetitions and --max-distance-m are at least 1, --folds at least 2")
    if experts is not None and not 1 <= experts <= 5:
        raise UsageError(f"--experts {experts}: 1 to 5 experts can share the distances")
    drawn = [] if figures is None else figure_paths(figures)
    written = [path for path in (output, cross_fitted, report, *drawn) if path is not None]
    for path in written:
        if path.exists() and not overwrite:
            raise UsageError(f"{path} exists", "choose another name, or give --overwrite")
    if figures is not None:
        check_matplotlib()  # before the long work, not after it

    say = _progress(quiet)
    settings = PRESETS[preset]
    settings = replace(
        settings,
        experts=experts or settings.experts,
        close=close or settings.close,
        far=far or settings.far,
    )
    check_names(settings.features)
    samples = gather(
        logs,
        segmenter,
        threshold,
        every,
        max_distance_m,
        lambda frames, n: say(f"{frames} frames, {n} samples"),
        tuple(dict.fromkeys((*GATE_FEATURES, *settings.features))),
    )
    say(f"fitting {len(samples)} samples")
    notes = {
        "logs": ", ".join(log.name for log in logs),
        "segmenter": Path(segmenter).name,
        "score_threshold": f"{threshold:g}",
        "every": str(every),
        "max_distance_m": f"{max_distance_m:g}",
        "preset": preset,
        "seed": str(seed),
        "samples": str(len(samples)),
        "poles": str(len(set(samples.landmark_ids.tolist()))),
    }
    model = train(samples, settings, seed, notes)
    model.save(output)
    say("evaluating")
    results: dict[str, Any] = {
        "samples": len(samples),
        "poles": int(notes["poles"]),
        "frames": samples.frames,
        "unreadable_frames": samples.unreadable,
        "dropped": dict(samples.dropped),
        "model": model.metadata,
        **evaluate(samples, model, settings, seed, repetitions),
    }
    say("comparing")
    results["comparisons"] = {
        split: compare(samples, model, settings, seed, repetitions, by_pole=split == "by_pole")
        for split in ("random", "by_pole")
    }
    if cross_fitted is not None:
        say("cross-fitting")
        fitted = cross_fit(samples, model, settings, seed, folds)
        fitted.save(cross_fitted)
        pooled = residuals(samples, fitted.held_out)
        results["cross_fitted"] = per_expert(model.names, pooled)
        results["cross_fitted_bands"] = bands(pooled)
    if figures is not None:
        again = hold_out(samples, model, settings, repetitions, seed + 1, by_pole=True)  # evaluate's own
        about = f"{len(samples)} samples of {notes['poles']} poles, preset {preset}, {notes['logs']}"
        draw(figures, model.names, again.validation, results["comparisons"], about)
    say("")
    text = json.dumps(results, indent=1, allow_nan=False)
    if report is not None:
        partial = report.with_name(report.name + ".partial")
        partial.write_text(text + "\n")
        partial.replace(report)
    print(text if format == "json" else table(results, written))
    if samples.unreadable:
        print(f"scpf: {samples.unreadable} of {samples.frames} frames could not be decoded", file=sys.stderr)
    return 3 if samples.unreadable else 0


def _progress(quiet: bool) -> Callable[[str], None]:
    """A line on stderr that each call replaces; silent where stderr is no terminal."""
    shown = not quiet and sys.stderr.isatty()

    def say(text: str) -> None:
        if shown:
            sys.stderr.write(f"\r\x1b[K{text}")
            sys.stderr.flush()

    return say
