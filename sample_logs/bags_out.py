"""A simulated drive as a ROS 1 bag or a rosbag2, with the topics of a WATonoBus recording."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from scpf.models.camera import Camera
from scpf.models.errors import InputError
from scpf.sample_logs.raw_camera import RecordedPicture
from scpf.sample_logs.ros_messages import ACCURACY, CAMERA_INFO, IMAGE, MOUNT, NAVIGATION, RosMessages
from scpf.sample_logs.sensors import InsLog

NAVIGATION_TOPIC, ACCURACY_TOPIC = "/lvx_client_node/gsof/49", "/lvx_client_node/gsof/50"
IMAGE_TOPIC = "/pylon_camera_node_center/image_rect/compressed"
CAMERA_INFO_TOPIC, MOUNT_TOPIC = "/pylon_camera_node_center/camera_info", "/tf_static"
TOPICS = {
    MOUNT_TOPIC: MOUNT,
    ACCURACY_TOPIC: ACCURACY,
    NAVIGATION_TOPIC: NAVIGATION,
    CAMERA_INFO_TOPIC: CAMERA_INFO,
    IMAGE_TOPIC: IMAGE,
}
INS_RATE_HZ = 50
INS_DELAY_NS, PICTURE_DELAY_NS = 4_000_000, 38_000_000
"""From the moment that a message is about until it is recorded."""


class _Out(NamedTuple):
    recorded_ns: int
    topic: str
    make: Callable[[], Any]


def write_ros1_bag(path: Path, ins: InsLog, pictures: Iterable[RecordedPicture], camera: Camera) -> None:
    """Write a ROS 1 bag: GSOF 49 at 50 Hz and 50 once a second, each picture with its calibration, the camera's mount.

    ``pictures`` come in order, and are rectified, as their topic says. Raises InputError for an existing file, and for
    a camera with distortion.
    """
    from rosbags.rosbag1 import Writer

    _check(path, camera)
    messages = RosMessages(1)
    with Writer(path) as bag:
        connections = {
            topic: bag.add_connection(
                topic, kind, typestore=messages.store, latching=int(topic == MOUNT_TOPIC)
            )
            for topic, kind in TOPICS.items()
        }
        for out in _all(messages, ins, pictures, camera):
            data = messages.serialized(out.make(), TOPICS[out.topic])
            bag.write(connections[out.topic], out.recorded_ns, data)


def write_rosbag2(path: Path, ins: InsLog, pictures: Iterable[RecordedPicture], camera: Camera) -> None:
    """Write a rosbag2, a folder with an SQLite file, with the same messages as ``write_ros1_bag``."""
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
    from rosbags.rosbag2 import StoragePlugin, Writer

    _check(path, camera)
    messages, unlimited = RosMessages(2), QosTime(2147483647, 4294967295)
    latched = Qos(
        QosHistory.KEEP_LAST,
        1,
        QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL,
        unlimited,
        unlimited,
        QosLiveliness.AUTOMATIC,
        unlimited,
        False,
    )
    with Writer(path, version=8, storage_plugin=StoragePlugin.SQLITE3) as bag:
        connections = {
            topic: bag.add_connection(
                topic,
                kind,
                typestore=messages.store,
                offered_qos_profiles=[latched] if topic == MOUNT_TOPIC else [],
            )
            for topic, kind in TOPICS.items()
        }
        for out in _all(messages, ins, pictures, camera):
            data = messages.serialized(out.make(), TOPICS[out.topic])
            bag.write(connections[out.topic], out.recorded_ns, data)


def _check(path: Path, camera: Camera) -> None:
    if path.exists():
        raise InputError(f"{path} exists", "choose another name, or remove it")
    if np.any(camera.distortion):
        hint = "rectify them first: scpf.sample_logs.rectify"
        raise InputError(f"{IMAGE_TOPIC} is for rectified pictures, and the camera has distortion", hint)


def _all(
    messages: RosMessages, ins: InsLog, pictures: Iterable[RecordedPicture], camera: Camera
) -> Iterator[_Out]:
    """All messages in the order in which a recorder gets them."""
    ins = ins.at_rate(INS_RATE_HZ)
    first_ns = int(ins.stamps_ns[0])
    yield _Out(first_ns, MOUNT_TOPIC, lambda: messages.mount(first_ns, camera))
    yield from heapq.merge(
        _of_ins(messages, ins), _of_camera(messages, pictures, camera), key=lambda out: out.recorded_ns
    )


def _of_ins(messages: RosMessages, ins: InsLog) -> Iterator[_Out]:
    for k, stamp in enumerate(ins.stamps_ns):
        recorded_ns = int(stamp) + INS_DELAY_NS
        if k == 0 or stamp % 10**9 == 0:
            yield _Out(recorded_ns, ACCURACY_TOPIC, lambda k=k: messages.accuracy(ins, k))  # type: ignore[misc]
        yield _Out(recorded_ns, NAVIGATION_TOPIC, lambda k=k: messages.navigation(ins, k))  # type: ignore[misc]


def _of_camera(messages: RosMessages, pictures: Iterable[RecordedPicture], camera: Camera) -> Iterator[_Out]:
    for picture in pictures:
        recorded_ns, stamp_ns = picture.stamp_ns + PICTURE_DELAY_NS, picture.stamp_ns
        yield _Out(
            recorded_ns,
            CAMERA_INFO_TOPIC,
            lambda stamp_ns=stamp_ns: messages.camera_info(stamp_ns, camera),  # type: ignore[misc]
        )
        yield _Out(recorded_ns, IMAGE_TOPIC, lambda picture=picture: messages.image(picture))  # type: ignore[misc]
