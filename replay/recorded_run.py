"""A replay read back from its results: every frame's numbers, without the images."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.drive_log import DriveLog
from scpf.models.association import Match
from scpf.models.errors import InputError
from scpf.models.observation import Observation
from scpf.models.road_map import RoadMap
from scpf.replay import results
from scpf.replay.result_messages import from_observation, register_types
from scpf.replay.settings import Settings
from scpf.replay.settings_file import settings_of_document
from scpf.replay.soft_constraints import soft_constraints
from scpf.replay.step import Surface
from scpf.replay.surface import constraint_surface

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """K frames of a replay. What a frame does not have is NaN.

    ``stamps_ns`` (K,); positions in map, m: ``estimate_m``, ``baseline_m``, ``reference_m``, ``gps_m`` (K, 2);
    ``errors_m`` (K, 3): total, longitudinal, lateral; ``baseline_error_m`` (K,); ``deviations_m`` (K, 2): standard
    deviations of the estimate in x and y. ``means``: the belief's mean (D,), or None before there is one. ``seen``: the
    observations of each frame with their matches. ``poles`` (K,): instances, measured or not.
    """

    name: str
    configuration: dict[str, Any]
    settings: Settings
    road_map: RoadMap | None
    frames: NDArray[np.int64]
    stamps_ns: NDArray[np.int64]
    estimate_m: Array
    baseline_m: Array
    reference_m: Array
    gps_m: Array
    errors_m: Array
    baseline_error_m: Array
    deviations_m: Array
    means: tuple[Array | None, ...]
    states: tuple[str, ...]
    seen: tuple[tuple[tuple[Observation, Match], ...], ...]
    poles: NDArray[np.int64]

    @property
    def times_s(self) -> Array:
        """Seconds (K,) since the first frame."""
        seconds: Array = (self.stamps_ns - self.stamps_ns[0]) * 1e-9
        return seconds

    def matched(self, row: int) -> list[tuple[Observation, Match]]:
        """The observations of a row that were matched to a landmark."""
        return [(seen, match) for seen, match in self.seen[row] if match.landmark_id]

    def surface(self, row: int) -> Surface | None:
        """The constraint surface about the estimate of a row; None before there is one.

        The constraints are those about the estimate itself, where the replay took the prediction before it.
        """
        mean = self.means[row]
        if mean is None:
            return None
        road_map = self.road_map if self.road_map is not None else RoadMap((), np.zeros((0, 2)))
        observations, matches = [seen for seen, _ in self.seen[row]], [match for _, match in self.seen[row]]
        direction = road_map.direction_near(mean[:2], mean[2:4])
        yaw = float(np.arctan2(mean[3], mean[2])) if direction is None else direction
        constraints = soft_constraints(self.settings, road_map, observations, matches, mean, yaw)
        return constraint_surface(constraints, mean, self.settings.surface)


def read_run(path: Path) -> RecordedRun:
    """The replay whose NAME.results.mcap this is. Raises InputError where it is none."""
    register_types()
    with DriveLog(path) as log:
        attachment = log.attachments().get(results.CONFIGURATION_ATTACHMENT)
        if attachment is None or not log.count(results.OBSERVATIONS_TOPIC):
            raise InputError(
                f"{path} holds no results", "give the NAME.results.mcap that `scpf replay` writes"
            )
        try:
            configuration = json.loads(attachment)
            document = configuration["settings"]
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise InputError(f"{path}: {results.CONFIGURATION_ATTACHMENT} is damaged ({error})") from error
        settings, road_map = settings_of_document(document, path), log.road_map()
        rows: dict[int, int] = {}
        frames, seen, poles = [], [], []
        for record in log.messages([results.OBSERVATIONS_TOPIC]):
            if record.stamp_ns in rows:  # of two frames of one time, the first is shown
                continue
            rows[record.stamp_ns] = len(rows)
            message = record.message
            try:
                seen.append(tuple(from_observation(each) for each in message.observations))
            except ValueError as error:
                raise InputError(f"{path}: frame {message.frame}: {error}") from error
            frames.append(int(message.frame))
            poles.append(len(message.observations) + len(message.unmeasured))
        read = partial(_columns, log, rows)
        estimate = read(
            results.ESTIMATE_TOPIC, lambda one: [*_place(one.pose.pose), *_deviations(one.pose)], 4
        )
        errors = read(results.ERRORS_TOPIC, _errors, 4)
        beliefs: list[tuple[Array | None, str]] = [(None, "initialising")] * len(rows)
        for record in log.messages([results.BELIEF_TOPIC]):
            if record.stamp_ns in rows:
                belief = record.message
                beliefs[rows[record.stamp_ns]] = (np.array(belief.mean, dtype=float), str(belief.state))
        return RecordedRun(
            name=path.name.removesuffix(".results.mcap"),
            configuration=configuration,
            settings=settings,
            road_map=road_map,
            frames=np.array(frames, dtype=np.int64),
            stamps_ns=np.array(list(rows), dtype=np.int64),
            estimate_m=estimate[:, :2],
            baseline_m=read(results.BASELINE_TOPIC, lambda one: _place(one.pose.pose), 2),
            reference_m=read(results.REFERENCE_TOPIC, lambda one: _place(one.pose), 2),
            gps_m=read(results.GPS_TOPIC, lambda one: _place(one.pose.pose), 2),
            errors_m=errors[:, :3],
            baseline_error_m=errors[:, 3],
            deviations_m=estimate[:, 2:],
            means=tuple(mean for mean, _ in beliefs),
            states=tuple(state for _, state in beliefs),
            seen=tuple(seen),
            poles=np.array(poles, dtype=np.int64),
        )


def _columns(
    log: DriveLog, rows: Mapping[int, int], topic: str, values: Callable[[Any], list[float]], width: int
) -> Array:
    """What ``values`` takes of each message of a topic, (K, ``width``), at its frame's row; NaN elsewhere."""
    table = np.full((len(rows), width), np.nan)
    for record in log.messages([topic]):
        row = rows.get(record.stamp_ns)
        if row is not None:
            table[row] = values(record.message)
    return table


def _place(pose: Any) -> list[float]:
    return [pose.position.x, pose.position.y]


def _deviations(pose: Any) -> list[float]:
    return [float(np.sqrt(max(pose.covariance[k], 0.0))) for k in (0, 7)]


def _errors(message: Any) -> list[float]:
    return [message.position_m, message.longitudinal_m, message.lateral_m, message.baseline_position_m]
