"""The drive log: one MCAP file with the camera, the reference trajectory, the rough GPS and what they need.

``DriveLogWriter`` writes one, ``DriveLog`` reads one. Times are sensor times (UTC, ns); frames are ``map``
(East-North-Up), ``base_link`` (x forward, y left, z up) and ``camera`` (optical).
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from scpf.ingest import messages
from scpf.ingest.drive_log_reader import DriveLog
from scpf.ingest.gps_messages import to_fix
from scpf.ingest.log_messages import ChannelInfo, EncodedImage, Message
from scpf.ingest.mcap_write import McapWriter
from scpf.ingest.topics import (
    CALIBRATION_ATTACHMENT,
    CAMERA_INFO_TOPIC,
    FRAME_METADATA,
    GPS_FIX_TOPIC,
    GPS_POSE_TOPIC,
    IMAGE_TOPIC,
    IMAGE_TYPES,
    INS_FIX_TOPIC,
    INS_ODOMETRY_TOPIC,
    INS_POSE_TOPIC,
    INSTANCES_TOPIC,
    LATCHED_QOS,
    MAP_ATTACHMENT,
    SCPF_METADATA,
    TF_STATIC_TOPIC,
)
from scpf.models.camera import Camera
from scpf.models.errors import InputError
from scpf.models.geodesy import Origin
from scpf.models.instances import Instance

Array = NDArray[np.float64]


def library_name() -> str:
    """What the header of a log names as its maker."""
    from importlib.metadata import version

    return f"scpf {version('scpf')}"


class DriveLogWriter:
    """Writes a drive log. A context manager: ``PATH.partial`` becomes ``PATH`` when the block ends well.

    With an ``origin``, positions are also written as latitude and longitude. ``live``: see ``McapWriter``; False for
    logs that shall have the same bytes whenever they are made. After an error, or an interrupt,
    the ``.partial`` stays, closed as well as it can be; a later run replaces it.
    """

    def __init__(
        self, path: Path, *, overwrite: bool = False, origin: Origin | None = None, live: bool = True
    ) -> None:
        self.path = Path(path)
        self._live = live
        self.partial_path = self.path.with_name(self.path.name + ".partial")
        self.origin = origin
        if self.path.exists() and not overwrite:
            raise InputError(f"{self.path} exists", "choose another name, or give --overwrite")
        self._channels: dict[tuple[str, str], int] = {}
        self._sequences: dict[str, int] = {}
        self._file: BinaryIO | None = None
        self._mcap: McapWriter | None = None

    def __enter__(self) -> DriveLogWriter:
        try:
            self._file = self.partial_path.open("wb")
        except OSError as error:
            hint = "does its folder exist, and may you write there?"
            raise InputError(f"{self.partial_path} cannot be written ({error.strerror})", hint) from error
        self._mcap = McapWriter(self._file, library_name(), live=self._live)
        if self.origin is not None:
            self.metadata(
                FRAME_METADATA, {name: repr(value) for name, value in self.origin._asdict().items()}
            )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._file is not None
        with self._file:
            if kind is not None:
                with contextlib.suppress(Exception):  # the error on its way says more than a second one
                    self.mcap.finish()
                return
            self.mcap.finish()
            os.fsync(self._file.fileno())
        self.partial_path.replace(self.path)

    @property
    def mcap(self) -> McapWriter:
        """The file underneath, open only inside the ``with`` block."""
        if self._mcap is None:
            raise RuntimeError("a DriveLogWriter writes inside its with block only")
        return self._mcap

    def write_image(self, stamp_ns: int, data: bytes | memoryview, format: str) -> None:
        """Write an encoded image; ``format`` is ``jpeg`` or ``png``, the bytes are stored untouched."""
        pixels = np.frombuffer(data, dtype=np.uint8)
        header = messages.to_header(stamp_ns, "camera")
        image = messages.make("sensor_msgs/msg/CompressedImage", header=header, format=format, data=pixels)
        self.write_message(IMAGE_TOPIC, "sensor_msgs/msg/CompressedImage", image, stamp_ns)

    def write_camera(self, stamp_ns: int, camera: Camera) -> None:
        """Write the calibration (CameraInfo) and where the camera sits (``base_link`` → ``camera``)."""
        info = messages.to_camera_info(stamp_ns, camera)
        self.write_message(CAMERA_INFO_TOPIC, "sensor_msgs/msg/CameraInfo", info, stamp_ns)
        mount = messages.make(
            "geometry_msgs/msg/TransformStamped",
            header=messages.to_header(stamp_ns, "base_link"),
            child_frame_id="camera",
            transform=messages.to_transform(camera.T_body_camera),
        )
        tree = messages.make("tf2_msgs/msg/TFMessage", transforms=[mount])
        self.write_message(TF_STATIC_TOPIC, "tf2_msgs/msg/TFMessage", tree, stamp_ns)

    def write_pose(
        self, stamp_ns: int, T_map_body: Array, position_variance_m2: float | Array | None = None
    ) -> None:
        """Write a reference pose (4, 4); the variance is one number, or (3,) east, north, up."""
        variance = (
            None if position_variance_m2 is None else np.broadcast_to(position_variance_m2, 3).astype(float)
        )
        header, pose = messages.to_header(stamp_ns, "map"), messages.to_pose(T_map_body)
        stamped = messages.make("geometry_msgs/msg/PoseStamped", header=header, pose=pose)
        self.write_message(INS_POSE_TOPIC, "geometry_msgs/msg/PoseStamped", stamped, stamp_ns)
        odometry = messages.to_odometry(stamp_ns, T_map_body, variance)
        self.write_message(INS_ODOMETRY_TOPIC, "nav_msgs/msg/Odometry", odometry, stamp_ns)
        if self.origin is not None:
            fix = to_fix(stamp_ns, T_map_body[:3, 3], variance, self.origin, "base_link")
            self.write_message(INS_FIX_TOPIC, "sensor_msgs/msg/NavSatFix", fix, stamp_ns)

    def write_gps(self, stamp_ns: int, position_m: Array, variance_m2: float) -> None:
        """Write a rough GPS position (2,) in ``map``: a NavSatFix, or without an origin ``/gps/pose``."""
        position = np.array([float(position_m[0]), float(position_m[1]), 0.0])
        if self.origin is not None:
            # Nothing is known about the height: it counts with the variance of a plain receiver's.
            variance = np.array([variance_m2, variance_m2, max(100.0, 4.0 * variance_m2)])
            fix = to_fix(stamp_ns, position, variance, self.origin, "gps")
            self.write_message(GPS_FIX_TOPIC, "sensor_msgs/msg/NavSatFix", fix, stamp_ns)
            return
        pose = np.eye(4)
        pose[:3, 3] = position
        covariance = np.zeros(36)
        covariance[[0, 7]] = variance_m2
        with_covariance = messages.make(
            "geometry_msgs/msg/PoseWithCovariance", pose=messages.to_pose(pose), covariance=covariance
        )
        typename = "geometry_msgs/msg/PoseWithCovarianceStamped"
        message = messages.make(typename, header=messages.to_header(stamp_ns, "map"), pose=with_covariance)
        self.write_message(GPS_POSE_TOPIC, typename, message, stamp_ns)

    def write_instances(
        self,
        stamp_ns: int,
        instances: Sequence[Instance],
        distances_m: Sequence[float] | None = None,
        visible_fractions: Sequence[float] | None = None,
        topic: str = INSTANCES_TOPIC,
    ) -> None:
        """Write the instances of the image at ``stamp_ns``, also where there are none."""
        message = messages.to_instances(stamp_ns, instances, distances_m, visible_fractions)
        self.write_message(topic, "scpf_msgs/msg/Instances", message, stamp_ns)

    def write_message(self, topic: str, typename: str, message: Any, stamp_ns: int) -> None:
        """Write any message of a type of the type store, such as ``sensor_msgs/msg/Imu``."""
        channel = self._channels.get((topic, typename))
        if channel is None:
            stream = "image" if typename in IMAGE_TYPES else "small"
            qos = LATCHED_QOS if topic in (TF_STATIC_TOPIC, CAMERA_INFO_TOPIC) else ""
            text = messages.definition(typename)
            channel = self.mcap.add_channel(
                topic, typename, text, stream=stream, metadata={"offered_qos_profiles": qos}
            )
            self._channels[topic, typename] = channel
        sequence = self._sequences.get(topic, 0)
        self._sequences[topic] = sequence + 1
        self.mcap.add_message(channel, stamp_ns, messages.serialize(message, typename), stamp_ns, sequence)

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Attach a file, such as ``map.geojson``."""
        self.mcap.add_attachment(name, media_type, data)

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record."""
        self.mcap.add_metadata(name, values)


__all__ = [
    "CALIBRATION_ATTACHMENT",
    "CAMERA_INFO_TOPIC",
    "FRAME_METADATA",
    "GPS_FIX_TOPIC",
    "GPS_POSE_TOPIC",
    "IMAGE_TOPIC",
    "INSTANCES_TOPIC",
    "INS_FIX_TOPIC",
    "INS_ODOMETRY_TOPIC",
    "INS_POSE_TOPIC",
    "MAP_ATTACHMENT",
    "SCPF_METADATA",
    "TF_STATIC_TOPIC",
    "ChannelInfo",
    "DriveLog",
    "DriveLogWriter",
    "EncodedImage",
    "Message",
    "library_name",
]
