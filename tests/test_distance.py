"""The distance model: the right mathematics, and the right expert."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from distance_scenes import ABOUT, LENS, QUICK, scene, version
from hypothesis import given
from hypothesis import strategies as st
from pole_scenes import camera, pose, see

from scpf.models.distance import DistanceModel, TrainedOn
from scpf.models.distance_fit import fit
from scpf.models.distance_gate import expert_names
from scpf.models.distance_settings import PRESETS
from scpf.models.errors import InputError
from scpf.models.features import Features, measure
from scpf.models.gaussian_process import Hyperparameters, condition, optimise
from scpf.models.instances import Instance
from scpf.replay.distance_simulation import simulate


@pytest.fixture(scope="module")
def trained() -> tuple[DistanceModel, list[Instance], np.ndarray]:
    instances, distances = scene()
    model = fit(measure(instances, 1024, 768), distances, PRESETS["paper"], 0, ABOUT)
    return model, instances, distances


@given(
    st.integers(0, 2**32 - 1),
    st.floats(0.5, 200.0),
    st.floats(0.01, 5.0),
    st.lists(st.floats(0.2, 20.0), min_size=3, max_size=3),
)
def test_prediction_is_the_dense_solution(
    seed: int, signal_m2: float, noise_m2: float, length_scales: list[float]
) -> None:
    rng = np.random.default_rng(seed)
    X, y, Z = rng.normal(size=(60, 3)), rng.normal(20.0, 5.0, 60), rng.normal(size=(9, 3))
    found = Hyperparameters(signal_m2, np.array(length_scales), noise_m2)
    mean, variance, function = condition(X, y, found).predict(Z)

    def kernel(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        a, b = (each / (X.std(0) * found.length_scales) for each in (a, b))
        r = np.sqrt(3.0) * np.linalg.norm(a[:, None] - b[None], axis=2)
        return found.signal_m2 * (1.0 + r) * np.exp(-r)

    near = {"rtol": 1e-7, "atol": 1e-7 * signal_m2}
    K = kernel(X, X) + found.noise_m2 * np.eye(60)
    cross = kernel(X, Z)
    np.testing.assert_allclose(mean, y.mean() + cross.T @ np.linalg.solve(K, y - y.mean()), **near)
    expected = found.signal_m2 - np.diag(cross.T @ np.linalg.solve(K, cross))
    np.testing.assert_allclose(function, expected, **near)
    np.testing.assert_allclose(variance, expected + found.noise_m2, **near)


def test_prediction_is_scikit_learns() -> None:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

    rng = np.random.default_rng(2)
    X, Z = rng.normal(size=(50, 2)), rng.normal(size=(7, 2))
    y = 10.0 + X @ [3.0, -1.0] + 0.1 * rng.normal(size=50)
    found = optimise(X, y)
    kernel = ConstantKernel(found.signal_m2) * Matern(found.length_scales, nu=1.5) + WhiteKernel(
        found.noise_m2
    )
    theirs = GaussianProcessRegressor(kernel, optimizer=None, alpha=0.0)
    theirs.fit((X - X.mean(0)) / X.std(0), y - y.mean())
    mean, deviation = theirs.predict((Z - X.mean(0)) / X.std(0), return_std=True)
    ours, variance, _ = condition(X, y, found).predict(Z)
    np.testing.assert_allclose(ours, mean + y.mean(), atol=1e-6)
    np.testing.assert_allclose(variance, deviation**2, atol=1e-6)


def test_distances_of_new_poles(trained: tuple[DistanceModel, list[Instance], np.ndarray]) -> None:
    model, _, _ = trained
    instances, distances = scene(60, seed=9)
    found = [each for each in model.predict(instances, 1024, 768) if each is not None]
    assert len(found) == 60
    errors = np.array([each.mean_m for each in found]) - distances
    deviations = np.sqrt([each.variance_m2 for each in found])
    assert np.abs(errors).mean() < 0.6
    assert (np.abs(errors) < 1.96 * deviations).mean() > 0.8
    assert {each.expert for each in found} == {"close", "far"}
    assert all(each.variance_m2 > each.function_variance_m2 > 0 for each in found)
    assert sum(each.in_range for each in found) > 50


def test_a_thicker_pole_is_closer(trained: tuple[DistanceModel, list[Instance], np.ndarray]) -> None:
    model, _, _ = trained
    seen = [see(LENS, pose(), (x, 4.0)) for x in (8.0, 11.0, 15.0, 21.0, 30.0, 42.0)]
    found = model.predict([each for each in seen if each is not None], 1024, 768)
    means = [each.mean_m for each in found if each is not None]
    assert len(means) == 6
    assert (np.diff(means) > 0).all()


def test_a_batch_is_its_members(trained: tuple[DistanceModel, list[Instance], np.ndarray]) -> None:
    model, instances, _ = trained
    together = model.predict(instances[:20], 1024, 768)
    for instance, one in zip(instances[:20], together, strict=True):
        (alone,) = model.predict([instance], 1024, 768)
        assert alone is not None
        assert one is not None
        assert alone.expert == one.expert
        assert alone.mean_m == pytest.approx(one.mean_m, abs=1e-9)
        assert alone.variance_m2 == pytest.approx(one.variance_m2, abs=1e-9)
    assert model.predict([], 1024, 768) == []


def test_too_small_and_out_of_range(trained: tuple[DistanceModel, list[Instance], np.ndarray]) -> None:
    model, _, _ = trained
    tiny = Instance((10.0, 10.0, 12.0, 15.0), np.ones((5, 2), dtype=bool), (10, 10), 1.0)
    huge = Instance((300.0, 0.0, 700.0, 768.0), np.ones((768, 400), dtype=bool), (300, 0), 1.0)
    first, second = model.predict([tiny, huge], 1024, 768)
    assert first is None
    assert second is not None
    assert not second.in_range


def test_the_gate_is_monotone_in_thickness(trained: tuple[DistanceModel, list[Instance], np.ndarray]) -> None:
    gate = trained[0].gate
    assert gate is not None
    names = ("x1", "x2", "y1", "y2", "thickness")
    for thickness, expert in ((0.5, 1), (200.0, 0)):
        for width in (1.0, 50.0, 500.0):
            values = np.array([[100.0, 100.0 + width, 50.0, 150.0, thickness]])
            flags = np.zeros(1, dtype=bool)
            assert gate.experts(Features(names, values, flags, flags)).tolist() == [expert]


def test_other_cameras(trained: tuple[DistanceModel, list[Instance], np.ndarray]) -> None:
    model, instances, _ = trained
    with pytest.raises(InputError, match="1024×768"):
        model.predict(instances[:1], 1920, 768)
    model.check_camera(LENS)
    model.check_camera(camera(512, 384, 365.0))  # the same lens at half the size
    with pytest.raises(InputError, match="focal length"):
        model.check_camera(camera(focal_px=900.0))
    (full,) = model.predict(instances[:1], 1024, 768)
    double = np.kron(instances[0].mask, np.ones((2, 2), dtype=bool))
    box = tuple(2.0 * side for side in instances[0].box_px)
    offset = (2 * instances[0].offset_px[0], 2 * instances[0].offset_px[1])
    (scaled,) = model.predict([Instance(box, double, offset, 1.0)], 2048, 1536)
    assert full is not None
    assert scaled is not None
    assert scaled.mean_m == pytest.approx(full.mean_m, abs=0.1)


def test_few_samples() -> None:
    instances, distances = scene(30)
    features = measure(instances, 1024, 768)
    few = np.arange(7)
    with pytest.raises(InputError, match="at least 8"):
        fit(features.rows(few), distances[few], QUICK, 0, ABOUT)
    close_ones = np.argsort(distances)[:4].tolist() + np.argsort(distances)[-12:].tolist()
    model = fit(features.rows(np.array(close_ones)), distances[close_ones], QUICK, 0, ABOUT)
    assert model.names == ("single",)
    assert "too few samples for 2 experts" in model.metadata["gate"]
    with pytest.raises(InputError, match="unknown"):
        fit(features, distances, replace(QUICK, far=("x1", "mood")), 0, ABOUT)


@pytest.mark.parametrize("experts", [1, 3])
def test_other_numbers_of_experts(experts: int, tmp_path: Path) -> None:
    instances, distances = scene(120)
    wanted = replace(QUICK, experts=experts)
    model = fit(measure(instances, 1024, 768), distances, wanted, 0, ABOUT)
    assert model.names == expert_names(experts)
    assert model.inputs == wanted.inputs(experts)
    chosen = model.choose(measure(instances, 1024, 768))
    typical = [np.median(distances[chosen == k]) for k in range(experts)]
    assert (np.diff(typical) > 0).all()
    found = model.predict(instances, 1024, 768)
    assert np.mean([abs(d.mean_m - m) for d, m in zip(found, distances, strict=True) if d]) < 0.6
    model.save(tmp_path / "m.npz")
    assert DistanceModel.load(tmp_path / "m.npz").predict(instances, 1024, 768) == found
    assert version(tmp_path / "m.npz") == (2 if experts > 2 else 1)


def test_the_default_preset_is_better_than_the_papers() -> None:
    samples = simulate(np.random.default_rng(4), images=150, poles=30)
    new = simulate(np.random.default_rng(5), images=100, poles=20)
    errors = {}
    for name in ("paper", "default"):
        quick = replace(PRESETS[name], restarts=0)
        about = TrainedOn(
            "light_pole", samples.camera.width_px, samples.camera.height_px, samples.camera.matrix
        )
        model = fit(samples.features, samples.distances_m, quick, 0, about)
        errors[name] = np.abs(model.predict_features(new.features).mean_m - new.distances_m).mean()
    assert errors["default"] < 0.85 * errors["paper"]
    assert errors["paper"] < 1.0


def test_a_single_expert_needs_no_thickness() -> None:
    box = ("x1", "x2", "y1", "y2")
    instances, distances = scene(60)
    alone = replace(QUICK, close=box, experts=1)
    assert alone.features == box
    model = fit(measure(instances, 1024, 768, box), distances, alone, 0, ABOUT)
    assert model.features == box
    assert all(each is not None for each in model.predict(instances, 1024, 768))


def test_the_same_seed_gives_the_same_model() -> None:
    instances, distances = scene(60)
    features = measure(instances, 1024, 768)
    thin = replace(QUICK, max_samples=20, max_search_samples=15)
    first, second = (fit(features, distances, thin, 3, ABOUT) for _ in range(2))
    assert all(len(expert.weights) <= 20 for expert in first.experts)
    assert first.predict(instances, 1024, 768) == second.predict(instances, 1024, 768)
