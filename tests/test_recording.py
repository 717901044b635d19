"""The recording: read back through rerun's own reader."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from rerun.chunk import RrdReader
from synthetic_steps import camera, road_map, synthetic_steps

from scpf.models.instances import instance_from_mask
from scpf.replay import overlays, shapes
from scpf.replay.recording import Recording
from scpf.replay.step import Step
from scpf.replay.viewer import viewer_executable

CELLS = 21
BLIND = 3


def write(
    path: Path, steps: list[Step], settings: Mapping[str, str] | None = None, images: bool = True
) -> Path:
    """A recording of ``steps``."""
    with Recording(
        path,
        name="bend",
        camera=camera(),
        road_map=road_map(),
        about_markdown="# bend",
        settings=settings or {"seed": "0"},
        images=images,
    ) as recording:
        for step in steps:
            recording.log(step)
    return path


def rerun(*arguments: str | Path) -> subprocess.CompletedProcess[bytes]:
    """One of the viewer's command line tools."""
    return subprocess.run([viewer_executable(), "rrd", *arguments], capture_output=True, check=False)


def read(path: Path, entity: str, component: str) -> dict[int, list[Any]]:
    """Values by frame of one component; an empty list where it was cleared."""
    found = {}
    for chunk in RrdReader(path).stream().filter(content=entity, components=component):
        if chunk.is_static:
            continue
        batch = chunk.to_record_batch()
        frames = batch.column("frame").cast(pa.int64()).to_pylist()
        found |= {
            frame: batch.column(component)[row].as_py() or []
            for row, frame in enumerate(frames)
            if batch.column(component)[row].is_valid
        }
    return found


@pytest.fixture(scope="module")
def steps() -> list[Step]:
    """Six steps, the fourth without a detection."""
    return synthetic_steps(6, blind=frozenset({BLIND}), cells=CELLS)


