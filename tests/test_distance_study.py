"""The study of features: simulated poles that obey the geometry, and a table with every contender."""

from __future__ import annotations

import numpy as np
import pytest

from scpf.replay import distance_study
from scpf.replay.distance_simulation import (
    BASE_DIAMETER_M,
    CAMERA_PITCH_RAD,
    FOCAL_PX,
    TOP_DIAMETER_M,
    Pole,
    see,
    simulate,
)
from scpf.replay.distance_study import MIXTURES, markdown, study
from scpf.replay.distance_training import Samples


@pytest.fixture(scope="module")
def samples() -> Samples:
    return simulate(np.random.default_rng(4), images=110, poles=22)


def test_the_same_seed_gives_the_same_instances(samples: Samples) -> None:
    again, other = (simulate(np.random.default_rng(k), images=110, poles=22) for k in (4, 5))
    np.testing.assert_array_equal(samples.features.values, again.features.values)
    np.testing.assert_array_equal(samples.distances_m, again.distances_m)
    assert len(other) != len(samples) or (other.distances_m != samples.distances_m).any()


def test_instances_obey_the_pinhole(samples: Samples) -> None:
    assert not samples.features.too_small.any()
    assert 3.0 < samples.distances_m.min() < 12.0
    assert 40.0 < samples.distances_m.max() < 52.0
    x1, x2, width, cut = samples.features.columns(("x1", "x2", "mean_width", "cut_top")).T
    tangent = (0.5 * (x1 + x2) - 1024.0) / FOCAL_PX
    depth = FOCAL_PX * 0.5 * (BASE_DIAMETER_M + TOP_DIAMETER_M) / width
    found = depth * np.hypot(1.0, tangent)
    whole = cut == 0.0
    assert np.corrcoef(found[whole], samples.distances_m[whole])[0, 1] > 0.9
    assert np.median(found[whole] / samples.distances_m[whole]) == pytest.approx(1.0, abs=0.1)
    assert samples.distances_m[cut == 1.0].max() < np.median(samples.distances_m)


def test_a_pole_whose_base_is_out_of_sight_is_no_instance() -> None:
    pole, rng = Pole(0.0, 0.0, 0.0, 8.0, 0.0, 1.0), np.random.default_rng(0)
    assert see(pole, (20.0, 4.0), CAMERA_PITCH_RAD, rng) is not None
    assert see(pole, (1.0, 0.0), CAMERA_PITCH_RAD, rng) is None
    assert see(pole, (5.0, 30.0), CAMERA_PITCH_RAD, rng) is None


def test_a_map_that_is_off_is_in_the_labels() -> None:
    exact, off = (
        simulate(np.random.default_rng(4), 60, 12, map_error_m=error) for error in ((0.0, 0.0), (1.0, 2.0))
    )
    assert len(exact) == len(off)
    moved = np.abs(exact.distances_m - off.distances_m)
    assert 0.3 < moved.mean() < 2.0
    assert moved.max() <= 2.0


def test_a_row_for_every_contender(samples: Samples) -> None:
    rows = study(samples, 3, 0)
    found = [(row.expert, row.inputs) for row in rows]
    assert found[:12] == [(expert, name) for expert in ("close", "far", "mixture") for name in MIXTURES]
    assert [expert for expert, _ in found[12:]] == ["single", "single"]
    errors = {each: row.by_pole.mae_m for each, row in zip(found, rows, strict=True)}
    assert errors["mixture", "`default`"] < errors["mixture", "box"]
    assert len(markdown(rows).splitlines()) == 2 + len(rows)


def test_the_command(
    samples: Samples, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(distance_study, "simulate", lambda rng, map_error_m: samples)
    distance_study.main(repetitions=2)
    text = capsys.readouterr().out
    assert f"{len(samples)} instances" in text
    assert "| mixture | `default` |" in text
    assert "by pole, all: mixture" in text
