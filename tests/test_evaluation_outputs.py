"""Files of an evaluation: trajectories that agree with the figures, pictures, and nothing replaced unasked."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scpf.ingest.trajectories import read_trajectory
from scpf.models.errors import MissingError, UsageError
from scpf.replay.cli import run
from scpf.replay.evaluation import evaluate
from scpf.replay.evaluation_conditions import Conditions
from scpf.replay.evaluation_figures import block_means, figure_paths
from scpf.replay.evaluation_outputs import Outputs
from scpf.replay.evaluation_plan import Plan
from scpf.replay.evaluation_scenarios import make_scenarios
from scpf.replay.evaluation_surface import surface_at

PLAN = Plan(("ekf", "default"), ("S0", "S2"), (3.0,), runs=1, drives=2, frames=150)


def test_trajectories_give_the_figures_back(tmp_path: Path) -> None:
    scenarios, outputs = make_scenarios(PLAN), Outputs(tum=tmp_path / "runs")
    results = evaluate(PLAN, scenarios=scenarios)
    outputs.check(PLAN, overwrite=False)
    outputs.write(PLAN, results, scenarios)
    assert sorted((tmp_path / "runs").iterdir()) == sorted(outputs.paths(PLAN))
    for one in results:
        truth = read_trajectory(tmp_path / "runs" / f"{one.case}_{one.drive}_truth.tum")
        estimate = read_trajectory(tmp_path / "runs" / f"{one.case}_{one.drive}_{one.preset}_3m.tum")
        np.testing.assert_array_equal(truth.stamps_ns, estimate.stamps_ns)
        errors = np.linalg.norm(truth.positions_m - estimate.positions_m, axis=1)
        assert np.sqrt((errors**2).mean()) == pytest.approx(one.metrics.rmse_m, abs=1e-6)
        drive = scenarios[one.case, one.drive].drive
        yaw = np.arctan2(truth.poses()[:, 1, 0], truth.poses()[:, 0, 0])
        np.testing.assert_allclose(np.cos(yaw - drive.headings_rad), 1.0, atol=1e-9)
        ahead = estimate.poses()[40:, :2, 0] * np.column_stack([np.cos(yaw), np.sin(yaw)])[40:]
        assert np.median(ahead.sum(axis=1)) > 0.9
    assert truth.stamps_ns[13] == pytest.approx(1e9, abs=2)


def test_recorded_trajectories_are_in_the_map_and_on_the_log_s_clock(tmp_path: Path) -> None:
    (key, scenario), *_ = make_scenarios(PLAN).items()
    moved = replace(scenario, start_ns=1_700_000_000_123_456_789, middle_m=(5000.0, -300.0))
    plan = replace(PLAN, cases=(key[0],), drives=1)
    results = evaluate(plan, scenarios={key: moved})
    Outputs(tum=tmp_path).write(plan, results, {key: moved})
    truth = read_trajectory(tmp_path / "S0_0_truth.tum")
    assert truth.stamps_ns[0] == moved.start_ns
    np.testing.assert_allclose(
        truth.positions_m[:, :2] - [5000.0, -300.0], scenario.drive.positions_m, atol=1e-6
    )


def test_figures_are_pictures_and_show_what_was_computed(tmp_path: Path) -> None:
    plan = replace(PLAN, cases=("S2",), sigmas_m=(3.0, 10.0), runs=2, drives=1)
    scenarios = make_scenarios(plan)
    results = evaluate(plan, scenarios=scenarios)
    for folder in ("a", "other"):
        Outputs(figures=tmp_path / folder).check(plan, overwrite=False)
    Outputs(figures=tmp_path / "a").write(plan, results, scenarios)
    paths = figure_paths(tmp_path / "a", plan)
    assert sorted((tmp_path / "a").iterdir()) == sorted(paths) and len(paths) == 5
    for path in paths:
        with Image.open(path) as picture:
            assert picture.format == "PNG" and min(picture.size) > 400
            assert len(picture.convert("RGB").getcolors(1 << 24) or ()) > 20
    outage = replace(plan, conditions=Conditions(((2.0, 6.0),)))
    worse = [
        replace(one, metrics=replace(one.metrics, mean_m=9.0, run_high_m=9.5), trace=one.trace)
        for one in results
    ]
    Outputs(figures=tmp_path / "other").write(outage, worse, scenarios)
    changed = set()
    for path in paths:
        if (tmp_path / "other" / path.name).read_bytes() != path.read_bytes():
            changed.add(path.stem)
    assert changed == {"error_against_gps_S2", "error_over_time_S2"}


def test_long_drives_are_drawn_as_means_of_blocks() -> None:
    np.testing.assert_array_equal(block_means(np.arange(500.0)), np.arange(500.0))
    means = block_means(np.arange(4003.0))
    assert len(means) == 444
    np.testing.assert_array_equal(means[:2], [4.0, 13.0])


def test_the_surface_is_lowest_near_the_truth() -> None:
    (scenario,) = make_scenarios(replace(PLAN, cases=("P",), drives=1, frames=600)).values()
    surface = surface_at(scenario)
    assert len(surface.landmarks_m) == max(map(len, scenario.detections)) >= 2
    for values, best in ((surface.violation, np.argmin), (surface.log_probability, np.argmax)):
        row, column = np.unravel_index(best(values), values.shape)
        assert np.hypot(surface.offsets_m[row], surface.offsets_m[column]) < 8.0
    assert surface.violation.min() >= 0.0 and surface.log_probability.max() <= 0.0
    blind = replace(scenario, detections=tuple(() for _ in scenario.detections))
    assert len(surface_at(blind).landmarks_m) == 0


def test_nothing_is_replaced_unasked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for outputs in (
        Outputs(tum=tmp_path / "t"),
        Outputs(figures=tmp_path / "f"),
        Outputs(json=tmp_path / "j.json"),
    ):
        outputs.check(PLAN, overwrite=False)
        there = outputs.paths(PLAN)[-1]
        assert there.parent.is_dir()
        there.write_text("mine")
        with pytest.raises(UsageError, match=there.name):
            outputs.check(PLAN, overwrite=False)
        outputs.check(PLAN, overwrite=True)
    tokens = ["evaluate", "--presets", "ekf", "--cases", "S0", "--sigma", "3", "--runs", "1", "--drives", "1"]
    tokens += [
        "--frames",
        "60",
        "--tum",
        str(tmp_path / "new" / "runs"),
        "--figures",
        str(tmp_path / "pictures"),
    ]
    assert run(tokens) == 0
    assert len(list((tmp_path / "new" / "runs").iterdir())) == 2
    assert len(list((tmp_path / "pictures").glob("*.png"))) == 5
    capsys.readouterr()
    assert run(tokens) == 2
    assert "exists" in capsys.readouterr().err
    assert run([*tokens[:-4], "--csv", str(tmp_path / "deep" / "er" / "rows.csv")]) == 0
    assert (tmp_path / "deep" / "er" / "rows.csv").read_text().startswith("preset,")
    (tmp_path / "file").write_text("")
    assert run([*tokens[:-4], "--tum", str(tmp_path / "file" / "runs")]) == 1
    assert "cannot be made" in capsys.readouterr().err


def test_figures_without_matplotlib_say_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingError, match="matplotlib") as caught:
        Outputs(figures=tmp_path).check(PLAN, overwrite=False)
    assert "scpf[figures]" in caught.value.hint
