"""The reference of a drive: a trajectory from a pose file, or the navigation of an Applanix log with all its fields."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from scpf.ingest import applanix
from scpf.ingest.drive_log import DriveLogWriter
from scpf.ingest.navigation import Navigation
from scpf.ingest.navigation_messages import native_message, native_records, standard_messages
from scpf.ingest.read_report import ReadOptions, ReadReport
from scpf.models.errors import InputError
from scpf.models.geodesy import Origin
from scpf.models.road_map import RoadMap
from scpf.models.trajectory import Trajectory

Write = tuple[int, Callable[[], None]]
"""A stamp (UTC ns), and what writes the messages of that time."""


class Reference(Protocol):
    """Where the vehicle was, and how that is written into a drive log."""

    @property
    def trajectory(self) -> Trajectory:
        """Poses of the body in ``map``."""
        ...

    @property
    def origin(self) -> Origin | None:
        """The origin of ``map``; None where the poses are not georeferenced."""
        ...

    @property
    def report(self) -> ReadReport | None:
        """What was read and what was not, of formats that have such a report."""
        ...

    def writes(self, log: DriveLogWriter, first_ns: int, last_ns: int) -> Iterator[Write]:
        """Everything between two times, in the order of time."""
        ...


@dataclass(frozen=True)
class PoseReference:
    """Poses alone, each with the same ``variance_m2`` a position axis (None: unknown)."""

    trajectory: Trajectory
    variance_m2: float | None = None
    origin: Origin | None = None
    report: ReadReport | None = None

    def writes(self, log: DriveLogWriter, first_ns: int, last_ns: int) -> Iterator[Write]:
        """The poses between two times."""
        stamps = self.trajectory.stamps_ns
        first, last = np.searchsorted(stamps, first_ns, "left"), np.searchsorted(stamps, last_ns, "right")
        poses = self.trajectory.poses()
        for k in range(int(first), int(last)):
            stamp = int(stamps[k])
            yield stamp, lambda k=k, stamp=stamp: log.write_pose(stamp, poses[k], self.variance_m2)  # type: ignore[misc]


class NavigationReference:
    """The navigation of an Applanix log: the standard topics, and every native record beside them.

    ``origin``: that of the map, where there is one; else the navigation's first position.
    """

    def __init__(self, navigation: Navigation, origin: Origin | None = None) -> None:
        self.navigation = navigation
        self.origin = origin if origin is not None else navigation.origin()
        self.trajectory = navigation.to_trajectory(self.origin)
        self.report = navigation.report

    def writes(self, log: DriveLogWriter, first_ns: int, last_ns: int) -> Iterator[Write]:
        """Messages and native records between two times."""
        standard = standard_messages(self.navigation.between(first_ns, last_ns), self.origin)
        native = (
            native_message(record)
            for record in native_records(self.navigation)
            if first_ns <= record.stamp_ns <= last_ns
        )
        for out in heapq.merge(standard, native, key=lambda out: out.stamp_ns):
            yield (
                out.stamp_ns,
                lambda out=out: log.write_message(out.topic, out.typename, out.message, out.stamp_ns),  # type: ignore[misc]
            )


def open_applanix(
    path: Path, options: ReadOptions, road_map: RoadMap | None, format: str | None = None
) -> NavigationReference | None:
    """The reference of an Applanix log, its format recognised by content; None for a file of another kind.

    Raises InputError and MissingError as ``applanix.read`` does, and where the map is not georeferenced.
    """
    if format is None and not _is_applanix(path):
        return None
    if road_map is not None and road_map.origin is None:
        raise InputError(
            "the map is in metres of a local frame, and an Applanix log is in degrees",
            "give a georeferenced map, or the trajectory in the frame of the map",
        )
    return NavigationReference(applanix.read(path, options, format), road_map.origin if road_map else None)


def _is_applanix(path: Path) -> bool:
    try:
        return path.is_file() and bool(applanix.recognise(path))
    except InputError:
        return False
