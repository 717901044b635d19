"""The drive log's topics, made of a bag's while it is converted: copies, poses, calibrations of rectified images."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from scpf.ingest import messages
from scpf.ingest.bag_images import to_png
from scpf.ingest.bag_mapping import TARGETS, Rule
from scpf.ingest.bag_output import BagOutput, OutChannel
from scpf.ingest.bag_plan import Route
from scpf.ingest.bag_reference import Reference
from scpf.ingest.gps_messages import from_fix
from scpf.ingest.topics import (
    CAMERA_INFO_TOPIC,
    FRAME_METADATA,
    IMAGE_TOPIC,
    INS_ODOMETRY_TOPIC,
    INS_POSE_TOPIC,
    LATCHED_QOS,
    TF_STATIC_TOPIC,
)
from scpf.models.errors import InputError
from scpf.models.geodesy import Origin

Bytes = bytes | memoryview
ODOMETRY: Final = "nav_msgs/msg/Odometry"
POSE: Final = "geometry_msgs/msg/PoseStamped"
MAX_ATTITUDE_AGE_NS: Final = 200_000_000


class Derivation:
    """Writes what the rules of a mapping make of the messages that they take, beside the messages themselves."""

    def __init__(self, output: BagOutput, origin: Origin | None) -> None:
        self._output = output
        self._channels: dict[tuple[str, str], OutChannel] = {}
        self._given = origin is not None
        self._own_frame = self._fused = False
        self._attitude: Any = None
        """The last Imu message, where poses are made of it."""
        self._failed: dict[str, tuple[int, str]] = {}
        self._rectified = False
        self.counts: dict[str, int] = {}
        self.notes: list[str] = []
        self.losses: list[str] = []
        self.origin = origin
        self.reference = Reference(origin, self.write)

    def prepare(self, rules: Mapping[str, Rule]) -> None:
        """Say beforehand which rule takes which topic: what one means may depend on another."""
        roles = {rule.to: topic for topic, rule in rules.items()}
        # An INS that speaks plain ROS: positions of the one, attitude of the other.
        self._fused = {"fix", "imu"} <= roles.keys() and not roles.keys() & {"pose", "navigation"}
        self._rectified = any(rule.rectified for rule in rules.values()) or "/image_rect" in roles.get(
            "image", ""
        )
        # The origin of an odometry's frame is written nowhere: a guess would shift GPS against reference.
        self._own_frame = "pose" in roles
        if "gps" in roles and self._own_frame and not self._given:
            text = "where the odometry's frame begins is not known (give --origin or --map)"
            self.notes.append(f"{roles['gps']} is not mapped: {text}")

    def take(self, route: Route, rule: Rule, log_ns: int, cdr: Bytes) -> None:
        """What a rule makes of a message. What cannot be used is said once a topic."""
        try:
            self._take(route, rule, log_ns, cdr)
        except (InputError, AttributeError, TypeError, ValueError, IndexError, OverflowError) as error:
            what = f"{route.report.topic} cannot become {rule.to}"
            count, reason = self._failed.get(what, (0, str(error) or type(error).__name__))
            self._failed[what] = (count + 1, reason)

    def complete_part(self) -> None:
        """Write what is held back, and the origin, before another part of the output begins."""
        self.reference.write_pending()
        self.origin = self.origin or self.reference.origin
        if self.origin is not None:
            self._output.describe(FRAME_METADATA, frame_metadata(self.origin))

    def finish(self) -> None:
        """Write what is held back, and say what was left out."""
        self.complete_part()
        self.reference.flush()
        self.losses += [f"{what} ({count} messages): {why}" for what, (count, why) in self._failed.items()]
        self.losses += self.reference.losses
        self.notes += self.reference.notes
        self.origin = self.origin or self.reference.origin

    def write(self, topic: str, typename: str, message: Any, log_ns: int) -> None:
        """Write a message of ours."""
        self._write(topic, typename, messages.serialize(message, typename), log_ns)

    def _write(self, topic: str, typename: str, data: Bytes, log_ns: int, like: Route | None = None) -> None:
        """Write a message; one that is copied keeps the definition of its route (``like``)."""
        if like is not None and like.topic == topic:
            return  # it has this name already
        channel = self._channels.get((topic, typename))
        if channel is None:
            qos = LATCHED_QOS if topic in (TF_STATIC_TOPIC, CAMERA_INFO_TOPIC) else ""
            text = like.passage.definition if like is not None else None
            text = messages.definition(typename) if text is None else text
            metadata = (("offered_qos_profiles", qos),)
            channel = self._output.add_channel(OutChannel(topic, typename, text, metadata=metadata))
            self._channels[topic, typename] = channel
        self._output.write(channel, log_ns, data)
        self.counts[topic] = self.counts.get(topic, 0) + 1

    def _take(self, route: Route, rule: Rule, log_ns: int, cdr: Bytes) -> None:
        role, kind, store = rule.to, route.passage.type, route.passage.store
        if store is None:
            raise InputError("nothing decodes its messages")
        same = kind == "sensor_msgs/msg/CompressedImage"
        if role in ("imu", "fix", "tf_static") or (role == "image" and same):
            self._write(TARGETS[role], kind, cdr, log_ns, route)
            if not self._fused or role not in ("imu", "fix"):
                return
        message: Any = store.deserialize_cdr(cdr, kind)
        if role == "imu":
            self._attitude = message
        elif role == "fix":
            self._fused_pose(message, log_ns)
        elif role == "navigation":
            self.reference.navigation(message, rule, log_ns)
        elif role == "accuracy":
            self.reference.accuracy(message, rule, log_ns)
        elif role == "pose":
            self._pose(route, message, cdr, log_ns)
        elif role == "image":
            typename = "sensor_msgs/msg/CompressedImage"
            made = messages.make(typename, header=message.header, format="png", data=to_png(message))
            self.write(IMAGE_TOPIC, typename, made, log_ns)
        elif role == "camera_info":
            if self._rectified:
                self.write(CAMERA_INFO_TOPIC, kind, rectified(message), log_ns)
            else:
                self._write(CAMERA_INFO_TOPIC, kind, cdr, log_ns, route)
        elif role == "gps" and (self._given or not self._own_frame):
            self._begin_at(message)
            self._write(TARGETS[role], kind, cdr, log_ns, route)

    def _begin_at(self, fix: Any) -> None:
        """The first fix is the origin of a log without a reference; a reference brings its own."""
        if self.origin is None and self.reference.origin is None and fix.status.status >= 0:
            place = (float(fix.latitude), float(fix.longitude), float(fix.altitude))
            if np.isfinite(place[:2]).all() and abs(place[0]) <= 90.0 and abs(place[1]) <= 180.0:
                self.reference.origin = Origin(place[0], place[1], place[2] if np.isfinite(place[2]) else 0.0)

    def _fused_pose(self, fix: Any, log_ns: int) -> None:
        """The pose of a NavSatFix and the Imu message before it (attitude in East-North-Up: REP 103 and 145)."""
        self._begin_at(fix)
        origin = self.origin or self.reference.origin
        imu = self._attitude
        if origin is None or imu is None or fix.status.status < 0:
            return
        stamp_ns = messages.from_time(fix.header.stamp) or log_ns
        if abs(stamp_ns - (messages.from_time(imu.header.stamp) or log_ns)) > MAX_ATTITUDE_AGE_NS:
            raise InputError("no attitude of the Imu within 0.2 s")
        if imu.orientation_covariance[0] == -1.0:
            raise InputError("the Imu gives no orientation")
        if not self.reference.is_next(stamp_ns):
            return
        point = messages.make(
            "geometry_msgs/msg/Point", **dict(zip("xyz", map(float, from_fix(fix, origin)), strict=True))
        )
        messages.from_pose(point, imu.orientation)
        pose = messages.make("geometry_msgs/msg/Pose", position=point, orientation=imu.orientation)
        header = messages.to_header(stamp_ns, "map")
        self.write(INS_POSE_TOPIC, POSE, messages.make(POSE, header=header, pose=pose), log_ns)

    def _pose(self, route: Route, message: Any, cdr: Bytes, log_ns: int) -> None:
        if not self.reference.is_next(messages.from_time(message.header.stamp) or log_ns):
            return
        kind = route.passage.type
        if kind == ODOMETRY:
            self._write(INS_ODOMETRY_TOPIC, kind, cdr, log_ns, route)
        pose = message.pose if kind == POSE else message.pose.pose
        messages.from_pose(pose.position, pose.orientation)  # refuses what is no pose
        self.write(INS_POSE_TOPIC, POSE, messages.make(POSE, header=message.header, pose=pose), log_ns)


def frame_metadata(origin: Origin) -> dict[str, str]:
    """The origin of ``map`` as a drive log states it."""
    return {name: repr(float(value)) for name, value in origin._asdict().items()}


def rectified(info: Any) -> Any:
    """The CameraInfo of the rectified images: its projection matrix ``P`` is their camera, without distortion.

    InputError where ``P`` is empty: such a camera is not calibrated.
    """
    projection = np.asarray(info.p, dtype=np.float64).reshape(3, 4)
    if not projection[0, 0] > 0:
        raise InputError("the images are rectified, and the projection matrix P is empty")
    empty = np.zeros(5)
    fields = {
        name: getattr(info, name)
        for name in ("header", "height", "width", "p", "binning_x", "binning_y", "roi")
    }
    return messages.make(
        "sensor_msgs/msg/CameraInfo", distortion_model="plumb_bob", d=empty, k=projection[:, :3].ravel().copy(),
        r=np.eye(3).ravel(), **fields,
    )  # fmt: skip
