"""The results: read back through the MCAP and rosbags libraries, and the summary's numbers."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from synthetic_steps import FIRST_STAMP_NS, PERIOD_NS, road_map, synthetic_steps

from scpf.ingest.messages import from_time, typestore
from scpf.models.association import Match
from scpf.models.instances import instance_from_mask
from scpf.models.observation import Distance
from scpf.models.road_map import to_geojson
from scpf.replay import results as topics
from scpf.replay.result_messages import from_observation
from scpf.replay.results import Results
from scpf.replay.step import Errors, Step
from scpf.replay.summary import Tally, json_safe, statistics, summarise

BLIND = 3


@pytest.fixture(scope="module")
def steps() -> list[Step]:
    """Six steps, the fourth without a detection and without a reference."""
    made = synthetic_steps(6, blind=frozenset({BLIND}))
    blind = made[BLIND]
    made[BLIND] = replace(
        blind, frame=replace(blind.frame, T_map_body=None), errors=None, baseline_errors=None,
        unmeasured=(instance_from_mask(np.eye(4, dtype=bool)),),
    )  # fmt: skip
    return made


@pytest.fixture(scope="module")
def written(steps: list[Step], tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Their results file and summary."""
    path = tmp_path_factory.mktemp("results") / "bend.results.mcap"
    configuration = {"seed": 3, "window": {"stop_s": float("inf")}}
    with Results(path, configuration, to_geojson(road_map()), particles=True) as results:
        for step in steps:
            results.log(step)
        summary = results.summary()
    return path, summary


def read(path: Path, topic: str) -> list[tuple[int, Any]]:
    """Log times and messages of a topic, each decoded by the definition that the file itself holds."""
    with path.open("rb") as file:
        rows = list(make_reader(file, validate_crcs=True).iter_messages(topics=[topic]))
    return [(m.log_time, typestore().deserialize_cdr(memoryview(m.data), s.name)) for s, _, m in rows if s]


def test_observations_come_back_whole(written: tuple[Path, dict[str, Any]], steps: list[Step]) -> None:
    rows = read(written[0], topics.OBSERVATIONS_TOPIC)
    assert [stamp for stamp, _ in rows] == [FIRST_STAMP_NS + k * PERIOD_NS for k in range(6)]
    for (stamp, message), step in zip(rows, steps, strict=True):
        assert from_time(message.header.stamp) == stamp and message.frame == step.frame.index
        assert len(message.unmeasured) == len(step.unmeasured)
        assert len(message.observations) == len(step.observations)
        for row, observation, match, true_m in zip(
            message.observations, step.observations, step.matches, step.true_distances_m, strict=True
        ):
            back, back_match = from_observation(row)
            assert (back.distance, back.bearing_rad, back_match) == (
                observation.distance, observation.bearing_rad, match,
            )  # fmt: skip
            np.testing.assert_array_equal(back.instance.mask, observation.instance.mask)
            assert back.instance.offset_px == observation.instance.offset_px
            assert row.true_distance_m == true_m


def test_poses_belief_and_errors(written: tuple[Path, dict[str, Any]], steps: list[Step]) -> None:
    path, _ = written
    for topic in (topics.ESTIMATE_TOPIC, topics.BASELINE_TOPIC, topics.BELIEF_TOPIC, topics.TIMING_TOPIC):
        assert len(read(path, topic)) == 6
    for (_, estimate), (_, belief), step in zip(
        read(path, topics.ESTIMATE_TOPIC), read(path, topics.BELIEF_TOPIC), steps, strict=True
    ):
        position, covariance = estimate.pose.pose.position, estimate.pose.covariance.reshape(6, 6)
        assert (position.x, position.y) == pytest.approx(tuple(step.belief.mean[:2]))
        np.testing.assert_allclose(covariance[:2, :2], step.belief.covariance[:2, :2])
        assert belief.state == step.belief.state and belief.ess == pytest.approx(step.belief.ess)
        np.testing.assert_allclose(belief.particles.reshape(-1, 4), step.belief.states, rtol=1e-5, atol=1e-5)
    errors = read(path, topics.ERRORS_TOPIC)
    assert [message.frame for _, message in errors] == [0, 1, 2, 4, 5]
    assert errors[0][1].lateral_m == pytest.approx(steps[0].errors.lateral_m)  # type: ignore[union-attr]
    assert len(read(path, topics.REFERENCE_TOPIC)) == 5 and len(read(path, topics.GPS_TOPIC)) == 6
    assert [message.level for _, message in read(path, topics.LOG_TOPIC)] == [20, 30]


