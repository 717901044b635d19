"""ROS 1 bags as tests need them: sound, not closed, cut, and those of a WATonoBus drive."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

T0 = 1_600_000_000_000_000_000
STEP_NS = 76_923_077
LLA = "float64 latitude\nfloat64 longitude\nfloat64 altitude\n"
NED = "float32 north\nfloat32 east\nfloat32 down\n"
NAVIGATION = """\
std_msgs/Header header
applanix_msgs/GpsTimeGsof gps_time
applanix_msgs/StatusGsof status
applanix_msgs/LLA lla
applanix_msgs/NED velocity
float32 total_speed
float64 roll
float64 pitch
float64 heading
float64 track_angle
float32 ang_rate_long
float32 ang_rate_trans
float32 ang_rate_down
float32 acc_long
float32 acc_trans
float32 acc_down
"""
PERFORMANCE = """\
std_msgs/Header header
applanix_msgs/GpsTimeGsof gps_time
applanix_msgs/StatusGsof status
applanix_msgs/NED pos_rms_error
applanix_msgs/NED vel_rms_error
float32 attitude_rms_error_roll
float32 attitude_rms_error_pitch
float32 attitude_rms_error_heading
"""
NAVIGATION_TYPE = "applanix_msgs/msg/NavigationSolutionGsof49"
PERFORMANCE_TYPE = "applanix_msgs/msg/NavigationPerformanceGsof50"


def applanix_store(base: Stores) -> Any:
    """A type store that knows the messages of the Applanix driver (layout of autowarefoundation/applanix)."""
    store = get_typestore(base)
    types: dict[str, Any] = {}
    for name, text in {
        "applanix_msgs/msg/LLA": LLA,
        "applanix_msgs/msg/NED": NED,
        "applanix_msgs/msg/GpsTimeGsof": "uint16 week\nuint32 time\n",
        "applanix_msgs/msg/StatusGsof": "uint8 imu_alignment\nuint8 gnss\n",
        NAVIGATION_TYPE: NAVIGATION,
        PERFORMANCE_TYPE: PERFORMANCE,
    }.items():
        types.update(get_types_from_msg(text, name))
    store.register(types)
    return store


def header(store: Any, stamp_ns: int, frame: str = "cam", seq: int = 0) -> Any:
    """A Header of ROS 1 or ROS 2."""
    stamp = store.types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    extra = {"seq": seq} if "seq" in dict(store.fielddefs["std_msgs/msg/Header"][1]) else {}
    return store.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **extra)


def navigation(store: Any, stamp_ns: int, k: int, heading_deg: float = 30.0) -> Any:
    """Record 49 of a drive that goes straight on with ``heading_deg``, 10 m/s, from 43.47° N 80.54° W."""
    distance = 10.0 * k * STEP_NS * 1e-9
    north, east = distance * np.cos(np.radians(heading_deg)), distance * np.sin(np.radians(heading_deg))
    make = store.types
    return make[NAVIGATION_TYPE](
        header=header(store, stamp_ns, "ins"),
        gps_time=make["applanix_msgs/msg/GpsTimeGsof"](week=2121, time=302_400_000 + 1000 * k),
        status=make["applanix_msgs/msg/StatusGsof"](imu_alignment=4, gnss=4),
        lla=make["applanix_msgs/msg/LLA"](43.47 + north / 111_110.0, -80.54 + east / 80_800.0, 330.0),
        velocity=make["applanix_msgs/msg/NED"](8.66, 5.0, 0.0),
        total_speed=10.0, roll=1.0, pitch=-2.0, heading=heading_deg, track_angle=heading_deg, ang_rate_long=1.0,
        ang_rate_trans=2.0, ang_rate_down=3.0, acc_long=0.1, acc_trans=0.2, acc_down=0.3,
    )  # fmt: skip


def performance(store: Any, stamp_ns: int) -> Any:
    """Record 50: 0.1 m north, 0.2 m east, 0.3 m down."""
    make = store.types
    return make[PERFORMANCE_TYPE](
        header=header(store, stamp_ns, "ins"),
        gps_time=make["applanix_msgs/msg/GpsTimeGsof"](week=2121, time=302_400_000),
        status=make["applanix_msgs/msg/StatusGsof"](imu_alignment=4, gnss=4),
        pos_rms_error=make["applanix_msgs/msg/NED"](0.1, 0.2, 0.3),
        vel_rms_error=make["applanix_msgs/msg/NED"](0.1, 0.2, 0.3),
        attitude_rms_error_roll=0.1, attitude_rms_error_pitch=0.1, attitude_rms_error_heading=0.2,
    )  # fmt: skip


def camera_info(store: Any, stamp_ns: int) -> Any:
    """A calibration with distortion, whose projection matrix is that of the rectified images."""
    roi = store.types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    raw = np.array([700.0, 0, 16, 0, 701, 12, 0, 0, 1])
    projection = np.array([650.0, 0, 15, 0, 0, 651, 11, 0, 0, 0, 1, 0])
    return store.types["sensor_msgs/msg/CameraInfo"](
        header(store, stamp_ns), 24, 32, "plumb_bob", np.array([-0.3, 0.1, 0.0, 0.0, 0.0]), raw, np.eye(3).ravel(),
        projection, 0, 0, roi,
    )  # fmt: skip


def jpeg(value: int) -> Any:
    """The bytes of a small picture."""
    import cv2

    return cv2.imencode(".jpg", np.full((24, 32, 3), value % 256, dtype=np.uint8))[1]


def watonobus_bag(path: Path, frames: int = 20) -> Path:
    """A ROS 1 bag with the topics of a WATonoBus drive: GSOF 49 at each frame, 50 and calibration at each tenth."""
    store = applanix_store(Stores.ROS1_NOETIC)
    with Writer(path) as bag:
        topics = {
            "image": ("/pylon_camera_node_center/image_rect/compressed", "sensor_msgs/msg/CompressedImage"),
            "info": ("/pylon_camera_node_center/camera_info", "sensor_msgs/msg/CameraInfo"),
            "49": ("/lvx_client_node/gsof/49", NAVIGATION_TYPE),
            "50": ("/lvx_client_node/gsof/50", PERFORMANCE_TYPE),
        }
        channels = {name: bag.add_connection(*topic, typestore=store) for name, topic in topics.items()}

        def write(name: str, stamp_ns: int, message: Any) -> None:
            bag.write(channels[name], stamp_ns, store.serialize_ros1(message, channels[name].msgtype))

        for k in range(frames):
            stamp_ns = T0 + k * STEP_NS
            picture = store.types["sensor_msgs/msg/CompressedImage"](
                header(store, stamp_ns, seq=k), "jpeg", jpeg(10 * k)
            )
            if k % 10 == 0:
                write("50", stamp_ns, performance(store, stamp_ns))
                write("info", stamp_ns, camera_info(store, stamp_ns))
            write("49", stamp_ns, navigation(store, stamp_ns, k))
            write("image", stamp_ns, picture)
    return path


def numbers_bag(path: Path, count: int = 200, compression: str = "none", chunk_bytes: int = 2000) -> Path:
    """A bag of two topics, ``/text`` and ``/number``, in chunks of ``chunk_bytes``, written record by record."""
    import bz2

    import lz4.frame

    store = get_typestore(Stores.ROS1_NOETIC)
    packers = {"none": bytes, "bz2": bz2.compress, "lz4": lz4.frame.compress}
    types = {0: ("/text", "std_msgs/String"), 1: ("/number", "std_msgs/Int32")}
    connections = {}
    for key, (topic, kind) in types.items():
        text, md5 = store.generate_msgdef(kind.replace("/", "/msg/"), ros_version=1)
        inner = fields(
            topic=topic.encode(), type=kind.encode(), md5sum=md5.encode(), message_definition=text.encode()
        )
        connections[key] = record(fields(op=b"\7", conn=struct.pack("<I", key), topic=topic.encode()), inner)
    out = bytearray(b"#ROSBAG V2.0\n" + bytes(4117 - 13))
    chunks: list[tuple[int, dict[int, list[tuple[int, int]]]]] = []
    body, index, seen = bytearray(), {}, set()

    def end_chunk() -> None:
        nonlocal body, index
        place = len(out)
        head = fields(compression=compression.encode(), op=b"\5", size=struct.pack("<I", len(body)))
        out.extend(record(head, packers[compression](bytes(body))))
        for key, places in index.items():
            head = fields(
                op=b"\4",
                ver=struct.pack("<I", 1),
                conn=struct.pack("<I", key),
                count=struct.pack("<I", len(places)),
            )
            out.extend(
                record(head, b"".join(time(stamp) + struct.pack("<I", offset) for stamp, offset in places))
            )
        chunks.append((place, index))
        body, index = bytearray(), {}

    for k in range(count):
        for key in types:
            stamp = T0 + k // 2 * 1000  # every second one shares its time
            data = struct.pack("<I", 5) + f"{k:05d}".encode() if key == 0 else struct.pack("<i", k)
            if key not in seen:
                body += connections[key]
                seen.add(key)
            index.setdefault(key, []).append((stamp, len(body)))
            body += record(fields(conn=struct.pack("<I", key), op=b"\2", time=time(stamp)), data)
        if len(body) >= chunk_bytes:
            end_chunk()
    if body:
        end_chunk()
    position = len(out)
    for connection in connections.values():
        out += connection
    for place, entries in chunks:
        stamps = [stamp for places in entries.values() for stamp, _ in places]
        head = fields(
            op=b"\6", ver=struct.pack("<I", 1), chunk_pos=struct.pack("<Q", place), start_time=time(min(stamps)),
            end_time=time(max(stamps)), count=struct.pack("<I", len(entries)),
        )  # fmt: skip
        out += record(head, b"".join(struct.pack("<II", key, len(places)) for key, places in entries.items()))
    out[13:4117] = bag_header(position, len(connections), len(chunks))
    path.write_bytes(bytes(out))
    return path


def bag_header(index_position: int, connections: int, chunks: int) -> bytes:
    """The bag header record, padded to its 4096 bytes and its two lengths."""
    head = fields(
        op=b"\3", index_pos=struct.pack("<Q", index_position), conn_count=struct.pack("<I", connections),
        chunk_count=struct.pack("<I", chunks),
    )  # fmt: skip
    return record(head, b" " * (4096 - len(head)))


def fields(**values: bytes) -> bytes:
    """Header fields."""
    return b"".join(struct.pack("<I", len(n) + 1 + len(v)) + n.encode() + b"=" + v for n, v in values.items())


def record(head: bytes, data: bytes) -> bytes:
    """A record."""
    return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data


def time(stamp_ns: int) -> bytes:
    """A time of ROS 1."""
    return struct.pack("<II", stamp_ns // 10**9, stamp_ns % 10**9)
