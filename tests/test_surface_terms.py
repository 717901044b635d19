"""Each constraint by itself: against the constraint functions, and read back from the recording of a replay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic_steps import camera, road_map, synthetic_steps
from test_recording import read, rerun

from scpf.models.bearing_constraint import HeadingConstraint, RoadBearingConstraint
from scpf.models.constraints import (
    Constraint,
    LandmarkConstraint,
    RoadConstraint,
    SpeedConstraint,
    half_normal_log_survival,
)
from scpf.models.matched_landmarks import MatchedLandmarks, Sighting
from scpf.models.particle_filter import PositionFix
from scpf.replay import shapes
from scpf.replay.cli import run
from scpf.replay.recorded_run import RecordedRun, read_run
from scpf.replay.recording import Recording
from scpf.replay.settings import PRESETS, SurfaceSettings
from scpf.replay.step import Surface
from scpf.replay.surface import constraint_surface
from scpf.replay.surface_terms import surface_terms, term_names

Array = NDArray[np.float64]

SAMPLE = Path(__file__).parent.parent / "sample_logs" / "ring_road.mcap"
MEAN = np.array([30.0, 5.0, 12.5, 3.0])
CELLS = 21


def constraints_about(mean: Array) -> list[Constraint]:
    segment = road_map().segment_near(mean[:2])
    assert segment is not None
    far, near = (np.array(road_map().landmarks[k].position_m[:2]) for k in (5, 3))
    return [
        RoadConstraint(segment),
        SpeedConstraint(),
        LandmarkConstraint("far", far, 35.0, 2.0),
        LandmarkConstraint("near", near, 7.0, 0.3),
        RoadBearingConstraint("near", near, 0.4, 0.2, 0.05),
    ]


def test_every_term_is_its_constraints_own_and_together_they_are_the_surface() -> None:
    constraints = constraints_about(MEAN)
    fix = PositionFix(np.array([31.0, 4.0]), 9.0)
    surface = constraint_surface(constraints, MEAN, SurfaceSettings(CELLS, 0.5))
    terms = surface_terms(constraints, fix, MEAN, surface)
    assert list(terms) == ["road", "speed", "range_1", "range_2", "bearing_1", "gps"]
    assert [terms[name].label for name in terms] == ["", "", "near", "far", "near", ""]
    owners = dict(zip(("road", "speed", "range_2", "range_1", "bearing_1"), constraints, strict=True))
    for row, column in ((0, 0), (20, 3), (9, 14)):
        state = MEAN.copy()
        state[:2] = surface.corner_m + surface.cell_m * np.array([column, row])
        for name, one in owners.items():
            expected = one.log_probability(state[None])[0]
            assert terms[name].log_probability[row, column] == pytest.approx(expected, abs=1e-9), name
        off = float(np.sum((state[:2] - [31.0, 4.0]) ** 2))
        assert terms["gps"].log_probability[row, column] == pytest.approx(-0.5 * off / 9.0)
    together = sum(terms[name].log_probability for name in owners)
    np.testing.assert_allclose(together, surface.log_probability, rtol=1e-4, atol=1e-3)


def test_of_a_match_of_its_own_range_and_bearing_stand_alone() -> None:
    mark = np.array([40.0, 9.0])
    seen, further = Sighting(12.0, 0.8, 0.3, 0.05), Sighting(25.0, 1.0, -0.2, 0.05)
    poles = MatchedLandmarks(mark[None], [further, seen], floor=0.001, exponent=0.5)
    signs = MatchedLandmarks(mark[None] + 5.0, [Sighting(18.0, 1.0, 0.1, 0.05)])
    constraints: list[Constraint] = [HeadingConstraint(0.1), poles, signs]
    mean = np.array([30.0, 5.0, 12.5, 3.0, 0.2, 0.0])
    surface = constraint_surface(constraints, mean, SurfaceSettings(CELLS, 0.5))
    terms = surface_terms(constraints, None, mean, surface)
    numbered = [f"{part}_{k}" for k in (1, 2, 3) for part in ("range", "bearing")]
    assert list(terms) == ["heading", *numbered]
    assert [terms[f"bearing_{k}"].label for k in (1, 2, 3)] == ["12.0 m", "18.0 m", "25.0 m"]
    row, column = 4, 17
    to = mark - surface.corner_m - surface.cell_m * np.array([column, row])
    for name, off, deviation in (
        ("range_1", abs(np.hypot(*to) - 12.0), 0.8),
        ("bearing_1", abs(np.arctan2(to[1], to[0]) - 0.2 - 0.3), 0.05),
    ):
        survival = np.exp(half_normal_log_survival(np.array([off]), deviation))[0]
        expected = 0.5 * np.log(0.999 * survival + 0.001)
        assert terms[name].log_probability[row, column] == pytest.approx(expected, abs=2e-3), name


def test_the_views_are_those_that_the_preset_can_fill() -> None:
    ranges, bearings = ([f"{kind}_{k}" for k in (1, 2, 3)] for kind in ("range", "bearing"))
    assert term_names(PRESETS["paper"]) == ["road", "speed", "gps", *ranges]
    assert term_names(PRESETS["default"]) == ["road", "speed", "heading", "gps", *ranges, *bearings]
    assert term_names(PRESETS["ekf"]) == ["gps", *ranges, *bearings]
    assert term_names(PRESETS["pf"]) == ["gps"]


def test_a_frame_without_a_landmark_shows_none_of_the_last(tmp_path: Path) -> None:
    steps = synthetic_steps(3, blind=frozenset({1}), cells=CELLS)
    path = tmp_path / "terms.rrd"
    with Recording(
        path,
        name="terms",
        camera=camera(),
        road_map=road_map(),
        about_markdown="",
        settings={},
        terms=["road", "range_1"],
    ) as recording:
        for step in steps:
            belief = step.belief
            assert belief is not None and step.surface is not None
            some = constraints_about(belief.mean)[: 1 if step.frame.index == 1 else 4]
            terms = surface_terms(some, None, belief.mean, step.surface)
            recording.log(replace(step, surface=replace(step.surface, terms=terms)))
    assert rerun("verify", path).returncode == 0
    grids = read(path, "/world/surface/terms/range_1", "GridMap:data")
    labels = read(path, "/world/surface/terms/range_1/label", "Points3D:labels")
    assert [len(grids[k]) for k in range(3)] == [1, 0, 1]
    assert [labels[k] for k in range(3)] == [["near"], [], ["near"]]
    assert all(len(grid) == 1 for grid in read(path, "/world/surface/terms/road", "GridMap:data").values())


@pytest.fixture(scope="module")
def replayed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The start of the sample drive, each constraint by itself recorded."""
    folder = tmp_path_factory.mktemp("terms")
    options = ["--segmenter", "recorded", "--duration", "0.8", "--images", "none", "-q", "--surface-terms"]
    assert run(["replay", str(SAMPLE), "-o", str(folder), *options]) == 0
    return folder / "ring_road.rrd"