def test_every_type_is_read_by_rosbags_from_the_file_alone(written: tuple[Path, dict[str, Any]]) -> None:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    with written[0].open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            assert schema is not None and (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
            store = get_typestore(Stores.EMPTY)
            store.register(get_types_from_msg(schema.data.decode(), schema.name))
            store.deserialize_cdr(message.data, schema.name)


def test_attachments(written: tuple[Path, dict[str, Any]]) -> None:
    with written[0].open("rb") as file:
        attached = {each.name: json.loads(each.data) for each in make_reader(file).iter_attachments()}
    assert attached["configuration.json"] == {"seed": 3, "window": {"stop_s": None}}
    assert attached["map.geojson"]["type"] == "FeatureCollection"


def test_summary_is_valid_json_and_counts(written: tuple[Path, dict[str, Any]], steps: list[Step]) -> None:
    summary = written[1]
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary
    seen = sum(len(step.observations) for step in steps)
    detections = summary["detections"]
    assert (summary["frames"], summary["seed"], summary["window"]) == (6, 3, {"stop_s": None})
    assert detections["total"] == seen + 1 and detections["unmeasured"] == 1
    assert detections["matched"] == detections["matched_right"]
    assert detections["unmatched"] == sum(detections["unmatched_reasons"].values())
    assert sum(summary["poles_per_frame"].values()) == 6
    assert summary["states"] == {"tracking": 5, "unconstrained": 1}
    assert summary["notes"] == {"INFO": 1, "WARNING": 1}
    position = [step.errors.position_m for step in steps if step.errors]
    assert summary["errors"]["position"]["count"] == 5
    assert summary["errors"]["position"]["mean"] == pytest.approx(np.mean(position))
    assert summary["timing_ms"]["segmentation"] == pytest.approx({"median": 22.5, "p95": 24.75, "max": 25.0})


def test_statistics_by_hand() -> None:
    expected = {"count": 4, "mean": -0.5, "median": 0.5, "rmse": np.sqrt(30 / 4), "p95": 4.55, "max": 5.0}
    assert statistics([1.0, 0.0, 2.0, -5.0, float("nan")]) == pytest.approx(expected)
    assert statistics([]) == statistics([float("nan")]) == {}


def test_summary_of_known_errors_and_distances(steps: list[Step]) -> None:
    source = next(step for step in steps if step.observations)
    observation = replace(source.observations[0], distance=Distance(11.0, 0.25, 0.1, "arm"))
    step = replace(
        source, observations=(observation,) * 2, matches=(Match("P1"), Match("", "too far")),
        true_distances_m=(10.5, 9.0), true_landmark_ids=("P2", "P3"),
        errors=Errors(5.0, -3.0, 4.0), baseline_errors=None,
    )  # fmt: skip
    tally = Tally()
    tally.add(step)
    summary = summarise(tally, {})
    assert (
        summary["errors"]["longitudinal"]["mean"] == -3.0 and summary["errors"]["longitudinal"]["max"] == 3.0
    )
    assert "baseline_position" not in summary["errors"]
    assert summary["distance_errors"]["expert arm"] == pytest.approx(
        {"count": 2, "mean_absolute_m": 1.25, "bias_m": 1.25, "rmse_m": np.sqrt(4.25 / 2), "coverage_95": 0.5}
    )
    detections = summary["detections"]
    assert (detections["matched_wrong"], detections["unmatched_reasons"]) == (1, {"too far": 1})


def test_summary_of_nothing() -> None:
    summary = summarise(Tally(), {})
    assert summary["frames"] == 0 and summary["errors"] == {}
    json.dumps(summary, allow_nan=False)


def test_json_safe() -> None:
    value = {"a": (np.float32(1.5), np.array([1.0, np.nan])), 2: Path("x"), "b": [True, None, np.int64(3)]}
    assert json_safe(value) == {"a": [1.5, [1.0, None]], "2": "x", "b": [True, None, 3]}


def test_an_interrupted_run_keeps_the_partial_file(steps: list[Step], tmp_path: Path) -> None:
    path = tmp_path / "cut.results.mcap"
    with pytest.raises(KeyboardInterrupt), Results(path, {}) as results:
        results.log(steps[0])
        raise KeyboardInterrupt
    assert not path.exists()
    assert len(read(tmp_path / "cut.results.mcap.partial", topics.ESTIMATE_TOPIC)) == 1
