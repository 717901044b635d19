"""The paper's comparisons: groups on the same repetitions, and a test that finds what is there and no more."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from pole_scenes import camera

from scpf.models.distance_settings import DistanceSettings
from scpf.models.features import Features
from scpf.models.gaussian_process import Hyperparameters
from scpf.replay.distance_comparisons import Part, compare, held_out_maes, tukey
from scpf.replay.distance_training import Samples, train

QUICK = DistanceSettings(restarts=0, max_search_samples=40)


def made(n: int = 160, seed: int = 0) -> Samples:
    """Samples of eight poles whose box says little, whose thickness says all, and which come in two kinds."""
    rng = np.random.default_rng(seed)
    far = np.arange(n) % 2 == 1
    distance = np.where(far, rng.uniform(30, 50, n), rng.uniform(5, 20, n))
    thickness = 130.0 / distance + rng.normal(0.0, 0.01, n)
    x1, y1 = rng.uniform(0, 900, n), np.where(far, rng.uniform(200, 300, n), 0.0)
    values = np.column_stack([x1, x1 + 30.0, y1, rng.uniform(400, 700, n), thickness])
    flags = np.zeros(n, dtype=bool)
    features = Features(("x1", "x2", "y1", "y2", "thickness"), values, flags, flags)
    ids = np.array([f"P{k}" for k in (np.arange(n) // 2) % 8])
    return Samples(features, distance, ids, np.arange(n), camera(), n, 0, {}, np.full(n, "light_pole"))


def test_the_better_contender_is_found() -> None:
    samples = made()
    model = train(samples, replace(QUICK, far=QUICK.close), 0)
    assert model.names == ("close", "far")
    for by_pole in (False, True):
        report = compare(samples, model, QUICK, 0, 8, by_pole=by_pole)
        assert list(report) == ["close", "far", "all"]
        for name in ("close", "far"):
            (pair,) = report[name]["pairs"]
            assert pair["pair"] == ["box", "box + mask"]
            assert pair["low_m"] > 1.0
            assert pair["p"] < 0.01
            assert report[name]["mae_m"]["box + mask"] < 1.0
        assert list(report["all"]["mae_m"]) == ["mixture", "single"]
        json.dumps(report, allow_nan=False)


def test_a_contender_does_not_beat_itself() -> None:
    samples = made()
    part = Part(np.arange(160), ("thickness",), Hyperparameters(100.0, np.array([1.0]), 0.1))
    maes = held_out_maes(samples, {"a": [part], "b": [part]}, QUICK, 5, 0, by_pole=False)
    np.testing.assert_array_equal(maes["a"], maes["b"])
    found = tukey(maes)
    assert found is not None
    assert found["pairs"][0]["difference_m"] == 0.0
    assert found["pairs"][0]["p"] == pytest.approx(1.0)
    assert found["repetitions"] == 5


def test_a_pole_is_held_out_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    from scpf.replay import distance_comparisons

    samples = made()
    learnt: list[set[str]] = []

    def spy(table, distances, hyperparameters, warp):  # type: ignore[no-untyped-def]
        learnt.append(set(samples.landmark_ids[np.isin(samples.distances_m, distances)]))
        return Known()

    class Known:
        def predict(self, table: np.ndarray) -> tuple[np.ndarray]:
            return (np.zeros(len(table)),)

    monkeypatch.setattr(distance_comparisons, "condition", spy)
    part = Part(np.arange(160), ("thickness",), Hyperparameters(100.0, np.array([1.0]), 0.1))
    held_out_maes(samples, {"a": [part]}, QUICK, 4, 0, by_pole=True)
    assert [len(poles) for poles in learnt] == [6, 6, 6, 6]


def test_tukey_is_scipys_and_says_nothing_without_groups() -> None:
    from scipy.stats import ttest_ind

    rng = np.random.default_rng(0)
    a, b = rng.normal(1.0, 0.1, 20), rng.normal(1.05, 0.1, 20)
    found = tukey({"a": a, "b": b})
    assert found is not None
    assert found["pairs"][0]["p"] == pytest.approx(
        ttest_ind(a, b).pvalue, rel=1e-3
    )  # two groups: the same test
    assert found["pairs"][0]["difference_m"] == pytest.approx(a.mean() - b.mean())
    assert tukey({"a": a[:1], "b": b[:1]}) is None
    assert tukey({"a": np.ones(5), "b": np.ones(5)}) is None


def test_few_samples_give_no_verdict() -> None:
    samples = made().rows(np.arange(9))
    part = Part(np.arange(9), ("thickness",), Hyperparameters(100.0, np.array([1.0]), 0.1))
    maes = held_out_maes(samples, {"a": [part]}, QUICK, 3, 0, by_pole=False)
    assert maes["a"].size == 0  # seven of nine are left to learn from