def cells(rrd: Path, name: str, frame: int) -> tuple[Array, Array]:
    """Values (K,) of a term's grid, read back, and the cells' centres (K, 2) in map."""
    size = SurfaceSettings()
    data = read(rrd, f"/world/surface/terms/{name}", "GridMap:data")[frame][0]
    corner = read(rrd, f"/world/surface/terms/{name}", "GridMap:translation")[frame][0]
    values = np.array(data, dtype=np.uint8).view(np.float16).reshape(size.cells, size.cells)[::-1]
    steps = (np.arange(size.cells) + 0.5) * size.cell_m
    east, north = np.meshgrid(corner[0] + steps, corner[1] + steps)
    return values.astype(float).ravel(), np.column_stack([east.ravel(), north.ravel()])


def test_a_replays_grids_are_the_constraints_of_its_results(replayed: Path) -> None:
    results: RecordedRun = read_run(replayed.with_name("ring_road.results.mcap"))
    assert results.road_map is not None
    floor = shapes.LOG_PROBABILITY_FLOOR
    for row in (0, 6):
        frame = int(results.frames[row])
        seen = min(results.matched(row), key=lambda pair: pair[0].distance.mean_m)
        mark = results.road_map.landmark(seen[1].landmark_id)
        assert mark is not None
        assert read(replayed, "/world/surface/terms/range_1/label", "Points3D:labels")[frame] == [mark.id]
        values, at = cells(replayed, "range_1", frame)
        off = np.abs(np.hypot(*(at - mark.position_m[:2]).T) - seen[0].distance.mean_m)
        deviation = np.sqrt(seen[0].distance.variance_m2 + mark.variance_m2)
        expected = np.maximum(half_normal_log_survival(off, float(deviation)), floor)
        np.testing.assert_allclose(values, expected, rtol=2e-3, atol=2e-3)
        assert values.max() > -0.1 and values.min() == floor
        values, at = cells(replayed, "gps", frame)
        squared = ((at - results.gps_m[row]) ** 2).sum(axis=1)
        np.testing.assert_allclose(values, np.maximum(-0.5 * squared / 9.0, floor), rtol=2e-3, atol=2e-2)


def test_what_is_the_same_everywhere_is_not_coloured_as_the_worst(replayed: Path) -> None:
    values, _ = cells(replayed, "speed", 3)
    assert len(set(values)) == 1 and values[0] < 0.0


def test_nobody_asked_nothing_is_recorded(tmp_path: Path) -> None:
    options = ["--segmenter", "recorded", "--duration", "0.2", "--images", "none", "-q"]
    assert run(["replay", str(SAMPLE), "-o", str(tmp_path), *options]) == 0
    assert read(tmp_path / "ring_road.rrd", "/world/surface/terms/**", "GridMap:data") == {}
    assert read(tmp_path / "ring_road.rrd", "/world/surface/sum", "GridMap:data") != {}
    assert not Surface(np.zeros(2), 0.5, np.zeros((1, 1)), np.zeros((1, 1))).terms
