"""The distances' part of a recording: each matched landmark's, with its band, its truth and its ring on the map."""

from __future__ import annotations

import numpy as np
import rerun as rr

from scpf.models.road_map import RoadMap
from scpf.replay import shapes
from scpf.replay.overlays import LandmarkClasses
from scpf.replay.recording_rows import RowBatches
from scpf.replay.recording_style import TRUE_DISTANCE
from scpf.replay.step import Step


class DistanceRows:
    """Writes one line a landmark; it has gaps where the landmark is not seen."""

    def __init__(self, rows: RowBatches, road_map: RoadMap | None, classes: LandmarkClasses) -> None:
        self._rows = rows
        self._classes = classes
        marks = road_map.landmarks if road_map else ()
        self._landmarks = {mark.id: np.array(mark.position_m[:2]) for mark in marks}
        self._shown: set[str] = set()

    def log(self, step: Step) -> None:
        """The distances of one step."""
        rings, ids, seen = [], [], set[str]()
        for observation, match, truth in zip(
            step.observations, step.matches, step.true_distances_m, strict=True
        ):
            name, distance = match.landmark_id, observation.distance
            if not name or name in seen:
                continue
            seen.add(name)
            part = rr.escape_entity_path_part(name)
            entity = f"gpr/{part}"
            colour = self._classes.colour_of(name)
            self._rows.style_once(f"{entity}/true", TRUE_DISTANCE)
            self._rows.style_once(entity, rr.Measurements.from_fields(names=[name], colors=[colour]))
            spread = [distance.variance_m2]
            columns = rr.Measurements.columns
            self._rows.add(entity, columns, values=[distance.mean_m], variances=spread)
            if truth is not None:
                self._rows.number(f"{entity}/true", truth)
                self._rows.style_once(
                    f"distance_error/{part}", rr.Measurements.from_fields(names=[name], colors=[colour])
                )
                off = [distance.mean_m - truth]
                self._rows.add(f"distance_error/{part}", columns, values=off, variances=spread)
            if name in self._landmarks:
                rings.append(shapes.ring(self._landmarks[name], distance.mean_m))
                ids.append(self._classes.class_of(name))
        for name in sorted(self._shown - seen):  # a gap, not a line to the next time that it is seen
            for group in ("gpr", "distance_error"):
                self._rows.number(f"{group}/{rr.escape_entity_path_part(name)}", None)
        self._shown = seen
        self._rows.add("world/rings", rr.LineStrips3D.columns, strips=rings, class_ids=ids)
