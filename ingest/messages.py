"""ROS 2 messages of the drive log: the type store, our own types, and the way to and from our own records."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.camera import Camera, looking_ahead
from scpf.models.instances import Instance, decode_runs, encode_runs

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

Array = NDArray[np.float64]

MAX_MASK_PX: Final = 1 << 28
"""A mask larger than this is refused: no camera of this century needs it, and it is allocated whole."""

DEFINITIONS: Final = {
    "scpf_msgs/msg/Instance": """\
# One segmented object of an image; distances and fractions are NaN where unknown.
float32[4] box_px
int32 mask_x_px
int32 mask_y_px
uint32 mask_width_px
uint32 mask_height_px
uint32[] mask_runs
float32 score
string landmark_class
string landmark_id
float32 distance_m
float32 visible_fraction
""",
    "scpf_msgs/msg/Instances": """\
std_msgs/Header header
scpf_msgs/Instance[] instances
""",
    "scpf_msgs/msg/ApplanixNavigation": """\
# A record as its format has it: its kind (sbet, gsof_49 …), its fields in their order; text is an NMEA sentence.
std_msgs/Header header
string record
string[] names
string[] units
float64[] values
string text
""",
}
"""Our own message types. ``mask_runs`` counts pixels column by column, background first."""


@lru_cache(maxsize=1)
def typestore() -> Typestore:
    """The types of ROS 2 Humble, and ours."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types: dict[str, Any] = {}
    for name, text in DEFINITIONS.items():
        types.update(get_types_from_msg(text, name))
    store.register(types)
    return store


def make(typename: str, **fields: Any) -> Any:
    """A message of type ``typename``, such as ``geometry_msgs/msg/Point``."""
    return typestore().types[typename](**fields)


def definition(typename: str) -> bytes:
    """The full ros2msg text of a type, as MCAP stores it."""
    return typestore().generate_msgdef(typename, ros_version=2)[0].encode()


def serialize(message: Any, typename: str) -> memoryview:
    """A message as CDR."""
    return typestore().serialize_cdr(message, typename)


def to_time(stamp_ns: int) -> Any:
    """builtin_interfaces/Time of nanoseconds since 1970."""
    return make("builtin_interfaces/msg/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)


def from_time(stamp: Any) -> int:
    """Nanoseconds since 1970 of a builtin_interfaces/Time."""
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def to_header(stamp_ns: int, frame: str) -> Any:
    """std_msgs/Header of a time and a frame."""
    return make("std_msgs/msg/Header", stamp=to_time(stamp_ns), frame_id=frame)


def to_pose(T_parent_child: Array) -> Any:
    """geometry_msgs/Pose of a transform (4, 4)."""
    x, y, z, w = _quaternion(T_parent_child)
    px, py, pz = (float(v) for v in T_parent_child[:3, 3])
    return make(
        "geometry_msgs/msg/Pose",
        position=make("geometry_msgs/msg/Point", x=px, y=py, z=pz),
        orientation=make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w),
    )


def to_transform(T_parent_child: Array) -> Any:
    """geometry_msgs/Transform of a transform (4, 4)."""
    pose = to_pose(T_parent_child)
    at = pose.position
    translation = make("geometry_msgs/msg/Vector3", x=at.x, y=at.y, z=at.z)
    return make("geometry_msgs/msg/Transform", translation=translation, rotation=pose.orientation)


def from_pose(position: Any, orientation: Any) -> Array:
    """The transform (4, 4) of a Point or Vector3 and a Quaternion; ValueError where that is none."""
    from scipy.spatial.transform import Rotation

    transform = np.eye(4)
    transform[:3, :3] = Rotation.from_quat(
        [orientation.x, orientation.y, orientation.z, orientation.w]
    ).as_matrix()
    transform[:3, 3] = position.x, position.y, position.z
    if not np.isfinite(transform).all():
        raise ValueError("a pose that is not finite")
    return transform


