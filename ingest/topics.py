"""The names of the drive log: topics, attachments, metadata."""

from __future__ import annotations

from typing import Final

IMAGE_TOPIC: Final = "/camera/image/compressed"
CAMERA_INFO_TOPIC: Final = "/camera/camera_info"
INS_POSE_TOPIC: Final = "/ins/pose"
INS_ODOMETRY_TOPIC: Final = "/ins/odometry"
INS_FIX_TOPIC: Final = "/ins/fix"
INS_IMU_TOPIC: Final = "/ins/imu"
INS_NATIVE_TOPIC: Final = "/ins/native"
"""Every record of an Applanix log, with all its fields."""
GPS_FIX_TOPIC: Final = "/gps/fix"
GPS_POSE_TOPIC: Final = "/gps/pose"
"""The rough GPS of a log whose map is not georeferenced."""
TF_STATIC_TOPIC: Final = "/tf_static"
INSTANCES_TOPIC: Final = "/truth/instances"
"""Truth masks of simulated drives."""
TRUTH_POSE_TOPIC: Final = "/truth/pose"
"""Where the body of a simulated drive really is at each image; the reference has an INS's errors."""

MAP_ATTACHMENT: Final = "map.geojson"
TRUE_MAP_ATTACHMENT: Final = "true_map.geojson"
"""Of simulated drives: where the landmarks of the map really stand."""
CALIBRATION_ATTACHMENT: Final = "calibration.yaml"
SCPF_METADATA: Final = "scpf"
FRAME_METADATA: Final = "scpf_frame"
"""The origin of ``map``: latitude_deg, longitude_deg, height_m."""

IMAGE_TYPES: Final = frozenset({"sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"})
"""Types that get chunks of their own, uncompressed."""

_FOREVER: Final = "{sec: 2147483647, nsec: 4294967295}"
LATCHED_QOS: Final = (
    "- {history: 3, depth: 0, reliability: 1, durability: 1, liveliness: 1, avoid_ros_namespace_conventions: false, "
    f"deadline: {_FOREVER}, lifespan: {_FOREVER}, liveliness_lease_duration: {_FOREVER}}}\n"
)
"""rosbag2's text for "late subscribers get the last message"; readers insist on every field."""
