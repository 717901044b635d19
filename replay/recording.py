"""The recording: every step of a replay as a Rerun file. docs/RECORDING.md says what goes where."""

from __future__ import annotations

import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from scpf.models.camera import Camera
from scpf.models.errors import InputError
from scpf.models.road_map import RoadMap
from scpf.replay import overlays, shapes
from scpf.replay.blueprint import MAP_ASPECT, Extent, layout
from scpf.replay.recording_camera import log_image, log_instances
from scpf.replay.recording_distances import DistanceRows
from scpf.replay.recording_poses import PoseRows
from scpf.replay.recording_rows import RowBatches
from scpf.replay.recording_stream import FLUSH_EVERY, new_stream
from scpf.replay.recording_style import log_map, log_style, log_surface_style, timing_style
from scpf.replay.recording_terms import TermGrids
from scpf.replay.step import Step, Surface

Array = NDArray[np.float64]

NAMESPACE: Final = uuid.UUID("6f6f1d0c-5f0b-4a3e-9d35-0e6f6b1c7a10")

LEVELS: Final = {"WARNING": "WARN", "FATAL": "CRITICAL"}


class Recording:
    """Writes ``NAME.rrd``; until the last step is in, the file is called ``NAME.partial.rrd``.

    Of an interrupted replay the partial file stays, and the viewer opens it up to the last flush.
    """

    def __init__(
        self,
        path: Path,
        *,
        name: str,
        camera: Camera | None,
        road_map: RoadMap | None,
        about_markdown: str,
        settings: Mapping[str, str],
        images: bool = True,
        identity: str = "",
        terms: Sequence[str] = (),
    ) -> None:
        """``images`` False leaves the pictures out; masks, outlines and labels stay.

        ``identity`` is the recording id, for a recording that the viewer shows together with a file of pictures.
        ``terms`` are the constraints that have a view of their own.
        """
        self.path = path
        self.partial_path = path.with_suffix(".partial.rrd")  # the viewer opens nothing else
        self._camera = camera
        self._images = images
        self._classes = overlays.LandmarkClasses(road_map)
        self._grid: tuple[int, int, float] | None = None
        self._state = ""
        self._unflushed = 0
        # The same run twice is the same recording; two different runs can be opened side by side.
        own = str(uuid.uuid5(NAMESPACE, repr((name, sorted(settings.items())))))
        self._rec = new_stream(identity or own)
        self._rows = RowBatches(self._rec)
        self._poses = PoseRows(self._rows, camera)
        self._distances = DistanceRows(self._rows, road_map, self._classes)
        self._terms = TermGrids(self._rec, self._rows)
        size = (camera.width_px, camera.height_px) if camera else None
        try:
            self._rec.save(self.partial_path, default_blueprint=layout(size, _extent(road_map), terms))
        except RuntimeError as error:
            raise InputError(f"{self.partial_path} cannot be written ({error})") from error
        self._rec.send_recording_name(name)
        if settings:
            self._rec.send_property("scpf", rr.AnyValues(drop_untyped_nones=True, **settings))
        self._rec.log("about", rr.TextDocument(about_markdown, media_type="text/markdown"), static=True)
        log_style(self._rec)
        if road_map is not None:
            log_map(self._rec, road_map, self._classes)
        self._rec.flush()  # what never changes goes first: else the viewer may take the masks for a video

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._rows.send()
        self._rec.flush()
        self._rec.disconnect()  # writes the footer
        if kind is None:
            self.partial_path.replace(self.path)

    def log(self, step: Step) -> None:
        """Add one step at its frame's index and stamp."""
        self._rec.set_time("frame", sequence=step.frame.index)
        self._rec.set_time("time", timestamp=np.datetime64(step.frame.stamp_ns, "ns"))
        self._rows.at(step.frame.index, step.frame.stamp_ns)
        if self._images:
            log_image(self._rec, step.frame.encoded, step.frame.image_format)
        height_px = self._camera.height_px if self._camera else None
        log_instances(self._rec, self._rows, step, self._classes, height_px)
        self._poses.log(step)
        self._distances.log(step)
        if step.surface is not None:
            self._log_surface(step.surface)
        self._log_numbers(step)
        self._unflushed += 1
        if self._unflushed == FLUSH_EVERY:  # a killed process keeps what was flushed
            self._rows.send()
            self._rec.flush()
            self._unflushed = 0

    def _log_surface(self, surface: Surface) -> None:
        rows, columns = surface.violation.shape
        if self._grid != (rows, columns, surface.cell_m):
            self._grid = (rows, columns, surface.cell_m)
            log_surface_style(self._rec, *self._grid)
        # A grid map is placed by its lower left corner, and its first row is the top one.
        corner = (*(np.asarray(surface.corner_m) - surface.cell_m / 2), -0.05)
        log_probability, peak = shapes.relative_log_probability(surface)
        violation, lowest = shapes.relative_violation(surface)
        for name, marker, values, best in (
            ("log_probability", "peak", log_probability, log_probability == log_probability.max()),
            ("sum", "minimum", violation, violation == violation.min()),
        ):
            data = values[::-1].astype(np.float16).tobytes()
            self._rows.add(f"world/surface/{name}", rr.GridMap.columns, data=[data], translation=[corner])
            at = shapes.cell_centre(surface, best)
            self._rows.add(f"world/surface/{name}/{marker}", rr.Points3D.columns, positions=at)
        self._terms.log(surface)
        self._rows.number("surface/peak", peak)
        self._rows.number("surface/minimum", lowest)

    def _log_numbers(self, step: Step) -> None:
        errors, baseline = step.errors, step.baseline_errors
        self._rows.number("error/position/scpf", errors.position_m if errors else None)
        self._rows.number("error/position/pf", baseline.position_m if baseline else None)
        self._rows.number("error/heading_frame/longitudinal", errors.longitudinal_m if errors else None)
        self._rows.number("error/heading_frame/lateral", errors.lateral_m if errors else None)
        if step.belief is not None:
            self._rows.number("filter/ess", step.belief.ess)
            self._rows.number("filter/log_evidence", step.belief.log_evidence)
        if step.state != self._state:
            self._state = step.state
            self._rec.log("filter/state", rr.StateChange(state=self._state))
        for place, (stage, seconds) in enumerate(step.timing_s.items()):
            entity = f"timing/{rr.escape_entity_path_part(stage)}"
            self._rows.style_once(entity, timing_style(stage, place))
            self._rows.number(entity, seconds * 1e3)
        for level, text in step.notes:
            self._rec.log("log", rr.TextLog(text, level=LEVELS.get(level.upper(), level.upper())))


def _extent(road_map: RoadMap | None) -> Extent | None:
    if road_map is None or not (len(road_map.centre_line_m) or road_map.landmarks):
        return None
    points = np.vstack([road_map.centre_line_m.reshape(-1, 2), road_map.positions_m])
    low, high = points.min(axis=0), points.max(axis=0)
    (east, north), (width, height) = (low + high) / 2, high - low
    return Extent((float(east), float(north)), float(max(height, width / MAP_ASPECT)) / 2 + 10.0)
