"""The paper's two comparisons: box against box and mask, and one expert against a mixture; Tukey's test decides.

Every contender is held out on the same repetitions; a repetition's mean absolute error is one value of its group.
The hyperparameters are those of all samples, as in ``distance_evaluation``. Repetitions share samples, so the test,
which takes them for independent, is surer than it should be: the paper's procedure, with the paper's flaw.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.distance import DistanceModel
from scpf.models.distance_fit import fit, search
from scpf.models.distance_settings import DistanceSettings
from scpf.models.features import BOX
from scpf.models.gaussian_process import MIN_SAMPLES, Hyperparameters, condition
from scpf.models.warp import Warp
from scpf.replay.distance_training import Samples

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

TRAIN_SHARE: Final = 0.8
CONFIDENCE: Final = 0.95


@dataclass(frozen=True, eq=False)
class Part:
    """One expert of a contender: the samples it answers for (indices), its features, hyperparameters and warp."""

    rows: Indices
    features: tuple[str, ...]
    hyperparameters: Hyperparameters
    warp: Warp | None = None


Contenders = Mapping[str, Sequence[Part]]


def compare(
    samples: Samples,
    model: DistanceModel,
    settings: DistanceSettings,
    seed: int,
    repetitions: int = 100,
    *,
    by_pole: bool,
) -> dict[str, Any]:
    """Both comparisons as plain values: for each of the model's experts, and "all" for mixture and single.

    A comparison holds ``mae_m`` of each contender and ``pairs`` with the difference of their means, its interval
    at 95 % and the p-value of Tukey's honestly significant difference; it is None where fewer than two
    repetitions had enough samples on either side. The samples need the box and the thickness as features.
    """
    from threadpoolctl import threadpool_limits

    mask = settings.close if set(settings.close) - set(BOX) else (*BOX, "thickness")
    chosen = model.choose(samples.features)
    report: dict[str, Any] = {}
    with threadpool_limits(1, "blas"):  # as in gaussian_process.optimise
        for k, name in enumerate(model.names):
            rows = np.flatnonzero(chosen == k)
            contenders = {
                "box": [_part(samples, rows, BOX, settings, seed)],
                "box + mask": [_part(samples, rows, mask, settings, seed)],
            }
            report[name] = tukey(
                held_out_maes(samples, contenders, settings, repetitions, seed, by_pole=by_pole)
            )
        several = len(model.experts) > 1
        other = replace(settings, close=mask, experts=1 if several else 2)
        rival = fit(samples.features, samples.distances_m, other, seed, model.trained_on)
        mixture, single = (model, rival) if several else (rival, model)
        if len(mixture.experts) > 1:
            contenders = {"mixture": _parts(samples, mixture), "single": _parts(samples, single)}
            report["all"] = tukey(
                held_out_maes(samples, contenders, settings, repetitions, seed, by_pole=by_pole)
            )
    return report


def held_out_maes(
    samples: Samples,
    contenders: Contenders,
    settings: DistanceSettings,
    repetitions: int,
    seed: int,
    *,
    by_pole: bool,
) -> dict[str, Array]:
    """Mean absolute error (R,) in m of each contender on the same held-out fifths of samples or of poles.

    R ≤ ``repetitions``: one in which a contender's expert has fewer than 8 samples to learn from is left out, as
    is one without a sample to predict.
    """
    rng = np.random.default_rng(seed)
    groups = samples.landmark_ids if by_pole else np.arange(len(samples)).astype(np.str_)
    names = np.unique(groups)
    found: dict[str, list[float]] = {name: [] for name in contenders}
    for _ in range(repetitions):
        training = np.isin(groups, rng.permutation(names)[: max(1, round(TRAIN_SHARE * len(names)))])
        errors = {
            name: _held_out(samples, parts, training, settings.max_samples, rng)
            for name, parts in contenders.items()
        }
        if all(each is not None for each in errors.values()):
            for name, each in errors.items():
                found[name].append(float(np.abs(each).mean()) if each is not None else np.nan)
    return {name: np.array(values) for name, values in found.items()}


def tukey(maes_m: Mapping[str, Array]) -> dict[str, Any] | None:
    """Tukey's test of groups of errors; None where it has nothing to compare.

    A pair's ``difference_m`` is the first one's mean less the second's: positive where the second is better.
    """
    from scipy.stats import tukey_hsd

    groups = [np.asarray(values) for values in maes_m.values()]
    if min(len(values) for values in groups) < 2 or max(float(np.ptp(values)) for values in groups) < 1e-12:
        return None
    test = tukey_hsd(*groups)
    interval = test.confidence_interval(CONFIDENCE)
    pairs = [
        {
            "pair": [first, second],
            "difference_m": float(test.statistic[i, j]),
            "low_m": float(interval.low[i, j]),
            "high_m": float(interval.high[i, j]),
            "p": float(test.pvalue[i, j]),
        }
        for (i, first), (j, second) in combinations(enumerate(maes_m), 2)
    ]
    means = {name: float(np.mean(values)) for name, values in maes_m.items()}
    return {"repetitions": len(groups[0]), "mae_m": means, "pairs": pairs}


def _held_out(
    samples: Samples,
    parts: Sequence[Part],
    training: NDArray[np.bool_],
    most: int,
    rng: np.random.Generator,
) -> Array | None:
    """Errors (m) of all held-out samples; None where there is none, or too few to learn from."""
    errors = []
    for part in parts:
        inside, outside = part.rows[training[part.rows]], part.rows[~training[part.rows]]
        if not len(outside):
            continue
        if len(inside) < MIN_SAMPLES:
            return None
        if len(inside) > most:
            inside = rng.choice(inside, most, replace=False)
        table = samples.features.columns(part.features)
        process = condition(table[inside], samples.distances_m[inside], part.hyperparameters, part.warp)
        errors.append(process.predict(table[outside])[0] - samples.distances_m[outside])
    return np.concatenate(errors) if errors else None


def _part(
    samples: Samples, rows: Indices, features: tuple[str, ...], settings: DistanceSettings, seed: int
) -> Part:
    """An expert with other features for the same samples."""
    few = rows
    if len(rows) > settings.max_search_samples:
        few = np.random.default_rng(seed).choice(rows, settings.max_search_samples, replace=False)
    table = samples.features.columns(features)[few]
    return Part(rows, features, *search(table, samples.distances_m[few], settings, seed))


def _parts(samples: Samples, model: DistanceModel) -> list[Part]:
    chosen = model.choose(samples.features)
    return [
        Part(np.flatnonzero(chosen == k), names, expert.hyperparameters, expert.warp)
        for k, (expert, names) in enumerate(zip(model.experts, model.inputs, strict=True))
    ]
