"""The reference of a drive: a trajectory from a pose file, or the navigation of an Applanix log with all its fields."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from scpf.ingest import applanix
from scpf.ingest.drive_log import DriveLogWriter
from scpf.ingest.navigation import Navigation
from scpf.ingest.navigation_messages import native_message, native_records, standard_messages
from scpf.ingest.oxts import is_oxts, read_oxts
from scpf.ingest.read_report import ReadOptions, ReadReport
from scpf.ingest.trajectories import read_trajectory
from scpf.models.errors import InputError
from scpf.models.geodesy import Origin
from scpf.models.road_map import RoadMap
from scpf.models.trajectory import Trajectory

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
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


def open_poses(
    path: Path,
    *,
    stamps_ns: Stamps | None = None,
    T_body_camera: Array | None = None,
    variance_m2: float | None = None,
    road_map: RoadMap | None = None,
) -> PoseReference:
    """The reference of a pose file or an OXTS folder; ``stamps_ns`` and ``T_body_camera`` as ``read_trajectory``.

    OXTS positions are in degrees: they need a georeferenced map, or none.
    """
    if not is_oxts(path):
        poses = read_trajectory(path, stamps_ns=stamps_ns, T_body_camera=T_body_camera)
        return PoseReference(poses, variance_m2)
    found = read_oxts(path, _origin_of(road_map))
    return PoseReference(found.trajectory, variance_m2, found.origin)


def open_applanix(
    path: Path, options: ReadOptions, road_map: RoadMap | None, format: str | None = None
) -> NavigationReference | None:
    """The reference of an Applanix log, its format recognised by content; None for a file of another kind.

    Raises InputError and MissingError as ``applanix.read`` does, and where the map is not georeferenced.
    """
    if format is None and not _is_applanix(path):
        return None
    return NavigationReference(applanix.read(path, options, format), _origin_of(road_map))


def _origin_of(road_map: RoadMap | None) -> Origin | None:
    """The map's origin; InputError for a map in metres, which positions in degrees cannot be put into."""
    if road_map is not None and road_map.origin is None:
        raise InputError(
            "the map is in metres of a local frame, and the reference is in degrees",
            "give a georeferenced map, or the trajectory in the frame of the map",
        )
    return None if road_map is None else road_map.origin


def _is_applanix(path: Path) -> bool:
    try:
        return path.is_file() and bool(applanix.recognise(path))
    except InputError:
        return False
