"""The built-in topic mappings, in the words in which a user would write one (docs/CONVERT.md)."""

from __future__ import annotations

from typing import Final

_AUTOWARE_CAMERA: Final = """
[[rule]]
topic = "/sensing/camera/*/image_rect_color/compressed"
to = "image"
[[rule]]
topic = "/sensing/camera/*/image_raw/compressed"
to = "image"
[[rule]]
topic = "/*/image_rect*/compressed"
to = "image"
[[rule]]
topic = "*"
type = "sensor_msgs/msg/CompressedImage"
to = "image"
[[rule]]
topic = "*"
type = "sensor_msgs/msg/CameraInfo"
to = "camera_info"
[[rule]]
topic = "/tf_static"
to = "tf_static"
"""

WATONOBUS: Final = """
[[rule]]
topic = "/pylon_camera_node_center/image_rect/compressed"
to = "image"
rectified = true
[[rule]]
topic = "/pylon_camera_node_center/image_rect"
to = "image"
rectified = true
[[rule]]
topic = "/pylon_camera_node_center/camera_info"
to = "camera_info"
[[rule]]
topic = "/lvx_client_node/gsof/49"
to = "navigation"
[[rule]]
topic = "/lvx_client_node/gsof/50"
to = "accuracy"
[[rule]]
topic = "/tf_static"
to = "tf_static"
"""

# The driver of autowarefoundation/applanix: /lvx_client/gsof/ins_solution_49, wherever it is remapped to.
APPLANIX: Final = (
    """
[[rule]]
topic = "*"
type = "applanix_msgs/msg/NavigationSolutionGsof49"
to = "navigation"
[[rule]]
topic = "*"
type = "applanix_msgs/msg/NavigationPerformanceGsof50"
to = "accuracy"
"""
    + _AUTOWARE_CAMERA
)

TRIMBLE: Final = (
    """
[[rule]]
topic = "*"
type = "*gsof_msgs/msg/NavigationSolution49"
to = "navigation"
[[rule]]
topic = "*"
type = "*gsof_msgs/msg/NavigationPerformance50"
to = "accuracy"
"""
    + _AUTOWARE_CAMERA
)

AUTOWARE: Final = (
    """
[[rule]]
topic = "/localization/kinematic_state"
to = "pose"
[[rule]]
topic = "/localization/pose_twist_fusion_filter/*kinematic_state"
to = "pose"
[[rule]]
topic = "/localization/pose_with_covariance"
to = "pose"
[[rule]]
topic = "/sensing/gnss/*"
type = "sensor_msgs/msg/NavSatFix"
to = "gps"
[[rule]]
topic = "/sensing/imu/*"
type = "sensor_msgs/msg/Imu"
to = "imu"
"""
    + _AUTOWARE_CAMERA
)

PLAIN: Final = """
[[rule]]
topic = "*"
type = "sensor_msgs/msg/CompressedImage"
to = "image"
[[rule]]
topic = "*"
type = "sensor_msgs/msg/Image"
to = "image"
[[rule]]
topic = "*"
type = "sensor_msgs/msg/CameraInfo"
to = "camera_info"
[[rule]]
topic = "*"
type = "nav_msgs/msg/Odometry"
to = "pose"
[[rule]]
topic = "*"
type = "geometry_msgs/msg/PoseStamped"
to = "pose"
[[rule]]
topic = "*"
type = "sensor_msgs/msg/NavSatFix"
to = "gps"
[[rule]]
topic = "*"
type = "sensor_msgs/msg/Imu"
to = "imu"
[[rule]]
topic = "/tf_static"
to = "tf_static"
"""

BUILT_IN: Final = {
    "watonobus": WATONOBUS,
    "applanix": APPLANIX,
    "trimble": TRIMBLE,
    "autoware": AUTOWARE,
    "plain": PLAIN,
}
"""In the order in which ``auto`` looks for them; ``plain`` only by name."""
