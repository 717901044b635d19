"""How good a distance model is: repeated hold-out, at random as in the paper, and by pole as in use.

A random hold-out has frames of the same pole, a tenth of a second apart, on both sides, and flatters. By
pole is what a drive past new poles gets. In both, the gate and the hyperparameters are those of all data
and only the conditioning is repeated, which keeps 100 repetitions fast; a few repetitions by pole with the
hyperparameters sought anew on the training part show what that choice hides.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.distance import DistanceModel, Predictions
from scpf.models.distance_settings import DistanceSettings
from scpf.models.gaussian_process import MIN_SAMPLES, condition, optimise
from scpf.models.warp import targets
from scpf.replay.distance_training import Samples

Array = NDArray[np.float64]

BANDS_M: Final = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
Z_95: Final = 1.959964
TRAIN_SHARE: Final = 0.8


@dataclass(frozen=True)
class Figures:
    """Errors (prediction − label) of ``n`` predictions.

    ``mae_m``, ``bias_m``, ``rmse_m``; shares of them within ±1.96 σ of the predictive and of the function
    variance (``coverage``, ``function_coverage``: 0.95 is right); ``nll``: mean negative log-likelihood.
    """

    n: int
    mae_m: float
    bias_m: float
    rmse_m: float
    coverage: float
    function_coverage: float
    nll: float


@dataclass(frozen=True, eq=False)
class Residuals:
    """Pooled predictions (N,): ``error_m``, variances (m²), true ``distance_m``, index of the ``expert``."""

    error_m: Array
    variance_m2: Array
    function_variance_m2: Array
    distance_m: Array
    expert: NDArray[np.intp]

    def figures(self, which: NDArray[np.bool_] | None = None) -> Figures | None:
        """Figures of all, or of those that ``which`` (N,) selects; None where there is none."""
        chosen = np.ones(len(self.error_m), dtype=np.bool_) if which is None else which
        if not chosen.any():
            return None
        error, variance = self.error_m[chosen], self.variance_m2[chosen]
        size = np.abs(error)
        return Figures(
            len(error),
            float(size.mean()),
            float(error.mean()),
            float(np.sqrt((error**2).mean())),
            float((size <= Z_95 * np.sqrt(variance)).mean()),
            float((size <= Z_95 * np.sqrt(self.function_variance_m2[chosen])).mean()),
            float((0.5 * np.log(2.0 * np.pi * variance) + 0.5 * error**2 / variance).mean()),
        )


@dataclass(frozen=True, eq=False)
class HoldOut:
    """Residuals of the training and of the validation parts, pooled over the repetitions that had both."""

    repetitions: int
    train: Residuals
    validation: Residuals


def hold_out(
    samples: Samples,
    model: DistanceModel,
    settings: DistanceSettings,
    repetitions: int,
    seed: int,
    *,
    by_pole: bool,
    search: bool = False,
) -> HoldOut:
    """Repeated 80/20 hold-out of samples, or of poles with all their samples.

    ``search``: seek the hyperparameters anew on each training part, from the standard start. An expert is
    left out of a repetition whose training part gives it fewer than 8 samples.
    """
    rng = np.random.default_rng(seed)
    chosen = model.choose(samples.features)
    groups = samples.landmark_ids if by_pole else np.arange(len(samples)).astype(np.str_)
    names = np.unique(groups)
    kept: tuple[list[Residuals], list[Residuals]] = ([], [])
    for _ in range(repetitions):
        training = rng.permutation(names)[: max(1, round(TRAIN_SHARE * len(names)))]
        in_training = np.isin(groups, training)
        for k, (expert, used) in enumerate(zip(model.experts, model.inputs, strict=True)):
            inside, outside = (np.flatnonzero((chosen == k) & part) for part in (in_training, ~in_training))
            if len(inside) < MIN_SAMPLES or not len(outside):
                continue
            if len(inside) > settings.max_samples:
                inside = rng.choice(inside, settings.max_samples, replace=False)
            table, distances = samples.features.columns(used), samples.distances_m
            hyperparameters = expert.hyperparameters
            if search:
                few = inside[: settings.max_search_samples]
                hyperparameters = optimise(table[few], targets(distances[few], expert.warp), seed=seed)
            process = condition(table[inside], distances[inside], hyperparameters, expert.warp)
            for rows, part in zip((inside, outside), kept, strict=True):
                mean, variance, function = process.predict(table[rows])
                index = np.full(len(rows), k, dtype=np.intp)
                part.append(Residuals(mean - distances[rows], variance, function, distances[rows], index))
    return HoldOut(repetitions, _pooled(kept[0]), _pooled(kept[1]))


def residuals(samples: Samples, found: Predictions) -> Residuals:
    """Residuals of predictions of all samples, such as the cross-fitted ones."""
    error = found.mean_m - samples.distances_m
    return Residuals(error, found.variance_m2, found.function_variance_m2, samples.distances_m, found.expert)


def evaluate(
    samples: Samples,
    model: DistanceModel,
    settings: DistanceSettings,
    seed: int,
    repetitions: int = 100,
    searched_repetitions: int = 3,
) -> dict[str, Any]:
    """All figures as plain values, for JSON; the keys are those that ``training_commands`` prints."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):  # as in gaussian_process.optimise
        random = hold_out(samples, model, settings, repetitions, seed, by_pole=False)
        poles = hold_out(samples, model, settings, repetitions, seed + 1, by_pole=True)
    report = {
        "random": _split(model, random),
        "by_pole": _split(model, poles),
        "by_pole_bands": bands(poles.validation),
    }
    if searched_repetitions:
        again = hold_out(samples, model, settings, searched_repetitions, seed + 2, by_pole=True, search=True)
        report["by_pole_searched"] = _split(model, again)
    return report


def per_expert(model_names: Iterable[str], found: Residuals) -> dict[str, Any]:
    """Figures of each expert and of all of them."""
    table = {name: _plain(found.figures(found.expert == k)) for k, name in enumerate(model_names)}
    return {**table, "all": _plain(found.figures())}


def bands(found: Residuals) -> dict[str, Any]:
    """Figures by true distance, in bands of 10 m."""
    table = {}
    for low, high in pairwise(BANDS_M):
        figures = found.figures((found.distance_m >= low) & (found.distance_m < high))
        table[f"{low:.0f}–{high:.0f} m"] = _plain(figures)
    return table


def _split(model: DistanceModel, found: HoldOut) -> dict[str, Any]:
    train, validation = (per_expert(model.names, part) for part in (found.train, found.validation))
    return {"repetitions": found.repetitions, "train": train, "validation": validation}


def _plain(figures: Figures | None) -> dict[str, Any] | None:
    return None if figures is None else asdict(figures)


def _pooled(parts: list[Residuals]) -> Residuals:
    none = np.zeros(0)
    table = [Residuals(none, none, none, none, np.zeros(0, dtype=np.intp)), *parts]
    return Residuals(
        np.concatenate([part.error_m for part in table]),
        np.concatenate([part.variance_m2 for part in table]),
        np.concatenate([part.function_variance_m2 for part in table]),
        np.concatenate([part.distance_m for part in table]),
        np.concatenate([part.expert for part in table]),
    )
