"""What a drive log and the settings bring to a replay, and what is missing there."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from importlib.metadata import version
from math import isinf
from typing import Any, Final

from scpf.ingest.assemble import sha256
from scpf.ingest.drive_log import DriveLog
from scpf.models.camera import Camera
from scpf.models.distance_file import Distances
from scpf.models.road_map import RoadMap
from scpf.models.trajectory import Trajectory
from scpf.replay import distance_models
from scpf.replay.frames import Window
from scpf.replay.pace import PaceSettings
from scpf.replay.settings import Settings

REPORTED_PACKAGES: Final = ("scpf", "numpy", "scipy", "opencv-python-headless", "torch", "rerun-sdk", "mcap")


@dataclass(frozen=True, eq=False)
class Drive:
    """A drive's calibration, map and reference, and the distance model for its camera; any of them may be missing."""

    camera: Camera | None
    road_map: RoadMap | None
    trajectory: Trajectory | None
    model: Distances | None

    @staticmethod
    def of(log: DriveLog, settings: Settings) -> Drive:
        """Read them. Raises InputError where one is there and damaged."""
        camera = log.camera()
        model = None if camera is None else distance_models.load(settings.distance_model, camera)
        return Drive(camera, log.road_map(), log.trajectory(), model)

    def warnings(self) -> list[str]:
        """What a replay has to do without."""
        missing = (
            (self.camera, "calibration", "no distances, no landmark constraints"),
            (self.road_map, "map", "no road and no landmark constraints"),
            (self.trajectory, "reference trajectory", "no errors"),
        )
        told = [f"the log has no {what}: {without}" for found, what, without in missing if found is None]
        return told + [
            f"the map has {count} landmarks of class {name!r}, which the distance model does not know:"
            " they constrain nothing"
            for name, count in self._foreign_landmarks().items()
        ]

    def _foreign_landmarks(self) -> Counter[str]:
        """Number of the map's landmarks of each class whose distance nothing predicts."""
        if self.road_map is None or self.model is None:
            return Counter()
        known = self.model.landmark_classes
        classes = (mark.landmark_class for mark in self.road_map.landmarks)
        return Counter(name for name in classes if name not in known)


def configuration(
    log: DriveLog, drive: Drive, settings: Settings, window: Window, pace: PaceSettings
) -> dict[str, Any]:
    """What ran, on what: it stands in every output. Plain values that are valid JSON."""
    return {
        "settings": settings.as_dict(),
        "window": {
            "start_s": window.start_s,
            "stop_s": None if isinf(window.stop_s) else window.stop_s,
            "rate_hz": None if isinf(window.rate_hz) else window.rate_hz,
        },
        "pace": {"factor": None if isinf(pace.factor) else pace.factor, "late": pace.late},
        "log": log.path.name,
        "log_sha256": sha256(log.path),
        "versions": {package: version(package) for package in REPORTED_PACKAGES},
        "distance_model": dict(drive.model.metadata) if drive.model is not None else {},
    }
