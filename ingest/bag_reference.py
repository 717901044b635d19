"""The reference trajectory of a drive log, made of the navigation messages of a bag (GSOF 49 and 50)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scpf.ingest import gps_time
from scpf.ingest.bag_mapping import Rule
from scpf.ingest.bag_navigation_fields import (
    ACCURACY_FIELDS,
    NAVIGATION_FIELDS,
    REQUIRED,
    REQUIRED_ACCURACY,
    Read,
    readers,
)
from scpf.ingest.gps_messages import to_fix
from scpf.ingest.messages import from_time, make, to_header, to_odometry, to_pose
from scpf.ingest.navigation import MAX_RMS_AGE_NS, Navigation, make_navigation
from scpf.ingest.read_report import ReadReport
from scpf.ingest.topics import INS_FIX_TOPIC, INS_ODOMETRY_TOPIC, INS_POSE_TOPIC
from scpf.models.errors import DamagedError, MissingError
from scpf.models.geodesy import R_FLU_FRD, Origin, wrap_angle

Array = NDArray[np.float64]
Write = Callable[[str, str, Any, int], None]

BATCH: Final = 256
"""Records turned into poses together: one call of the projection for many."""
FULL_NAVIGATION: Final = 4
EARLIEST_DATE_NS: Final = 10**18
"""September 2001. A stamp before it is no date: some drivers put the time of the GPS week into their headers."""
IMU_TOPIC: Final = "/ins/imu"


class _Record(NamedTuple):
    log_ns: int
    stamp_ns: int
    values: dict[str, float]
    rms: tuple[float, float, float]
    """East, north, up (m)."""


class Reference:
    """Collects navigation records and writes them as poses. ``origin``: the first position, if not given."""

    def __init__(self, origin: Origin | None, write: Write) -> None:
        self.origin = origin
        self.losses: list[str] = []
        self.notes: list[str] = []
        self._write = write
        self._readers: dict[str, dict[str, Read]] = {}
        self._batch: list[_Record] = []
        self._rms: tuple[int, tuple[float, float, float]] | None = None
        self._last_ns = -1
        self._records = self._aligning = self._late = self._without_date = 0
        self._report = ReadReport("the navigation messages", "ROS")

    def is_next(self, stamp_ns: int) -> bool:
        """Whether a pose comes later than all before it; one that does not is counted, and left out."""
        if stamp_ns <= self._last_ns:
            self._late += 1
            return False
        self._last_ns = stamp_ns
        return True

    def navigation(self, message: Any, rule: Rule, log_ns: int) -> None:
        """Take in a navigation message. InputError where it has not the fields."""
        if "navigation" not in self._readers:
            self._readers["navigation"] = readers(message, NAVIGATION_FIELDS, rule.fields, REQUIRED)
        values = {name: read(message) for name, read in self._readers["navigation"].items()}
        self._records += 1
        self._aligning += values.get("alignment", FULL_NAVIGATION) != FULL_NAVIGATION
        stamp_ns = self._stamp(message, values, rule.time, log_ns)
        unknown = (float("nan"),) * 3
        fresh = self._rms is not None and abs(log_ns - self._rms[0]) <= MAX_RMS_AGE_NS
        rms = self._rms[1] if fresh and self._rms is not None else unknown
        self._batch.append(_Record(log_ns, stamp_ns, values, (rms[0], rms[1], rms[2])))
        if len(self._batch) >= BATCH:
            self.write_pending()

    def accuracy(self, message: Any, rule: Rule, log_ns: int) -> None:
        """Take in a message of accuracies (RMS)."""
        if "accuracy" not in self._readers:
            self._readers["accuracy"] = readers(message, ACCURACY_FIELDS, rule.fields, REQUIRED_ACCURACY)
        north, east, down = (self._readers["accuracy"][name](message) for name in REQUIRED_ACCURACY)
        self._rms = (log_ns, (east, north, down))

    def flush(self) -> None:
        """Write what is held back, and say what gave no pose."""
        self.write_pending()
        dropped = dict(self._report.dropped)
        if self._late:
            dropped["whose time does not increase"] = self._late
        self.notes += [
            f"reference: no pose of {count} messages: {reason}" for reason, count in dropped.items()
        ]
        if self._aligning:
            self.notes.append(
                f"reference: {self._aligning} of {self._records} records are not in full navigation"
            )
        if self._without_date:
            text = f"{self._without_date} of {self._records} records carry no date: they count at their recording time"
            self.notes.append(f"reference: {text}")

    def _stamp(self, message: Any, values: dict[str, float], source: str, log_ns: int) -> int:
        header = getattr(message, "header", None)
        stamped = from_time(header.stamp) if header is not None else 0
        if source in ("auto", "header") and stamped >= EARLIEST_DATE_NS:
            return stamped
        week, milliseconds = values.get("gps_week", 0.0), values.get("gps_ms", 0.0)
        if (
            source in ("auto", "gps")
            and 0 < week <= gps_time.MAX_WEEK
            and 0 <= milliseconds < gps_time.WEEK_S * 1000
        ):
            near = int(gps_time.gps_seconds(log_ns * 1e-9) // gps_time.WEEK_S)
            gps_ns = gps_time.full_week(int(week), near) * gps_time.WEEK_S * 10**9 + round(milliseconds * 1e6)
            return int(gps_time.utc_ns(np.array([gps_ns], dtype=np.int64))[0])
        self._without_date += source != "log"
        return log_ns

    def write_pending(self) -> None:
        """Write the records that wait for a batch to be full."""
        batch = [record for record in self._batch if record.stamp_ns > self._last_ns]
        self._late += len(self._batch) - len(batch)
        self._batch = []
        if not batch:
            return
        try:
            navigation = self._navigation(batch)
            if self.origin is None:
                self.origin = navigation.origin()
            trajectory = navigation.to_trajectory(self.origin)
        except (DamagedError, MissingError):
            return  # why is counted in the report
        self._last_ns = int(navigation.stamps_ns[-1])
        log_ns = {record.stamp_ns: record.log_ns for record in batch}
        rows = {int(stamp): k for k, stamp in enumerate(navigation.stamps_ns)}
        for stamp, T_map_body in zip(trajectory.stamps_ns, trajectory.poses(), strict=True):
            self._pose(int(stamp), T_map_body, navigation, rows[int(stamp)], log_ns[int(stamp)])

    def _navigation(self, batch: list[_Record]) -> Navigation:
        def column(name: str) -> Array:
            return np.array([record.values.get(name, np.nan) for record in batch], dtype=np.float64)

        def columns(*names: str) -> Array:
            return np.column_stack([column(name) for name in names])

        axes = ("x", "y", "z")
        found = {
            "velocity_enu_mps": columns("velocity_east_mps", "velocity_north_mps", "velocity_down_mps")
            * [1, 1, -1],
            "roll_rad": np.radians(column("roll_deg")),
            "pitch_rad": np.radians(column("pitch_deg")),
            "heading_rad": wrap_angle(np.radians(column("heading_deg"))),
            "rates_radps": np.radians(columns(*(f"rate_{axis}_degps" for axis in axes))),
            "accelerations_mps2": columns(*(f"acceleration_{axis}_mps2" for axis in axes)),
            "position_rms_m": np.array([record.rms for record in batch], dtype=np.float64),
        }
        stamps = np.array([record.stamp_ns for record in batch], dtype=np.int64)
        place = (column("latitude_deg"), column("longitude_deg"), column("height_m"))
        return make_navigation(self._report, stamps, place, {}, found)

    def _pose(self, stamp_ns: int, T_map_body: Array, navigation: Navigation, row: int, log_ns: int) -> None:
        assert self.origin is not None
        rms = navigation.position_rms_m[row]
        variance = rms**2 if np.isfinite(rms).all() else None
        pose = make(
            "geometry_msgs/msg/PoseStamped", header=to_header(stamp_ns, "map"), pose=to_pose(T_map_body)
        )
        self._write(INS_POSE_TOPIC, "geometry_msgs/msg/PoseStamped", pose, log_ns)
        odometry = to_odometry(stamp_ns, T_map_body, variance)
        self._write(INS_ODOMETRY_TOPIC, "nav_msgs/msg/Odometry", odometry, log_ns)
        fix = to_fix(stamp_ns, T_map_body[:3, 3], variance, self.origin, "base_link")
        self._write(INS_FIX_TOPIC, "sensor_msgs/msg/NavSatFix", fix, log_ns)
        motion = np.stack([navigation.rates_radps[row], navigation.accelerations_mps2[row]]) @ R_FLU_FRD
        if np.isfinite(motion).all():
            rates, accelerations = ([float(value) for value in line] for line in motion)
            imu = make(
                "sensor_msgs/msg/Imu",
                header=to_header(stamp_ns, "base_link"),
                orientation=pose.pose.orientation,
                orientation_covariance=np.zeros(9),
                angular_velocity=make("geometry_msgs/msg/Vector3", x=rates[0], y=rates[1], z=rates[2]),
                angular_velocity_covariance=np.zeros(9),
                linear_acceleration=make(
                    "geometry_msgs/msg/Vector3", x=accelerations[0], y=accelerations[1], z=accelerations[2]
                ),
                linear_acceleration_covariance=np.zeros(9),
            )
            self._write(IMU_TOPIC, "sensor_msgs/msg/Imu", imu, log_ns)
