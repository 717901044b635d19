"""The drive log of a simulated drive: what its sensors said, and beside it the truth."""

from __future__ import annotations

import heapq
import json
from collections.abc import Callable, Iterator
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np

from scpf.ingest import messages
from scpf.ingest.calibration import to_yaml
from scpf.ingest.drive_log import (
    CALIBRATION_ATTACHMENT,
    MAP_ATTACHMENT,
    SCPF_METADATA,
    DriveLogWriter,
    library_name,
)
from scpf.ingest.maps import encode_map
from scpf.ingest.navigation import Navigation, make_navigation
from scpf.ingest.read_report import ReadReport
from scpf.ingest.reference import NavigationReference
from scpf.ingest.topics import TRUE_MAP_ATTACHMENT, TRUTH_POSE_TOPIC
from scpf.models.geodesy import R_ENU_NED
from scpf.sample_logs.drive_frames import SimulatedDrive
from scpf.sample_logs.finished_frames import FinishedFrame
from scpf.sample_logs.sensors import INS_RATE_HZ, GpsLog, InsLog, simulate_gps, simulate_ins

REFERENCE_RATE_HZ: Final = 50
"""Of the reference in the log: that of GSOF and $GRP."""
PROGRAMS: Final = ("scpf", "numba", "numpy", "opencv-python-headless", "scipy")
"""Those whose version the pictures and numbers depend on."""


def ins_of(drive: SimulatedDrive) -> InsLog:
    """What the INS says of a drive, at its full rate."""
    return simulate_ins(drive.vehicle, drive.road.origin, seed=drive.settings.seed)


def gps_of(drive: SimulatedDrive) -> GpsLog:
    """What the plain receiver says."""
    return simulate_gps(drive.vehicle, sigma_m=drive.settings.gps_sigma_m, seed=drive.settings.seed)


def navigation_of(ins: InsLog) -> Navigation:
    """An INS's log as the readers of real ones return it."""
    report = ReadReport("simulated INS", "simulated", records=len(ins))
    place = ins.latitude_deg, ins.longitude_deg, ins.height_m
    roll, pitch, heading = np.radians(ins.attitude_deg).T
    columns = {
        "velocity_enu_mps": ins.velocity_ned_mps @ R_ENU_NED.T,
        "roll_rad": roll,
        "pitch_rad": pitch,
        "heading_rad": heading,
        "rates_radps": np.radians(ins.rates_degps),
        "accelerations_mps2": ins.accelerations_mps2,
        "position_rms_m": ins.position_rms_m[:, [1, 0, 2]],
        "velocity_rms_mps": ins.velocity_rms_mps[:, [1, 0, 2]],
        "attitude_rms_rad": np.radians(ins.attitude_rms_deg),
    }
    return make_navigation(report, ins.stamps_ns, place, {}, columns)


def write_log(
    output: Path,
    drive: SimulatedDrive,
    ins: InsLog,
    frames: Iterator[FinishedFrame],
    *,
    overwrite: bool = False,
) -> int:
    """Write the drive log of a drive whose ``frames`` are rendered; returns how many poles its pictures show.

    The reference is ``ins``, each pose with the variance that it states; the truth stands in topics of its own.
    """
    vehicle, road = drive.vehicle, drive.road
    gps = gps_of(drive)
    reference = NavigationReference(navigation_of(ins.at_rate(REFERENCE_RATE_HZ)), road.origin)
    shown = 0

    def write_frame(log: DriveLogWriter, index: int) -> None:
        nonlocal shown
        stamp_ns, frame = int(vehicle.stamps_ns[index]), next(frames)
        shown += len(frame.poles)
        log.write_gps(stamp_ns, gps.positions_m[index], gps.variance_m2)
        pose = messages.make(
            "geometry_msgs/msg/PoseStamped",
            header=messages.to_header(stamp_ns, "map"),
            pose=messages.to_pose(vehicle.T_map_body[index]),
        )
        log.write_message(TRUTH_POSE_TOPIC, "geometry_msgs/msg/PoseStamped", pose, stamp_ns)
        log.write_instances(
            stamp_ns,
            [pole.instance for pole in frame.poles],
            [pole.distance_m for pole in frame.poles],
            [pole.visible_fraction for pole in frame.poles],
        )
        log.write_image(stamp_ns, frame.jpeg, "jpeg")

    with DriveLogWriter(output, overwrite=overwrite, origin=road.origin, live=False) as log:
        log.attach(CALIBRATION_ATTACHMENT, "application/yaml", to_yaml(drive.camera))
        log.attach(MAP_ATTACHMENT, "application/geo+json", encode_map(road.mapped()))
        log.attach(TRUE_MAP_ATTACHMENT, "application/geo+json", encode_map(road.true()))
        log.metadata(SCPF_METADATA, _about(drive))
        log.write_camera(int(vehicle.stamps_ns[0]), drive.camera)
        beside = reference.writes(log, int(ins.stamps_ns[0]), int(ins.stamps_ns[-1]))
        for _, write in heapq.merge(beside, _frames(log, drive, write_frame), key=lambda event: event[0]):
            write()
    return shown


def _frames(
    log: DriveLogWriter, drive: SimulatedDrive, write: Callable[[DriveLogWriter, int], None]
) -> Iterator[tuple[int, Callable[[], None]]]:
    for index, stamp_ns in enumerate(drive.vehicle.stamps_ns.tolist()):
        yield stamp_ns, partial(write, log, index)


def versions() -> dict[str, str]:
    """Of the programs that the pictures depend on."""
    return {name: version(name) for name in PROGRAMS}


def _about(drive: SimulatedDrive) -> dict[str, str]:
    """The metadata record: how the drive was made, and which frames never arrived."""
    values: dict[str, Any] = {
        "made_by": library_name(),
        "made_from": "simulated",
        "settings": drive.settings.as_dict(),
        "weather": drive.weather.name,
        "map": drive.road.attribution,
        "map_variance_m2": drive.road.mapped_variance_m2,
        "ins_rate_hz": INS_RATE_HZ,
        "versions": versions(),
        "dropped_frames": drive.vehicle.dropped_numbers.tolist(),
    }
    return {name: value if isinstance(value, str) else json.dumps(value) for name, value in values.items()}