@pytest.fixture(scope="module")
def rrd(steps: list[Step], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Their recording."""
    return write(tmp_path_factory.mktemp("recording") / "bend.rrd", steps)


def test_the_file_is_whole_and_has_its_final_name(rrd: Path) -> None:
    assert rerun("verify", rrd).returncode == 0
    assert [path.name for path in rrd.parent.iterdir()] == ["bend.rrd"]


def test_particles_and_weights(rrd: Path, steps: list[Step]) -> None:
    positions = read(rrd, "/world/particles", "Points3D:positions")
    weights = read(rrd, "/world/particles", "weight")
    for step in steps:
        k = step.frame.index
        np.testing.assert_allclose(np.array(positions[k])[:, :2], step.belief.states[:, :2], atol=1e-4)
        np.testing.assert_allclose(weights[k], step.belief.weights, rtol=1e-3, atol=1e-7)


def test_errors_of_both_filters(rrd: Path, steps: list[Step]) -> None:
    scpf, pf = (read(rrd, f"/error/position/{name}", "Scalars:scalars") for name in ("scpf", "pf"))
    lateral = read(rrd, "/error/heading_frame/lateral", "Scalars:scalars")
    for step in steps:
        assert step.errors is not None and step.baseline_errors is not None
        k = step.frame.index
        expected = step.errors.position_m, step.baseline_errors.position_m, step.errors.lateral_m
        assert (scpf[k][0], pf[k][0], lateral[k][0]) == pytest.approx(expected)


def test_surface_rows_run_from_north_to_south(rrd: Path, steps: list[Step]) -> None:
    grids = read(rrd, "/world/surface/sum", "GridMap:data")
    corners = read(rrd, "/world/surface/sum", "GridMap:translation")
    for step in steps:
        surface, k = step.surface, step.frame.index
        shown = np.array(grids[k][0], dtype=np.uint8).view(np.float16).reshape(CELLS, CELLS)[::-1]
        above = surface.violation - surface.violation.min()
        for row, column in ((0, 0), (CELLS - 1, 2), (7, 11)):
            assert shown[row, column] == pytest.approx(
                min(above[row, column], shapes.VIOLATION_SPAN_M), abs=0.02
            )
        np.testing.assert_allclose(corners[k][0][:2], surface.corner_m - surface.cell_m / 2, atol=1e-4)


def test_log_probability_is_relative_to_its_peak(rrd: Path, steps: list[Step]) -> None:
    grids = read(rrd, "/world/surface/log_probability", "GridMap:data")
    peaks = read(rrd, "/surface/peak", "Scalars:scalars")
    for step in steps:
        k = step.frame.index
        shown = np.array(grids[k][0], dtype=np.uint8).view(np.float16)
        assert shown.max() == 0.0 and shown.min() >= shapes.LOG_PROBABILITY_FLOOR
        assert peaks[k][0] == pytest.approx(step.surface.log_probability.max())


def test_a_frame_without_a_detection_shows_none_of_the_last(rrd: Path) -> None:
    masks = read(rrd, "/camera/masks", "EncodedImage:blob")
    assert len(masks[BLIND]) == 0 and len(masks[BLIND - 1]) == 1 and len(masks[BLIND + 1]) == 1
    for entity, component in (
        ("/camera/outlines", "LineStrips2D:strips"),
        ("/camera/labels", "Points2D:positions"),
        ("/world/rings", "LineStrips3D:strips"),
    ):
        values = read(rrd, entity, component)
        assert len(values[BLIND]) == 0 and len(values[BLIND - 1]) > 0, entity


def test_distances_end_where_the_landmark_is_lost(rrd: Path, steps: list[Step]) -> None:
    step = steps[BLIND - 1]
    at = next(k for k, match in enumerate(step.matches) if match.landmark_id)
    entity = f"/gpr/{step.matches[at].landmark_id}"
    values, variances = (read(rrd, entity, f"Measurements:{name}") for name in ("values", "variances"))
    assert values[BLIND - 1][0] == pytest.approx(step.observations[at].distance.mean_m)
    assert variances[BLIND - 1][0] == pytest.approx(step.observations[at].distance.variance_m2)
    assert read(rrd, f"{entity}/true", "Scalars:scalars")[BLIND - 1][0] == pytest.approx(
        step.true_distances_m[at]
    )
    assert BLIND in read(rrd, entity, "Clear:is_recursive")


def test_image_bytes_are_those_of_the_log(rrd: Path, steps: list[Step]) -> None:
    blobs = read(rrd, "/camera/image", "EncodedImage:blob")
    assert bytes(blobs[0][0]) == bytes(steps[0].frame.encoded)


def test_without_images_everything_else_stays(rrd: Path, steps: list[Step], tmp_path: Path) -> None:
    bare = write(tmp_path / "bare.rrd", steps, images=False)
    assert rerun("verify", bare).returncode == 0
    assert read(bare, "/camera/image", "EncodedImage:blob") == {}
    for entity, component in (
        ("/camera/masks", "EncodedImage:blob"),
        ("/camera/outlines", "LineStrips2D:strips"),
        ("/error/position/scpf", "Scalars:scalars"),
    ):
        assert read(bare, entity, component) == read(rrd, entity, component) != {}


def test_state_changes_and_notes(rrd: Path) -> None:
    states = read(rrd, "/filter/state", "StateChange:state")
    assert states == {0: ["tracking"], BLIND: ["unconstrained"], BLIND + 1: ["tracking"]}
    assert read(rrd, "/log", "TextLog:level")[BLIND] == ["WARN"]


def test_the_same_run_twice_is_the_same_recording(rrd: Path, tmp_path: Path) -> None:
    again = write(tmp_path / "again.rrd", synthetic_steps(6, blind=frozenset({BLIND}), cells=CELLS))
    other = write(tmp_path / "other.rrd", synthetic_steps(6, cells=CELLS, seed=1))
    assert rerun("compare", "--unordered", rrd, again).returncode == 0
    assert rerun("compare", "--unordered", rrd, other).returncode != 0


def test_an_interrupted_run_leaves_the_partial_file(steps: list[Step], tmp_path: Path) -> None:
    path = tmp_path / "cut.rrd"
    with (
        pytest.raises(KeyboardInterrupt),
        Recording(path, name="cut", camera=None, road_map=None, about_markdown="", settings={}) as recording,
    ):
        recording.log(steps[0])
        raise KeyboardInterrupt
    assert not path.exists()
    assert 0 in read(tmp_path / "cut.partial.rrd", "/filter/ess", "Scalars:scalars")


def test_a_log_with_hardly_anything(steps: list[Step], tmp_path: Path) -> None:
    """No camera, map, reference, GPS or image; an instance without a distance; surfaces without a finite value."""
    step = steps[0]
    void = np.full((3, 4), -np.inf)
    bare = replace(
        step,
        frame=replace(step.frame, encoded=b"", T_map_body=None, gps_m=None),
        observations=(), matches=(), true_distances_m=(), true_landmark_ids=(),
        unmeasured=(instance_from_mask(np.eye(5, dtype=bool)),),
        errors=None, baseline_errors=None,
        surface=replace(step.surface, violation=-void, log_probability=void),
    )  # fmt: skip
    path = tmp_path / "bare.rrd"
    with Recording(
        path, name="bare", camera=None, road_map=None, about_markdown="", settings={}
    ) as recording:
        recording.log(bare)
    assert rerun("verify", path).returncode == 0
    assert read(path, "/camera/labels_on_hover", "Points2D:labels")[0] == ["no distance"]


def test_labels_say_what_was_matched_and_what_is_true(steps: list[Step]) -> None:
    step = next(step for step in steps if any(match.landmark_id for match in step.matches))
    at = next(k for k, match in enumerate(step.matches) if match.landmark_id)
    wrong = replace(step, true_landmark_ids=("P99",) * len(step.matches))
    distance = step.observations[at].distance
    expected = f"{step.matches[at].landmark_id} {distance.mean_m:.1f} ± {np.sqrt(distance.variance_m2):.1f} m"
    assert overlays.labels(step)[at] == expected
    assert overlays.labels(wrong)[at] == f"{expected} (truly P99)"


def test_ellipse_and_ring_lie_where_they_should() -> None:
    covariance = np.array([[4.0, 1.5], [1.5, 2.0]])
    off = shapes.ellipse(np.array([10.0, -3.0]), covariance)[:, :2] - [10.0, -3.0]
    squared = np.einsum("ni,ij,nj->n", off, np.linalg.inv(covariance), off)
    np.testing.assert_allclose(squared, 4.0, rtol=1e-4)
    circle = shapes.ring(np.array([5.0, 6.0]), 12.0)
    np.testing.assert_allclose(np.hypot(*(circle[:, :2] - [5.0, 6.0]).T), 12.0, rtol=1e-5)


def test_road_edges_lie_half_a_width_to_either_side() -> None:
    known = road_map()
    left, centre, right = shapes.road_lines(known.centre_line_m, known.half_width_m)
    np.testing.assert_allclose(np.linalg.norm(left - centre, axis=1), 4.0, rtol=1e-5)
    (east, north), across = np.diff(centre[:, :2], axis=0).T, (left - right)[:-1]
    assert (east * across[:, 1] - north * across[:, 0] > 0).all()


def test_what_never_changes_comes_first(tmp_path: Path) -> None:
    """In another order, the viewer takes the masks for a video and complains over every view."""
    path = write(tmp_path / "bend.rrd", synthetic_steps(3, particles=10, cells=CELLS))
    for entity in ("/camera/masks", "/camera/image"):
        static = [chunk.is_static for chunk in RrdReader(path).stream().filter(content=entity)]
        assert static == sorted(static, reverse=True) and static[0] and not static[-1]
