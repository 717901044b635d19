"""Navigation as messages of the drive log: the standard topics, and every native record whole beside them.

ROS conventions: poses in ``map``; twists, rates and accelerations in ``base_link`` (x forward, y left, z up);
covariances row by row, zero where unknown; an Imu's acceleration is the specific force (9.8 m/s² upwards at rest),
while Applanix takes gravity off.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.messages import make, to_header, to_pose
from scpf.ingest.navigation import CHUNK, NativeTable, Navigation
from scpf.ingest.topics import (
    INS_FIX_TOPIC,
    INS_IMU_TOPIC,
    INS_NATIVE_TOPIC,
    INS_ODOMETRY_TOPIC,
    INS_POSE_TOPIC,
)
from scpf.models.geodesy import R_FLU_FRD, Origin, ecef_from_enu

Array = NDArray[np.float64]

NATIVE_TYPE: Final = "scpf_msgs/msg/ApplanixNavigation"
GRAVITY_MPS2: Final = 9.80665


class Outgoing(NamedTuple):
    """A message to write."""

    stamp_ns: int
    topic: str
    typename: str
    message: Any


class NativeRecord(NamedTuple):
    """A record as its format has it: names, units and values in its order; ``text`` where it is a sentence."""

    stamp_ns: int
    kind: str
    names: list[str]
    units: list[str]
    values: Array
    text: str


def standard_messages(navigation: Navigation, origin: Origin) -> Iterator[Outgoing]:
    """Pose, odometry, fix and imu of each row that has a heading, in the order of time.

    Raises MissingError where no row has a heading.
    """
    rows = np.flatnonzero(np.isfinite(navigation.heading_rad))
    trajectory = navigation.to_trajectory(origin)
    there = ecef_from_enu(np.array([origin.latitude_deg]), np.array([origin.longitude_deg]))[0]
    for start in range(0, len(rows), CHUNK):  # matrices of a whole survey would fill the memory
        part = slice(start, start + CHUNK)
        poses = _poses(trajectory.positions_m[part], trajectory.quaternions_xyzw[part])
        here = ecef_from_enu(navigation.latitude_deg[rows[part]], navigation.longitude_deg[rows[part]])
        for k, T_map_body, R_map_local in zip(rows[part], poses, there.T @ here, strict=True):
            yield from _row(navigation, int(k), T_map_body, R_map_local)


def native_records(navigation: Navigation) -> Iterator[NativeRecord]:
    """Every native record, each kind in its order, the kinds merged by time; those without a time come first."""
    tables = (_of_table(kind, table) for kind, table in navigation.native.items())
    return heapq.merge(*tables, key=lambda record: record.stamp_ns)


def native_message(record: NativeRecord) -> Outgoing:
    """The message of a native record; ``NATIVE_TYPE`` must be among the registered types."""
    message = make(
        NATIVE_TYPE,
        header=to_header(record.stamp_ns, "base_link"),
        record=record.kind,
        names=record.names,
        units=record.units,
        values=record.values,
        text=record.text,
    )
    return Outgoing(record.stamp_ns, INS_NATIVE_TOPIC, NATIVE_TYPE, message)


def _of_table(kind: str, table: NativeTable) -> Iterator[NativeRecord]:
    texts = {name for name, column in table.columns.items() if column.values.dtype.kind == "S"}
    names = [name for name in table.columns if name not in texts]
    units = [table.columns[name].unit for name in names]
    columns = [table.columns[name].values for name in names]
    for k in range(len(table.stamps_ns)):
        text = "".join(bytes(table.columns[name].values[k]).decode("ascii", "replace") for name in texts)
        with np.errstate(invalid="ignore"):  # the cast complains of signalling NaNs
            values = np.array([column[k] for column in columns], dtype=np.float64)
        yield NativeRecord(int(table.stamps_ns[k]), kind, names, units, values, text)


def _row(navigation: Navigation, k: int, T_map_body: Array, R_map_local: Array) -> Iterator[Outgoing]:
    stamp = int(navigation.stamps_ns[k])
    R_map_body = T_map_body[:3, :3]
    pose = to_pose(T_map_body)
    header = to_header(stamp, "map")
    stamped = make("geometry_msgs/msg/PoseStamped", header=header, pose=pose)
    yield Outgoing(stamp, INS_POSE_TOPIC, "geometry_msgs/msg/PoseStamped", stamped)

    position = R_map_local @ _diagonal(navigation.position_rms_m[k]) @ R_map_local.T
    attitude = R_map_body @ _diagonal(navigation.attitude_rms_rad[k]) @ R_map_body.T
    R_body_local = R_map_body.T @ R_map_local
    speed = R_body_local @ _diagonal(navigation.velocity_rms_mps[k]) @ R_body_local.T
    rates = R_FLU_FRD @ _known(navigation.rates_radps[k])
    linear = R_body_local @ _known(navigation.velocity_enu_mps[k])
    odometry = make(
        "nav_msgs/msg/Odometry",
        header=header,
        child_frame_id="base_link",
        pose=make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=_six(position, attitude)),
        twist=make(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=make("geometry_msgs/msg/Twist", linear=_vector(linear), angular=_vector(rates)),
            covariance=_six(speed, np.zeros((3, 3))),
        ),
    )
    yield Outgoing(stamp, INS_ODOMETRY_TOPIC, "nav_msgs/msg/Odometry", odometry)

    local = _diagonal(navigation.position_rms_m[k])
    fix = make(
        "sensor_msgs/msg/NavSatFix",
        header=to_header(stamp, "base_link"),
        status=make("sensor_msgs/msg/NavSatStatus", status=0, service=1),
        latitude=float(navigation.latitude_deg[k]),
        longitude=float(navigation.longitude_deg[k]),
        altitude=float(navigation.height_m[k]),
        position_covariance=local.ravel(),
        position_covariance_type=2 if local.any() else 0,
    )
    yield Outgoing(stamp, INS_FIX_TOPIC, "sensor_msgs/msg/NavSatFix", fix)
    if np.isfinite(navigation.rates_radps[k]).all() and np.isfinite(navigation.accelerations_mps2[k]).all():
        force = R_FLU_FRD @ navigation.accelerations_mps2[k] + R_map_body.T @ [0.0, 0.0, GRAVITY_MPS2]
        imu = make(
            "sensor_msgs/msg/Imu",
            header=to_header(stamp, "base_link"),
            orientation=pose.orientation,
            orientation_covariance=attitude.ravel(),
            angular_velocity=_vector(rates),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=_vector(force),
            linear_acceleration_covariance=np.zeros(9),
        )
        yield Outgoing(stamp, INS_IMU_TOPIC, "sensor_msgs/msg/Imu", imu)


def _poses(positions_m: Array, quaternions_xyzw: Array) -> Array:
    from scipy.spatial.transform import Rotation

    poses = np.tile(np.eye(4), (len(positions_m), 1, 1))
    poses[:, :3, :3] = Rotation.from_quat(quaternions_xyzw).as_matrix()
    poses[:, :3, 3] = positions_m
    return poses


def _diagonal(rms: Array) -> Array:
    """The covariance (3, 3) of independent errors; zeros, ROS's sign for unknown, where one is not known."""
    return np.diag(rms**2) if np.isfinite(rms).all() else np.zeros((3, 3))


def _known(values: Array) -> Array:
    """ROS has no sign for an unknown velocity: 0 is written, and the native record says what was there."""
    return np.where(np.isfinite(values), values, 0.0)


def _six(first: Array, second: Array) -> Array:
    covariance = np.zeros((6, 6))
    covariance[:3, :3], covariance[3:, 3:] = first, second
    return covariance.ravel()


def _vector(values: Array) -> Any:
    x, y, z = (float(value) for value in values)
    return make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)
