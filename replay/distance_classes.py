"""One distance model for each landmark class of some drive logs, trained and judged."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from scpf.models.cross_fitted import CrossFittedDistance
from scpf.models.distance import DistanceModel
from scpf.models.distance_classes import DistanceByClass
from scpf.models.distance_file import Distances
from scpf.models.distance_settings import DistanceSettings
from scpf.models.errors import InputError
from scpf.models.gaussian_process import MIN_SAMPLES
from scpf.replay.distance_comparisons import compare
from scpf.replay.distance_evaluation import HoldOut, bands, evaluate, hold_out, per_expert, residuals
from scpf.replay.distance_training import Samples, cross_fit, train


@dataclass(frozen=True, eq=False)
class Judged:
    """A class' model, the same cross-fitted where asked for, its figures, and its hold-out by pole."""

    model: DistanceModel
    cross_fitted: CrossFittedDistance | None
    figures: dict[str, Any]
    by_pole: HoldOut


def by_class(samples: Samples) -> tuple[dict[str, Samples], dict[str, int]]:
    """The samples of each class that has enough to learn from; how many each of the others has.

    InputError where no class has enough.
    """
    parts = samples.by_class()
    enough = {name: part for name, part in parts.items() if len(part) >= MIN_SAMPLES}
    few = {name: len(part) for name, part in parts.items() if len(part) < MIN_SAMPLES}
    if not enough:
        counts = ", ".join(f"{count} of {name}" for name, count in few.items())
        raise InputError(
            f"too few training samples: {counts}; at least {MIN_SAMPLES} are needed",
            "train with more frames, or on a longer drive",
        )
    return enough, few


def judge(
    samples: Samples,
    settings: DistanceSettings,
    seed: int,
    repetitions: int,
    notes: Mapping[str, str],
    folds: int | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> Judged:
    """Train a model on the samples of one class, and say how good it is; cross-fit it where ``folds`` is given."""
    poles = len(set(samples.landmark_ids.tolist()))
    (name,) = samples.by_class()
    say(f"{name}: fitting")
    model = train(samples, settings, seed, {**notes, "samples": str(len(samples)), "poles": str(poles)})
    say(f"{name}: evaluating")
    figures: dict[str, Any] = {
        "samples": len(samples),
        "poles": poles,
        "model": model.metadata,
        **evaluate(samples, model, settings, seed, repetitions),
    }
    say(f"{name}: comparing")
    figures["comparisons"] = {
        split: compare(samples, model, settings, seed, repetitions, by_pole=split == "by_pole")
        for split in ("random", "by_pole")
    }
    fitted = None
    if folds is not None:
        say(f"{name}: cross-fitting")
        fitted = cross_fit(samples, model, settings, seed, folds)
        pooled = residuals(samples, fitted.held_out)
        figures["cross_fitted"] = per_expert(model.names, pooled)
        figures["cross_fitted_bands"] = bands(pooled)
    again = hold_out(samples, model, settings, repetitions, seed + 1, by_pole=True)  # the one in the figures
    return Judged(model, fitted, figures, again)


def together(models: Mapping[str, DistanceModel] | Mapping[str, CrossFittedDistance]) -> Distances:
    """What is saved: the model of the only class, or all of them."""
    if len(models) == 1:
        (model,) = models.values()
        return model
    return DistanceByClass(models)
