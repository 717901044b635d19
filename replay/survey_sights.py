"""What drive logs saw of their landmarks: ranges, and directions from the camera's own place, by the reference pose."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.drive_log import DriveLog
from scpf.models.camera import Camera
from scpf.models.distance_file import Distances
from scpf.models.errors import InputError, MissingError
from scpf.models.instances import Instance, foot_px
from scpf.models.road_map import RoadMap
from scpf.models.survey_fit import Sights
from scpf.models.trajectory import Trajectory
from scpf.replay import distance_models
from scpf.replay.distance_training import segmented

Array = NDArray[np.float64]
Row = tuple[int, float, float, float, float, float, float, float, str]
"""Stamp (ns); body east, north; range and its variance; camera east, north; direction; landmark class."""

NO_POSE: Final = "no reference pose at the frame"
NO_DISTANCE: Final = "too small, or of a class without a distance model"
OUT_OF_RANGE: Final = "outside the training range of the distance model"
CUT: Final = "cut by the image's side: no direction"


@dataclass(frozen=True, eq=False)
class SurveyInput:
    """``sights`` of all logs, and the map that they start from. ``dropped`` instances by reason."""

    sights: Sights
    road_map: RoadMap
    frames: int
    unreadable: int
    dropped: Mapping[str, int]


def read_sights(
    paths: Sequence[Path],
    segmenter: str = "polenet",
    threshold: float = 0.9,
    distance_model: str = "default",
    every: int = 1,
    road_map: RoadMap | None = None,
    on_frame: Callable[[int, int], None] | None = None,
) -> SurveyInput:
    """Every instance of every ``every``-th frame as a sighting; ``road_map`` takes the place of the logs' own.

    Raises MissingError where a log lacks calibration, trajectory or map, InputError where two logs, or a log and the
    map, are not in one frame, or nothing was seen.
    """
    rows: list[Row] = []
    dropped: Counter[str] = Counter()
    frames = unreadable = 0
    for path in paths:
        with DriveLog(path) as log:
            camera, trajectory = log.camera(), log.trajectory()
            mapped = log.road_map() if road_map is None else road_map
            if camera is None or trajectory is None or mapped is None:
                parts = (("calibration", camera), ("reference trajectory", trajectory), ("map", mapped))
                lacking = ", ".join(name for name, part in parts if part is None)
                raise MissingError(f"{path}: no {lacking} in the log", "a survey needs all three")
            road_map = road_map or mapped
            if log.origin() != road_map.origin:
                raise InputError(
                    f"{path}: the map has another origin than the log",
                    "survey logs of one map frame at a time",
                )
            model = distance_models.load(distance_model, camera)
            for stamp_ns, instances in segmented(log, segmenter, threshold, every):
                frames += 1
                if instances is None:
                    unreadable += 1
                else:
                    rows += _rows(instances, stamp_ns, camera, trajectory, model, dropped)
                if on_frame is not None:
                    on_frame(frames, len(rows))
    if road_map is None or not rows:
        reasons = "; ".join(f"{count} × {reason}" for reason, count in dropped.items())
        raise InputError(
            f"nothing to survey in {frames} frames, {unreadable} of them unreadable",
            reasons or "the segmenter found nothing",
        )
    return SurveyInput(_sights(rows), road_map, frames, unreadable, dict(dropped.most_common()))


def _rows(
    instances: Sequence[Instance],
    stamp_ns: int,
    camera: Camera,
    trajectory: Trajectory,
    model: Distances,
    dropped: Counter[str],
) -> list[Row]:
    """The sightings of one frame."""
    T_map_body = trajectory.at(stamp_ns)
    if T_map_body is None or not instances:
        dropped[NO_POSE] += len(instances)
        return []
    T_map_camera = T_map_body @ camera.T_body_camera
    rays = camera.rays(np.array([foot_px(instance) for instance in instances])) @ T_map_camera[:3, :3].T
    distances = model.for_frame(stamp_ns).predict(instances, camera.width_px, camera.height_px)
    rows: list[Row] = []
    for instance, distance, (east, north, _) in zip(instances, distances, rays, strict=True):
        if distance is None:
            dropped[NO_DISTANCE] += 1
        elif not distance.in_range or distance.mean_m <= 0.0:
            dropped[OUT_OF_RANGE] += 1
        elif instance.box_px[0] <= 1.0 or instance.box_px[2] >= camera.width_px - 1.0:
            dropped[CUT] += 1
        else:
            body, lens = T_map_body[:2, 3].tolist(), T_map_camera[:2, 3].tolist()
            direction, kind = float(np.arctan2(north, east)), instance.landmark_class
            rows.append((stamp_ns, *body, distance.mean_m, distance.variance_m2, *lens, direction, kind))
    return rows


def _sights(rows: Sequence[Row]) -> Sights:
    """The sightings in the order of their times, which count from the first."""
    rows = sorted(rows, key=lambda row: row[0])
    stamps = np.array([row[0] for row in rows], dtype=np.int64)
    values: Array = np.array([row[1:8] for row in rows])
    return Sights(
        times_s=(stamps - stamps[0]) * 1e-9,
        ranged_from_m=values[:, 0:2],
        distances_m=values[:, 2],
        variances_m2=values[:, 3],
        seen_from_m=values[:, 4:6],
        directions_rad=values[:, 6],
        landmark_classes=np.array([row[8] for row in rows]),
    )
