"""Reading a drive log: messages in order, and the records that a replay asks for."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest import messages
from scpf.ingest.decoding import Decoder
from scpf.ingest.gps_messages import from_gps_fix, from_gps_pose
from scpf.ingest.latched import is_latched, latest
from scpf.ingest.log_messages import ChannelInfo, EncodedImage, Message
from scpf.ingest.mcap_files import read_attachment, read_metadata
from scpf.ingest.mcap_index import Channel
from scpf.ingest.mcap_read import McapFile
from scpf.ingest.topics import (
    CAMERA_INFO_TOPIC,
    FRAME_METADATA,
    GPS_FIX_TOPIC,
    GPS_POSE_TOPIC,
    IMAGE_TOPIC,
    INS_ODOMETRY_TOPIC,
    INS_POSE_TOPIC,
    INSTANCES_TOPIC,
    MAP_ATTACHMENT,
    TF_STATIC_TOPIC,
)
from scpf.models.camera import Camera
from scpf.models.errors import DamagedError, InputError
from scpf.models.geodesy import Origin
from scpf.models.instances import Instance
from scpf.models.road_map import RoadMap, from_geojson
from scpf.models.trajectory import Trajectory, from_poses

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

MAX_TREE_DEPTH: Final = 64


class DriveLog:
    """A drive log, opened for reading; a context manager.

    Raises DamagedError, with file and place, for a file that is not a whole, indexed MCAP file, and while
    reading for a chunk, message or attachment that fails a check.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self._mcap = McapFile(self.path)
        self._decoder = Decoder(self.path)
        counts = self._mcap.counts()
        self.channels: dict[str, ChannelInfo] = {}
        for channel in self._mcap.index.channels.values():
            known = self.channels.get(channel.topic)
            type_name = channel.schema.name if channel.schema else ""
            count = counts.get(channel.id, 0) + (known.count if known else 0)
            if known and known.type != type_name:
                type_name = f"{known.type}, {type_name}"
            self.channels[channel.topic] = ChannelInfo(type_name, channel.encoding, count)
        self.start_ns, self.end_ns = self._mcap.index.span_ns or (0, 0)

    def __enter__(self) -> DriveLog:
        return self

    def __exit__(self, *details: object) -> None:
        self._mcap.__exit__(*details)

    @property
    def mcap_channels(self) -> list[Channel]:
        """The channels as stored, with their schemas."""
        return list(self._mcap.index.channels.values())

    def count(self, topic: str) -> int:
        """Messages of a topic; 0 for one that the log does not have."""
        info = self.channels.get(topic)
        return info.count if info else 0

    @property
    def profile(self) -> str:
        """The profile that the file states, such as ``ros2``."""
        return self._mcap.index.profile

    @property
    def library(self) -> str:
        """What wrote the file, in its own words."""
        return self._mcap.index.library

    def attachments(self) -> dict[str, bytes]:
        """Attached files by name, checksums checked; of two with one name, the one written last."""
        return {entry.name: read_attachment(self._mcap, entry) for entry in self._mcap.index.attachments}

    def metadata(self) -> dict[str, dict[str, str]]:
        """Metadata records by name; of two with one name, the one written last."""
        return dict(read_metadata(self._mcap, *place) for place in self._mcap.index.metadata)

    def messages(
        self,
        topics: Collection[str] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
        *,
        latched: bool = False,
    ) -> Iterator[Message]:
        """Messages of ``topics`` (None: all), start ≤ log time < end, by log time, then place in the file.

        ``latched``: those of latched topics that still hold at the start come first, with their own, earlier times,
        as a subscriber that joins late gets them.
        """
        wanted = None if topics is None else {topics} if isinstance(topics, str) else set(topics)
        if latched and start_ns is not None:
            held = {channel.topic for channel in self.mcap_channels if is_latched(channel)}
            held = held if wanted is None else held & wanted
            before = self._mcap.messages(held, None, start_ns)
            yield from latest(Message(record, self._decoder) for record in before)
        for record in self._mcap.messages(wanted, start_ns, end_ns):
            yield Message(record, self._decoder)

    def images(
        self, start_ns: int | None = None, end_ns: int | None = None, topic: str = IMAGE_TOPIC
    ) -> Iterator[EncodedImage]:
        """The encoded images, in order; the payload is a view of the chunk, valid as long as it is kept."""
        for record in self.messages([topic], start_ns, end_ns):
            with self._reading(record) as image:
                shown = EncodedImage(record.sensor_ns, memoryview(image.data), str(image.format))
            yield shown

    def camera(self) -> Camera | None:
        """The camera of the first CameraInfo, mounted as /tf_static says; None without a usable one.

        Without a transform from ``base_link`` it is taken to look ahead from the body's origin.
        """
        for record in self.messages([CAMERA_INFO_TOPIC]):
            with self._reading(record) as info:
                if info.k[0] > 0:  # ROS: a matrix of zeros means "not calibrated"
                    return messages.from_camera_info(info, self._mount(info.header.frame_id))
        return None

    def trajectory(self) -> Trajectory | None:
        """The reference trajectory, from ``/ins/pose``, else ``/ins/odometry``, by sensor time."""
        for topic in (INS_POSE_TOPIC, INS_ODOMETRY_TOPIC):
            if not self.count(topic):
                continue
            poses: dict[int, Array] = {}
            for record in self.messages([topic]):
                if record.sensor_ns in poses:
                    raise InputError(f"{self.path}: {topic} holds two poses at {record.sensor_ns} ns")
                with self._reading(record) as message:
                    pose = getattr(message.pose, "pose", message.pose)
                    poses[record.sensor_ns] = messages.from_pose(pose.position, pose.orientation)
            stamps = np.array(sorted(poses), dtype=np.int64)
            return from_poses(stamps, np.array([poses[int(stamp)] for stamp in stamps]))
        return None

    def gps(self) -> tuple[Stamps, Array, Array] | None:
        """Rough GPS: stamps (N,), positions (N, 2) in ``map``, variances (N,) in m²; None without one.

        Latitudes and longitudes need the origin of ``map``: InputError without one. A variance that the log
        does not know is NaN. Fixes that state "no fix" are left out.
        """
        geodetic = self.count(GPS_FIX_TOPIC) > 0
        topic = GPS_FIX_TOPIC if geodetic else GPS_POSE_TOPIC
        origin = self.origin() if geodetic else None
        if geodetic and origin is None:
            hint = "attach a georeferenced map (map.geojson) to the log"
            raise InputError(f"{self.path}: {topic} needs the origin of the map frame", hint)
        stamps, rows = [], []
        for record in self.messages([topic]):
            with self._reading(record) as message:
                row = from_gps_pose(message) if origin is None else from_gps_fix(message, origin)
            if row is not None:
                stamps.append(record.sensor_ns)
                rows.append(row)
        if not rows:
            return None
        table = np.array(rows)
        return np.array(stamps, dtype=np.int64), table[:, :2], table[:, 2]

    def road_map(self) -> RoadMap | None:
        """The attached map, ``map.geojson``; None without one."""
        data = self.attachments().get(MAP_ATTACHMENT)
        if data is None:
            return None
        place = f"{self.path}: {MAP_ATTACHMENT}"
        try:
            document = json.loads(data)
        except (ValueError, RecursionError) as error:
            raise DamagedError(f"{place} is not JSON ({error})") from error
        return from_geojson(document, place)

    def origin(self) -> Origin | None:
        """The origin of ``map``, as the log states it, else as its map does; None where neither does."""
        stated = self.metadata().get(FRAME_METADATA)
        if stated is not None:
            try:
                return Origin(*(float(stated[name]) for name in Origin._fields))
            except (KeyError, ValueError) as error:
                raise DamagedError(
                    f"{self.path}: metadata {FRAME_METADATA} cannot be read ({error})"
                ) from error
        road_map = self.road_map()
        return road_map.origin if road_map is not None else None

    def instances(self, topic: str = INSTANCES_TOPIC) -> dict[int, list[Instance]]:
        """The instances of each image, by its stamp (ns)."""
        found: dict[int, list[Instance]] = {}
        for record in self.messages([topic]):
            with self._reading(record) as message:
                found[record.sensor_ns] = [messages.from_instance(item) for item in message.instances]
        return found

    def _mount(self, frame: str) -> Array | None:
        """``T_body_camera`` (4, 4) of a frame, through the static transforms; None where none leads there."""
        parents: dict[str, tuple[str, Any]] = {}
        for record in self.messages([TF_STATIC_TOPIC]):
            with self._reading(record) as message:
                tree = message.transforms
            for item in tree:
                parents[item.child_frame_id.lstrip("/")] = (item.header.frame_id.lstrip("/"), item.transform)
        chain, name = np.eye(4), frame.lstrip("/")
        for _ in range(MAX_TREE_DEPTH):  # a tree of transforms that loops is not worth another check
            if name == "base_link":
                return chain
            if name not in parents:
                return None
            name, transform = parents[name]
            chain = messages.from_pose(transform.translation, transform.rotation) @ chain
        return None

    @contextmanager
    def _reading(self, record: Message) -> Iterator[Any]:
        """The decoded message; what its fields do not allow becomes a DamagedError that names the message."""
        try:
            yield record.message
        except (AttributeError, TypeError, ValueError, IndexError, OverflowError) as error:
            kind = self.channels[record.topic].type
            text = f"{self.path}: {record.topic} at {record.stamp_ns} ns, a {kind}: {error}"
            raise DamagedError(text, "is this the type that the topic should have?") from error
