"""A replay read back from its results, and drawn."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_steps import road_map, synthetic_steps

from scpf.models.road_map import to_geojson
from scpf.replay.cli import run
from scpf.replay.recorded_run import RecordedRun, read_run
from scpf.replay.results import Results
from scpf.replay.run_figures import telling_row
from scpf.replay.settings import Settings
from scpf.replay.step import Step

BLIND = 3


def write(path: Path, steps: list[Step]) -> Path:
    with Results(path, {"settings": Settings().as_dict()}, to_geojson(road_map())) as results:
        for step in steps:
            results.log(step)
    return path


@pytest.fixture(scope="module")
def steps() -> list[Step]:
    return synthetic_steps(8, blind=frozenset({BLIND}))


@pytest.fixture(scope="module")
def recorded(steps: list[Step], tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    return read_run(write(tmp_path_factory.mktemp("run") / "bend.results.mcap", steps))


def test_every_number_comes_back(recorded: RecordedRun, steps: list[Step]) -> None:
    assert recorded.name == "bend"
    assert recorded.settings == Settings()
    for row, step in enumerate(steps):
        assert step.belief is not None and step.baseline is not None and step.errors is not None
        assert (recorded.frames[row], recorded.stamps_ns[row]) == (step.frame.index, step.frame.stamp_ns)
        np.testing.assert_allclose(recorded.estimate_m[row], step.belief.mean[:2])
        np.testing.assert_allclose(recorded.baseline_m[row], step.baseline.mean[:2])
        np.testing.assert_allclose(recorded.means[row], step.belief.mean)
        np.testing.assert_allclose(recorded.deviations_m[row], np.sqrt(np.diag(step.belief.covariance)[:2]))
        expected = (step.errors.position_m, step.errors.longitudinal_m, step.errors.lateral_m)
        np.testing.assert_allclose(recorded.errors_m[row], expected)
        assert recorded.states[row] == step.state
        assert recorded.poles[row] == len(step.observations) + len(step.unmeasured)
        assert [match for _, match in recorded.seen[row]] == list(step.matches)


def test_frames_before_a_belief_are_blank(steps: list[Step], tmp_path: Path) -> None:
    blank = replace(steps[0], belief=None, baseline=None, surface=None, errors=None, baseline_errors=None)
    again = read_run(write(tmp_path / "late.results.mcap", [blank, *steps[1:]]))
    assert again.states[0] == "initialising" and again.means[0] is None and again.surface(0) is None
    assert np.isnan(again.estimate_m[0]).all() and np.isnan(again.errors_m[0]).all()
    assert np.isfinite(again.estimate_m[1:]).all()


def test_the_telling_frame_matched_most(recorded: RecordedRun) -> None:
    row = telling_row(recorded)
    assert row is not None and row != BLIND
    assert len(recorded.matched(row)) == max(len(recorded.matched(k)) for k in range(len(recorded.frames)))


def test_the_surface_is_lowest_where_the_landmark_says(recorded: RecordedRun) -> None:
    """At the surface's minimum, every matched landmark is about as far as it was measured."""
    row = telling_row(recorded)
    assert row is not None and recorded.road_map is not None
    surface = recorded.surface(row)
    assert surface is not None
    north, east = np.unravel_index(surface.violation.argmin(), surface.violation.shape)
    place = surface.corner_m + surface.cell_m * np.array([east, north])
    for seen, match in recorded.matched(row):
        mark = recorded.road_map.landmark(match.landmark_id)
        assert mark is not None
        away = np.hypot(*(place - np.array(mark.position_m[:2])))
        assert away == pytest.approx(seen.distance.mean_m, abs=max(2.0, 3 * seen.distance.variance_m2**0.5))


def test_the_command_leaves_pictures_and_one_page(
    steps: list[Step], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib", reason="figures need the extra `figures`")
    results = write(tmp_path / "bend.results.mcap", steps)
    assert run(["figures", str(results), "-o", str(tmp_path / "out")]) == 0
    paths = [Path(line) for line in capsys.readouterr().out.split()]
    assert [path.suffix for path in paths] == [".png"] * 5 + [".html"]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths[:-1])
    text = paths[-1].read_text()
    assert text.count('src="data:image/png;base64,') == 5
    assert not re.findall(r'(?:src|href)="(?!data:)', text), "the page must load nothing"
    mean = np.mean([step.errors.position_m for step in steps if step.errors])
    assert f"<td>{mean:.2f}</td>" in text
    first = [path.read_bytes() for path in paths]
    assert run(["figures", str(results), "-o", str(tmp_path / "out")]) == 1
    assert "exists" in capsys.readouterr().err
    assert run(["figures", str(results), "-o", str(tmp_path / "out"), "--overwrite"]) == 0
    assert [path.read_bytes() for path in paths] == first
    assert run(["figures", str(results), "--frame", "900"]) == 2
    assert "no frame 900" in capsys.readouterr().err


def test_a_drive_log_is_no_result(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib", reason="figures need the extra `figures`")
    sample = Path(__file__).parent.parent / "sample_logs" / "ring_road.mcap"
    assert run(["figures", str(sample)]) == 1
    assert "holds no results" in capsys.readouterr().err
