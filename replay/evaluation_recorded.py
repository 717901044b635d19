"""Evaluation on recorded observations: what a replay measured, filtered again on other noise of the GPS."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.drive_log import DriveLog
from scpf.ingest.maps import read_map
from scpf.ingest.messages import from_pose
from scpf.models.errors import InputError, MissingError
from scpf.models.road_map import RoadMap
from scpf.models.trajectory import yaw_of
from scpf.replay.evaluation_plan import FEWEST_FRAMES, recording_name
from scpf.replay.protocol import Case, Detection, Scenario
from scpf.replay.protocol_drive import Drive, Ring
from scpf.replay.result_messages import register_types
from scpf.replay.results import OBSERVATIONS_TOPIC, REFERENCE_TOPIC

Array = NDArray[np.float64]

LINE_SPACING_M: Final = 1.0
MOVING_MPS: Final = 1.0
AGAINST_SHARE: Final = 0.05
"""A drive that goes against its road's direction for longer than this turned round on the way."""


def read_scenario(path: Path, map_path: Path | None = None) -> Scenario:
    """The drive of a results file: its reference, the detections of each frame, and the map.

    Frames without a reference pose are left out and counted; so are, uncounted, observations outside the training
    range of the distance model, as in the replay. Positions are relative to the middle of the drive, ``middle_m``,
    where float32 keeps millimetres. The map is ``map_path``, else the one attached. Raises InputError for a log that
    holds too little or a drive that turns round, MissingError without a map.
    """
    register_types()
    with DriveLog(path) as log:
        road_map = log.road_map() if map_path is None else read_map(map_path)
        poses = {
            one.stamp_ns: from_pose(one.message.pose.position, one.message.pose.orientation)
            for one in log.messages([REFERENCE_TOPIC])
        }
        seen = {one.stamp_ns: one.message.observations for one in log.messages([OBSERVATIONS_TOPIC])}
    if not seen:
        raise InputError(f"{path} holds no observations", "give the .results.mcap that `scpf replay` writes")
    if road_map is None or not road_map.landmarks:
        raise MissingError(f"{path}: no map with landmarks in the log", "give one with --map")
    if len(road_map.centre_line_m) < 4:
        raise MissingError(f"{path}: the map has no centre line", "give one that has, with --map")
    stamps = sorted(seen.keys() & poses.keys())
    if len(stamps) < FEWEST_FRAMES:
        raise InputError(f"{path}: {len(stamps)} frames have observations and a reference pose, too few")

    times_s: Array = (np.array(stamps, dtype=np.int64) - stamps[0]).astype(np.float64) / 1e9
    drive = _drive(np.array([poses[stamp] for stamp in stamps]), times_s)
    middle = np.round(0.5 * (drive.positions_m.min(axis=0) + drive.positions_m.max(axis=0)))
    drive = replace(drive, positions_m=drive.positions_m - middle)
    road_map = _moved(road_map, middle)
    index = {mark.id: k for k, mark in enumerate(road_map.landmarks)}
    own_m2 = max(mark.variance_m2 for mark in road_map.landmarks)
    return Scenario(
        Case(recording_name(str(path))),
        _road(path, road_map.centre_line_m, drive),
        road_map,
        drive,
        tuple(_detections(seen[stamp], index, own_m2) for stamp in stamps),
        times_s,
        start_ns=stamps[0],
        middle_m=(float(middle[0]), float(middle[1])),
        left_out=len(seen) - len(stamps),
    )


def with_map_error(
    scenario: Scenario, map_error_m: tuple[float, float], rng: np.random.Generator
) -> Scenario:
    """The scenario with every landmark of the map moved by a distance between the two, in any direction."""
    count = len(scenario.road_map.landmarks)
    off, turn = rng.uniform(*map_error_m, count), rng.uniform(0.0, 2 * np.pi, count)
    steps = off[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    marks = [
        replace(mark, position_m=_shift(mark.position_m, step))
        for mark, step in zip(scenario.road_map.landmarks, steps, strict=True)
    ]
    road_map = RoadMap(tuple(marks), scenario.road_map.centre_line_m, scenario.road_map.half_width_m)
    return replace(scenario, road_map=road_map)


def _drive(poses: Array, times_s: Array) -> Drive:
    """The truth of ``T_map_body`` (K, 4, 4) at ``times_s`` (K,)."""
    positions = poses[:, :2, 3].copy()
    velocities = np.gradient(positions, times_s, axis=0)
    return Drive(positions, velocities, np.array([yaw_of(pose) for pose in poses]))


def _detections(rows: Iterable[Any], index: Mapping[str, int], own_m2: float) -> tuple[Detection, ...]:
    """Detections of scpf_msgs/Observation; ``own_m2`` is the variance of the map itself."""
    return tuple(
        Detection(
            index.get(row.true_landmark_id, -1),
            float(row.distance_m),
            float(row.distance_variance_m2) + own_m2,
            float(row.bearing_rad),
        )
        for row in rows
        if row.in_range and row.distance_m > 0.0
    )


def _road(path: Path, centre_line_m: Array, drive: Drive) -> Ring:
    """The centre line, equally spaced, in the sense in which the drive follows it."""
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(centre_line_m, axis=0).T))])
    closed = bool(np.allclose(centre_line_m[0], centre_line_m[-1]))
    at = np.linspace(0.0, length[-1], max(4, round(length[-1] / LINE_SPACING_M)), endpoint=not closed)
    line = np.column_stack([np.interp(at, length, axis) for axis in centre_line_m.T])
    direction = _directions(line, closed)
    moving = np.hypot(*drive.velocities_mps.T) > MOVING_MPS
    nearest = [int(np.argmin(((line - at) ** 2).sum(1))) for at in drive.positions_m[moving]]
    against = np.cos(direction[nearest] - drive.headings_rad[moving]) < 0.0
    share = float(against.mean()) if len(against) else 0.0
    if AGAINST_SHARE < share < 1.0 - AGAINST_SHARE:
        raise InputError(
            f"{path}: the drive turns round on its road", "replay the two ways apart, with --start and --stop"
        )
    if share > 0.5:
        line = line[::-1].copy()
        direction = _directions(line, closed)
    return Ring(line, direction)


def _directions(line_m: Array, closed: bool) -> Array:
    """Direction (P,) at each point of a line (P, 2), unwrapped."""
    around = np.vstack([line_m[-1:], line_m, line_m[:1]]) if closed else line_m
    ahead = np.gradient(around, axis=0)
    ahead = ahead[1:-1] if closed else ahead
    directions: Array = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
    return directions


def _moved(road_map: RoadMap, middle_m: Array) -> RoadMap:
    """The map relative to ``middle_m`` (2,)."""
    marks = [replace(mark, position_m=_shift(mark.position_m, -middle_m)) for mark in road_map.landmarks]
    return RoadMap(tuple(marks), road_map.centre_line_m - middle_m, road_map.half_width_m)


def _shift(position_m: tuple[float, float, float], step_m: Array) -> tuple[float, float, float]:
    east, north, up = position_m
    return east + float(step_m[0]), north + float(step_m[1]), up
