"""The messages of a WATonoBus-like recording, for ROS 1 and for ROS 2: GSOF 49 and 50, pictures, calibration, mount.

The GSOF types are those of autowarefoundation/applanix (applanix_msgs), which WATonoBus' driver publishes, too.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scpf.models.camera import Camera
from scpf.sample_logs.gps_week import weeks_of
from scpf.sample_logs.raw_camera import RecordedPicture
from scpf.sample_logs.sensors import InsLog

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

NAVIGATION, ACCURACY = (
    "applanix_msgs/msg/NavigationSolutionGsof49",
    "applanix_msgs/msg/NavigationPerformanceGsof50",
)
IMAGE, CAMERA_INFO, MOUNT = (
    "sensor_msgs/msg/CompressedImage",
    "sensor_msgs/msg/CameraInfo",
    "tf2_msgs/msg/TFMessage",
)
BODY_FRAME, CAMERA_FRAME, INS_FRAME = "base_link", "pylon_camera_center", "gsof"
FULL_NAVIGATION, RTK_FIXED = 4, 4
_HEAD = "std_msgs/Header header\napplanix_msgs/GpsTimeGsof gps_time\napplanix_msgs/StatusGsof status\n"
_DEFINITIONS = {
    "applanix_msgs/msg/LLA": "float64 latitude\nfloat64 longitude\nfloat64 altitude\n",
    "applanix_msgs/msg/NED": "float32 north\nfloat32 east\nfloat32 down\n",
    "applanix_msgs/msg/GpsTimeGsof": "uint16 week\nuint32 time\n",
    "applanix_msgs/msg/StatusGsof": "uint8 imu_alignment\nuint8 gnss\n",
    NAVIGATION: _HEAD
    + "applanix_msgs/LLA lla\napplanix_msgs/NED velocity\nfloat32 total_speed\nfloat64 roll\nfloat64 pitch\n"
    "float64 heading\nfloat64 track_angle\nfloat32 ang_rate_long\nfloat32 ang_rate_trans\nfloat32 ang_rate_down\n"
    "float32 acc_long\nfloat32 acc_trans\nfloat32 acc_down\n",
    ACCURACY: _HEAD
    + "applanix_msgs/NED pos_rms_error\napplanix_msgs/NED vel_rms_error\nfloat32 attitude_rms_error_roll\n"
    "float32 attitude_rms_error_pitch\nfloat32 attitude_rms_error_heading\n",
}


class RosMessages:
    """Makes messages of one version of ROS, 1 or 2; ``store`` knows their types."""

    def __init__(self, ros_version: int) -> None:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self.ros_version = ros_version
        self.store: Typestore = get_typestore(Stores.ROS1_NOETIC if ros_version == 1 else Stores.ROS2_HUMBLE)
        types: dict[str, Any] = {}
        for name, text in _DEFINITIONS.items():
            types.update(get_types_from_msg(text, name))
        if MOUNT not in self.store.fielddefs:
            types.update(get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", MOUNT))
        self.store.register(types)
        self._counts: dict[str, int] = {}

    def serialized(self, message: Any, typename: str) -> memoryview:
        """The bytes of a message."""
        if self.ros_version == 1:
            return self.store.serialize_ros1(message, typename)
        return self.store.serialize_cdr(message, typename)

    def navigation(self, ins: InsLog, k: int) -> Any:
        """Record 49 of a row."""
        north, east, _ = ins.velocity_ned_mps[k]
        roll, pitch, heading = (float(angle) for angle in ins.attitude_deg[k])
        inertial = (float(value) for value in (*ins.rates_degps[k], *ins.accelerations_mps2[k]))
        place = float(ins.latitude_deg[k]), float(ins.longitude_deg[k]), float(ins.height_m[k])
        return self.store.types[NAVIGATION](
            *self._gsof_head(ins, k),
            self._make("applanix_msgs/msg/LLA", *place),
            self._ned(ins.velocity_ned_mps[k]),
            float(np.hypot(north, east)),
            roll,
            pitch,
            heading,
            float(np.degrees(np.arctan2(east, north)) % 360.0),
            *inertial,
        )

    def accuracy(self, ins: InsLog, k: int) -> Any:
        """Record 50 of a row."""
        attitude = (float(value) for value in ins.attitude_rms_deg[k])
        position, velocity = self._ned(ins.position_rms_m[k]), self._ned(ins.velocity_rms_mps[k])
        return self._make(ACCURACY, *self._gsof_head(ins, k), position, velocity, *attitude)

    def image(self, picture: RecordedPicture) -> Any:
        """A picture, its bytes untouched."""
        pixels = np.frombuffer(picture.jpeg, dtype=np.uint8)
        return self._make(IMAGE, self._header(picture.stamp_ns, CAMERA_FRAME), "jpeg", pixels)

    def camera_info(self, stamp_ns: int, camera: Camera) -> Any:
        """The calibration; rectified pictures are those of its projection matrix."""
        region = self._make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
        projection = np.column_stack([camera.matrix, np.zeros(3)])
        return self._make(
            CAMERA_INFO,
            self._header(stamp_ns, CAMERA_FRAME),
            camera.height_px,
            camera.width_px,
            camera.distortion_model,
            np.asarray(camera.distortion, dtype=np.float64),
            camera.matrix.ravel(),
            np.eye(3).ravel(),
            projection.ravel(),
            0,
            0,
            region,
        )

    def mount(self, stamp_ns: int, camera: Camera) -> Any:
        """Where the camera sits on the body."""
        pose = camera.T_body_camera
        quaternion = (float(part) for part in Rotation.from_matrix(pose[:3, :3]).as_quat())
        transform = self._make(
            "geometry_msgs/msg/Transform",
            self._make("geometry_msgs/msg/Vector3", *(float(part) for part in pose[:3, 3])),
            self._make("geometry_msgs/msg/Quaternion", *quaternion),
        )
        head = self._header(stamp_ns, BODY_FRAME)
        stamped = self._make("geometry_msgs/msg/TransformStamped", head, CAMERA_FRAME, transform)
        return self._make(MOUNT, [stamped])

    def _gsof_head(self, ins: InsLog, k: int) -> tuple[Any, Any, Any]:
        stamp_ns = int(ins.stamps_ns[k])
        week, nanoseconds = weeks_of(ins.stamps_ns[k : k + 1])
        time = self._make("applanix_msgs/msg/GpsTimeGsof", int(week[0]), int(nanoseconds[0]) // 10**6)
        status = self._make("applanix_msgs/msg/StatusGsof", FULL_NAVIGATION, RTK_FIXED)
        return self._header(stamp_ns, INS_FRAME), time, status

    def _ned(self, values: NDArray[np.float64]) -> Any:
        return self._make("applanix_msgs/msg/NED", *(float(value) for value in values))

    def _header(self, stamp_ns: int, frame: str) -> Any:
        seconds, nanoseconds = divmod(stamp_ns, 10**9)
        time = self._make("builtin_interfaces/msg/Time", seconds, nanoseconds)
        if self.ros_version == 1:  # only there does a Header count
            count = self._counts.get(frame, 0)
            self._counts[frame] = count + 1
            return self._make("std_msgs/msg/Header", count, time, frame)
        return self._make("std_msgs/msg/Header", time, frame)

    def _make(self, typename: str, *values: Any) -> Any:
        return self.store.types[typename](*values)
