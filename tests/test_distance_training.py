"""Training: samples from a log, held-out figures, and cross-fitting that never sees a pole."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from distance_logs import FEET, QUICK, START_NS, write_log

from scpf.models import distance_fit
from scpf.models.distance import DistanceModel
from scpf.models.errors import InputError, MissingError
from scpf.replay.distance_evaluation import evaluate, hold_out, residuals
from scpf.replay.distance_training import Samples, cross_fit, gather, train


@pytest.fixture(scope="module")
def log_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_log(tmp_path_factory.mktemp("log") / "drive.mcap")


@pytest.fixture(scope="module")
def samples(log_path: Path) -> Samples:
    return gather([log_path], "recorded")


@pytest.fixture(scope="module")
def model(samples: Samples) -> DistanceModel:
    return train(samples, QUICK, 0, {"logs": "drive.mcap"})


def test_samples_carry_the_right_poles(samples: Samples) -> None:
    assert len(samples) > 150
    assert set(samples.landmark_ids) == {f"P{k}" for k in range(len(FEET))}
    assert samples.frames == 150
    assert samples.unreadable == 0
    for k in range(0, len(samples), 7):
        frame = (samples.stamps_ns[k] - START_NS) // 250_000_000
        foot = FEET[int(samples.landmark_ids[k][1:])]
        expected = np.hypot(foot[0] - 2.0 * frame, foot[1] - 0.3 * np.sin(frame))
        assert samples.distances_m[k] == pytest.approx(expected, abs=0.01)
    assert samples.distances_m.max() <= 60.0


def test_every_and_distance_limit(log_path: Path) -> None:
    seen: list[tuple[int, int]] = []
    few = gather([log_path, log_path], "recorded", 0.9, 5, 30.0, lambda frames, n: seen.append((frames, n)))
    assert few.frames == 60
    assert few.distances_m.max() <= 30.0
    assert seen[-1] == (60, len(few))
    assert sum(few.dropped.values()) > 0


def test_figures(samples: Samples, model: DistanceModel) -> None:
    report = evaluate(samples, model, QUICK, 0, repetitions=4, searched_repetitions=1)
    for key in ("random", "by_pole", "by_pole_searched"):
        figures = report[key]["validation"]["all"]
        assert figures["mae_m"] < 1.5
        assert figures["mae_m"] <= figures["rmse_m"]
        assert abs(figures["bias_m"]) <= figures["mae_m"]
        assert figures["function_coverage"] <= figures["coverage"]
    assert report["random"]["train"]["all"]["mae_m"] < report["by_pole"]["validation"]["all"]["mae_m"]
    assert (
        sum(row["n"] for row in report["by_pole_bands"].values() if row)
        == (report["by_pole"]["validation"]["all"]["n"])
    )
    json.dumps(report, allow_nan=False)


def test_a_pole_is_on_one_side_of_a_hold_out_by_pole(samples: Samples, model: DistanceModel) -> None:
    one = hold_out(samples, model, QUICK, 1, 3, by_pole=True)
    held = set(samples.landmark_ids[np.isin(samples.distances_m, one.validation.distance_m)])
    trained = set(samples.landmark_ids[np.isin(samples.distances_m, one.train.distance_m)])
    assert held
    assert not held & trained


def test_cross_fitting_never_uses_the_same_pole(
    samples: Samples, model: DistanceModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    from scpf.replay import distance_training

    trained_on: list[set[str]] = []

    def spy(features, distances_m, *rest, **more):  # type: ignore[no-untyped-def]
        used = np.isin(samples.distances_m, distances_m)
        trained_on.append(set(samples.landmark_ids[used]))
        return distance_fit.fit(features, distances_m, *rest, **more)

    monkeypatch.setattr(distance_training, "fit", spy)
    fitted = cross_fit(samples, model, QUICK, 0, folds=4)
    assert len(trained_on) == 4
    poles = set(samples.landmark_ids)
    assert set.union(*(poles - used for used in trained_on)) == poles
    assert all(a == b or not (poles - a) & (poles - b) for a in trained_on for b in trained_on)
    np.testing.assert_array_equal(fitted.stamps_ns, samples.stamps_ns)
    figures = residuals(samples, fitted.held_out).figures()
    assert figures is not None
    assert figures.n == len(samples)
    assert figures.mae_m < 3.0


def test_cross_fitting_needs_poles_to_spare(samples: Samples, model: DistanceModel) -> None:
    one = samples.rows(samples.landmark_ids == samples.landmark_ids[0])
    with pytest.raises(InputError, match="left to train on"):
        cross_fit(one, model, QUICK, 0)


def test_a_log_without_calibration(tmp_path: Path) -> None:
    with pytest.raises(MissingError, match="no calibration"):
        gather([write_log(tmp_path / "bare.mcap", frames=3, parts=False)], "recorded")


def test_samples_of_several_classes_are_no_model(samples: Samples) -> None:
    names = np.where(np.arange(len(samples)) % 2 == 0, "sign", "light_pole")
    mixed = replace(samples, landmark_classes=names)
    with pytest.raises(InputError, match="2 landmark classes"):
        train(mixed, QUICK, 0)
    parts = mixed.by_class()
    assert {name: len(part) for name, part in parts.items()} == {
        "light_pole": len(samples) // 2,
        "sign": (len(samples) + 1) // 2,
    }
