"""Fitting of a distance model: the gate divides the samples, each expert learns its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scpf.models.distance import DistanceModel, TrainedOn
from scpf.models.distance_gate import Gate, expert_names, fit_gate
from scpf.models.distance_settings import DistanceSettings
from scpf.models.errors import InputError
from scpf.models.features import Features, check_names
from scpf.models.gaussian_process import (
    MIN_SAMPLES,
    GaussianProcess,
    Hyperparameters,
    condition,
    log_likelihood,
    optimise,
)
from scpf.models.warp import POWERS, Warp, targets

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def fit(
    features: Features,
    distances_m: Array,
    settings: DistanceSettings,
    seed: int,
    trained_on: TrainedOn,
    start: DistanceModel | None = None,
) -> DistanceModel:
    """The model of maximum marginal likelihood for N instances and their distances (N,) in m.

    ``start``: a model whose hyperparameters the search begins with, instead of restarts (cross-fitting).
    Where one of the gate's components has fewer than 8 samples there are fewer experts than
    ``settings.experts``, and ``trained_on.notes["gate"]`` says so. Raises InputError for fewer than 8
    samples in all, for an unknown feature, and for instances that are too small.
    """
    for names in settings.inputs(max(settings.experts, 1)):
        check_names(names)
    if settings.experts < 1 or len(features) != len(distances_m):
        raise InputError(
            f"{settings.experts} experts, {len(features)} instances, {len(distances_m)} distances"
        )
    if len(features) < MIN_SAMPLES or features.too_small.any():
        small = int(features.too_small.sum())
        raise InputError(
            f"{len(features)} training samples, {small} of them too small; at least {MIN_SAMPLES} are needed",
            "train with more frames, or on a longer drive",
        )
    gate, chosen = _divide(features, settings.experts, seed)
    inputs = settings.inputs(1 if gate is None else len(gate.shares))
    if len(inputs) < settings.experts:
        note = f"{', '.join(expert_names(len(inputs)))}: too few samples for {settings.experts} experts"
        trained_on = replace(trained_on, notes={**trained_on.notes, "gate": note})
    warm = start is not None and start.inputs == inputs
    rng = np.random.default_rng(seed)
    experts = []
    for k, names in enumerate(inputs):
        rows = _thin(np.flatnonzero(chosen == k), settings.max_samples, rng)
        few = _thin(rows, settings.max_search_samples, rng)
        table = features.columns(names)
        known = start.experts[k] if warm and start is not None else None
        found, warp = search(table[few], distances_m[few], settings, seed, known)
        experts.append(condition(table[rows], distances_m[rows], found, warp))
    return DistanceModel(gate, tuple(experts), inputs, trained_on)


def search(
    table: Array,
    distances_m: Array,
    settings: DistanceSettings,
    seed: int,
    known: GaussianProcess | None = None,
) -> tuple[Hyperparameters, Warp | None]:
    """Hyperparameters of maximum likelihood for features (N, D) and distances (N,), and the warp where one is wanted.

    ``known``: an expert whose hyperparameters the search begins with, and whose warp it keeps.
    """
    warp, start, restarts = None, None, settings.restarts
    if known is not None:
        warp, start, restarts = known.warp, known.hyperparameters, 0
    elif settings.warped:
        found = {
            each: optimise(table, each.targets(distances_m), seed=seed)
            for each in (Warp.of(power, distances_m) for power in POWERS)
        }
        warp = max(
            found,
            key=lambda each: log_likelihood(condition(table, distances_m, found[each], each), distances_m),
        )
        start = found[warp]
    learnt = targets(distances_m, warp)
    return optimise(table, learnt, restarts=restarts, seed=seed, start=start), warp


def _divide(features: Features, most: int, seed: int) -> tuple[Gate | None, Indices]:
    """The gate with as many experts, at most so many, as have 8 samples each; which (N,) answers for each row."""
    for experts in range(min(most, len(features) // MIN_SAMPLES), 1, -1):
        gate = fit_gate(features, experts, seed)
        chosen = gate.experts(features)
        if np.bincount(chosen, minlength=experts).min() >= MIN_SAMPLES:
            return gate, chosen
    return None, np.zeros(len(features), dtype=np.intp)


def _thin(rows: Indices, most: int, rng: np.random.Generator) -> Indices:
    return rows if len(rows) <= most else np.sort(rng.choice(rows, most, replace=False))
