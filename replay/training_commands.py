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
    preset: Literal["paper", "thickness"] = "paper",
    experts: int | None = None,
    every: int = 1,
    max_distance_m: float = 60.0,
    seed: int = 0,
    repetitions: int = 100,
    overwrite: bool = False,
    report: Path | None = None,
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
        Features of the experts: `paper`, or `thickness` (the far expert sees the thickness, too).
    experts
        How many experts share the distances, 1 to 5 (default: the preset's); 1 for a single one.
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
    from scpf.replay.distance_comparisons import compare
    from scpf.replay.distance_evaluation import bands, evaluate, per_expert, residuals
    from scpf.replay.distance_report import table
    from scpf.replay.distance_training import cross_fit, gather, train

    if every < 1 or folds < 2 or repetitions < 1 or max_distance_m <= 0:
        raise UsageError("--every, --repetitions and --max-distance-m are at least 1, --folds at least 2")
    if experts is not None and not 1 <= experts <= 5:
        raise UsageError(f"--experts {experts}: 1 to 5 experts can share the distances")
    for path in (output, cross_fitted, report):
        if path is not None and path.exists() and not overwrite:
            raise UsageError(f"{path} exists", "choose another name, or give --overwrite")

    say = _progress(quiet)
    settings = PRESETS[preset] if experts is None else replace(PRESETS[preset], experts=experts)
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
    figures: dict[str, Any] = {
        "samples": len(samples),
        "poles": int(notes["poles"]),
        "frames": samples.frames,
        "unreadable_frames": samples.unreadable,
        "dropped": dict(samples.dropped),
        "model": model.metadata,
        **evaluate(samples, model, settings, seed, repetitions),
    }
    say("comparing")
    figures["comparisons"] = {
        split: compare(samples, model, settings, seed, repetitions, by_pole=split == "by_pole")
        for split in ("random", "by_pole")
    }
    if cross_fitted is not None:
        say("cross-fitting")
        fitted = cross_fit(samples, model, settings, seed, folds)
        fitted.save(cross_fitted)
        pooled = residuals(samples, fitted.held_out)
        figures["cross_fitted"] = per_expert(model.names, pooled)
        figures["cross_fitted_bands"] = bands(pooled)
    say("")
    text = json.dumps(figures, indent=1, allow_nan=False)
    if report is not None:
        partial = report.with_name(report.name + ".partial")
        partial.write_text(text + "\n")
        partial.replace(report)
    written = [path for path in (output, cross_fitted, report) if path is not None]
    print(text if format == "json" else table(figures, written))
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