def to_odometry(stamp_ns: int, T_map_body: Array, position_variance_m2: Array | None) -> Any:
    """nav_msgs/Odometry of a pose; ``position_variance_m2`` (3,), written as zeros where it is unknown."""
    covariance = np.zeros(36)
    if position_variance_m2 is not None:
        covariance[[0, 7, 14]] = position_variance_m2
    zero = make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
    twist = make("geometry_msgs/msg/Twist", linear=zero, angular=zero)
    return make(
        "nav_msgs/msg/Odometry",
        header=to_header(stamp_ns, "map"),
        child_frame_id="base_link",
        pose=make("geometry_msgs/msg/PoseWithCovariance", pose=to_pose(T_map_body), covariance=covariance),
        twist=make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)),
    )


def to_camera_info(stamp_ns: int, camera: Camera, frame: str = "camera") -> Any:
    """sensor_msgs/CameraInfo of a camera; where it sits on the body is said in /tf_static."""
    matrix = camera.matrix
    projection = np.column_stack([matrix, np.zeros(3)])
    roi = make(
        "sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
    )
    return make(
        "sensor_msgs/msg/CameraInfo",
        header=to_header(stamp_ns, frame),
        height=camera.height_px,
        width=camera.width_px,
        distortion_model=camera.distortion_model,
        d=np.asarray(camera.distortion, dtype=np.float64),
        k=np.asarray(matrix, dtype=np.float64).ravel(),
        r=np.eye(3).ravel(),
        p=projection.ravel(),
        binning_x=0,
        binning_y=0,
        roi=roi,
    )


def from_camera_info(info: Any, T_body_camera: Array | None = None) -> Camera:
    """The camera of a CameraInfo; InputError where its values cannot be those of a camera."""
    distortion = np.array(info.d, dtype=np.float64)
    return Camera(
        int(info.width),
        int(info.height),
        np.array(info.k, dtype=np.float64).reshape(3, 3),
        distortion if len(distortion) else np.zeros(5),
        str(info.distortion_model) if len(distortion) else "plumb_bob",
        looking_ahead() if T_body_camera is None else T_body_camera,
    )


def to_instances(
    stamp_ns: int,
    instances: Sequence[Instance],
    distances_m: Sequence[float] | None = None,
    visible_fractions: Sequence[float] | None = None,
) -> Any:
    """scpf_msgs/Instances of an image's instances; distances and fractions in the same order, or unknown."""
    unknown = [float("nan")] * len(instances)
    rows = zip(
        instances,
        unknown if distances_m is None else distances_m,
        unknown if visible_fractions is None else visible_fractions,
        strict=True,
    )
    messages = [
        make(
            "scpf_msgs/msg/Instance",
            box_px=np.array(instance.box_px, dtype=np.float32),
            mask_x_px=instance.offset_px[0],
            mask_y_px=instance.offset_px[1],
            mask_width_px=instance.mask.shape[1],
            mask_height_px=instance.mask.shape[0],
            mask_runs=encode_runs(instance.mask),
            score=float(instance.score),
            landmark_class=instance.landmark_class,
            landmark_id=instance.landmark_id,
            distance_m=float(distance_m),
            visible_fraction=float(visible_fraction),
        )
        for instance, distance_m, visible_fraction in rows
    ]
    return make("scpf_msgs/msg/Instances", header=to_header(stamp_ns, "camera"), instances=messages)


def from_instance(message: Any) -> Instance:
    """The instance of a scpf_msgs/Instance; ValueError where its mask is not of the size that it declares."""
    height, width = int(message.mask_height_px), int(message.mask_width_px)
    if height * width > MAX_MASK_PX:
        raise ValueError(f"a mask of {width}×{height} px")
    box = tuple(float(v) for v in message.box_px)
    return Instance(
        (box[0], box[1], box[2], box[3]),
        decode_runs(message.mask_runs, height, width),
        (int(message.mask_x_px), int(message.mask_y_px)),
        float(message.score),
        message.landmark_class,
        message.landmark_id,
    )


def _quaternion(transform: Array) -> tuple[float, float, float, float]:
    from scipy.spatial.transform import Rotation

    x, y, z, w = (float(v) for v in Rotation.from_matrix(transform[:3, :3]).as_quat(canonical=True))
    return x, y, z, w
