"""Distances learnt on the scale of a power: there and back, the choice of the power, and what it is good for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from distance_scenes import ABOUT, LENS, QUICK, changed, scene, version
from scipy import stats

from scpf.models.distance import DistanceModel, Predictions
from scpf.models.distance_fit import fit
from scpf.models.distance_settings import PRESETS
from scpf.models.errors import DamagedError
from scpf.models.features import BOX, Features, measure
from scpf.models.gaussian_process import Hyperparameters, condition, log_likelihood
from scpf.models.warp import POWERS, RANGE_M, Warp
from scpf.replay.distance_comparisons import Part, held_out_maes
from scpf.replay.distance_evaluation import hold_out
from scpf.replay.distance_training import Samples, train

WARPED = replace(QUICK, warped=True)
TRUE_M = np.array([6.0, 20.0, 55.0])


@pytest.mark.parametrize("power", POWERS)
def test_a_distance_comes_back_with_its_variance(power: float) -> None:
    warp, deviations_m = Warp.of(power, TRUE_M), np.array([0.02, 0.2, 0.8])
    assert warp.scale_m == pytest.approx(stats.gmean(TRUE_M))
    draws = warp.targets(TRUE_M + deviations_m * np.random.default_rng(0).standard_normal((50_000, 3)))
    means_m, variances_m2 = warp.distances(warp.targets(TRUE_M), np.stack([draws.var(0), 4.0 * draws.var(0)]))
    assert means_m == pytest.approx(TRUE_M)
    assert np.sqrt(variances_m2) == pytest.approx(np.outer([1.0, 2.0], deviations_m), rel=0.02)


@pytest.mark.parametrize("power", POWERS)
def test_what_is_beyond_all_distances_is_as_far_as_can_be(power: float) -> None:
    warp = Warp(power, 20.0)
    means_m, variances_m2 = warp.distances(np.array([-1e6, 1e6, np.nan]), np.array([[1.0, 1.0, np.nan]]))
    assert means_m[:2] == pytest.approx(RANGE_M)
    assert np.isnan(means_m[2]) and np.isfinite(variances_m2[0, :2]).all()


@pytest.mark.parametrize("power", POWERS)
def test_the_likelihood_is_that_of_the_distances(power: float) -> None:
    rng = np.random.default_rng(1)
    features, distances_m = rng.normal(size=(12, 2)), rng.uniform(8.0, 50.0, 12)
    warp = Warp.of(power, distances_m)
    process = condition(features, distances_m, Hyperparameters(30.0, np.array([1.0, 2.0]), 0.5), warp)
    covariance = process.factor @ process.factor.T
    density = stats.multivariate_normal(np.full(12, process.offset_m), covariance)
    step_m = 1e-5
    slopes = (warp.targets(distances_m + step_m) - warp.targets(distances_m - step_m)) / (2 * step_m)
    expected = density.logpdf(warp.targets(distances_m)) + np.log(slopes).sum()
    assert log_likelihood(process, distances_m) == pytest.approx(expected)


def drawn(power: float, n: int, seed: int) -> tuple[Features, np.ndarray]:
    """Boxes that tell the distance, but for noise that is alike on the scale of ``power``."""
    rng = np.random.default_rng(seed)
    told_m = rng.uniform(10.0, 60.0, n)
    warp = Warp(power, 25.0)
    true_m, _ = warp.distances(warp.targets(told_m) + 0.4 * rng.standard_normal(n), np.zeros((1, n)))
    values = np.stack(
        [rng.uniform(0, 900, n), rng.uniform(0, 900, n), 900.0 / told_m, 6000.0 / told_m], axis=1
    )
    return Features(BOX, values, np.zeros(n, bool), np.zeros(n, bool)), true_m


@pytest.mark.parametrize("power", [0.0, -1.0])
def test_the_likeliest_power_is_found_and_its_bands_hold_near_and_far(power: float) -> None:
    features, distances_m = drawn(power, 250, 0)
    settings = replace(WARPED, close=BOX, experts=1)
    model, plain = (
        fit(features, distances_m, replace(settings, warped=warped), 0, ABOUT) for warped in (True, False)
    )
    assert model.experts[0].warp is not None and model.experts[0].warp.power == power
    assert plain.experts[0].warp is None
    new, true_m = drawn(power, 1000, 1)
    near, far = true_m < 20.0, true_m > 40.0
    found, from_plain = model.predict_features(new), plain.predict_features(new)
    assert 0.9 < _covered(found, true_m, near) < 0.99 and 0.9 < _covered(found, true_m, far) < 0.99
    # One noise variance for all is too large near and too small far.
    assert _covered(from_plain, true_m, near) > 0.99 and _covered(from_plain, true_m, far) < 0.93


def _covered(found: Predictions, true_m: np.ndarray, part: np.ndarray) -> float:
    within = np.abs(found.mean_m - true_m) < 1.96 * np.sqrt(found.variance_m2)
    return float(within[part].mean())


@pytest.fixture(scope="module")
def warped() -> DistanceModel:
    instances, distances_m = scene(90)
    return fit(measure(instances, 1024, 768), distances_m, WARPED, 0, ABOUT)


def test_a_warped_model_comes_back_bit_equal(warped: DistanceModel, tmp_path: Path) -> None:
    path = tmp_path / "m.npz"
    warped.save(path)
    assert version(path) == 3
    again, instances = DistanceModel.load(path), scene(20, seed=1)[0]
    assert again.predict(instances, 1024, 768) == warped.predict(instances, 1024, 768)
    assert again.metadata == warped.metadata
    assert warped.experts[0].warp is not None
    assert warped.metadata["close learns"] == f"distance^{warped.experts[0].warp.power:g}"


@pytest.mark.parametrize("damaged", [[9.0, 20.0], [-1.0, 0.0], [np.nan, 20.0], [1.0]])
def test_a_damaged_warp_is_refused(warped: DistanceModel, tmp_path: Path, damaged: list[float]) -> None:
    path = tmp_path / "m.npz"
    warped.save(path)
    with pytest.raises(DamagedError, match="warp"):
        DistanceModel.load(changed(path, **{"far.warp": np.array(damaged)}))


def test_a_fit_that_begins_with_a_warped_model_keeps_its_powers(warped: DistanceModel) -> None:
    instances, distances_m = scene(80, seed=3)
    again = fit(measure(instances, 1024, 768), distances_m, WARPED, 0, ABOUT, start=warped)
    assert [each.warp for each in again.experts] == [each.warp for each in warped.experts]


@pytest.mark.parametrize("search", [False, True])
def test_what_is_held_out_is_predicted_on_the_experts_scale(search: bool) -> None:
    """Once the hyperparameters of the warped distance were taken for those of the distance."""
    features, distances_m = drawn(-1.0, 200, 0)
    n = len(distances_m)
    ids, classes = np.arange(n).astype(str), np.full(n, "light_pole")
    samples = Samples(features, distances_m, ids, np.arange(n), LENS, n, 0, {}, classes)
    settings = replace(WARPED, close=BOX, experts=1)
    model = train(samples, settings, 0)
    held_out = hold_out(samples, model, settings, 4, 0, by_pole=True, search=search).validation
    near, far = (held_out.figures(part) for part in (held_out.distance_m < 20.0, held_out.distance_m > 40.0))
    assert near is not None and near.coverage > 0.88 and near.mae_m < 0.2
    assert far is not None and far.coverage > 0.88
    (expert,) = model.experts
    parts = {
        name: [Part(np.arange(n), BOX, expert.hyperparameters, warp)]
        for name, warp in (("warped", expert.warp), ("not", None))
    }
    maes_m = held_out_maes(samples, parts, settings, 4, 0, by_pole=True)
    assert (np.abs(maes_m["warped"] - maes_m["not"]) > 1e-3).all()


def test_the_papers_experts_learn_the_distance_itself() -> None:
    assert not PRESETS["paper"].warped and PRESETS["default"].warped
