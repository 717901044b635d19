"""Navigation as every Applanix format tells it: one column store, whatever the file was.

Attitude in the Applanix convention: roll, pitch and heading of a body x forward, y right, z down in local
North-East-Down, heading clockwise from true North. ``to_trajectory`` changes it to the convention of the log.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.read_report import ReadReport
from scpf.models.errors import DamagedError, MissingError
from scpf.models.geodesy import Origin, ecef_from_enu, enu_from_geodetic, rotation_from_ned
from scpf.models.trajectory import Trajectory

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

MAX_HEIGHT_M: Final = 100_000.0
CHUNK: Final = 1 << 16
"""Rows that are turned into poses at a time: rotation matrices of a whole survey would fill the memory."""
MAX_RMS_AGE_NS: Final = 5_000_000_000
"""Accuracies come once a second; one that is older than this says nothing about a pose."""


class NativeColumn(NamedTuple):
    """A column as the file has it: ``values`` (M,), and its unit (empty for counts and flags)."""

    values: NDArray[np.generic]
    unit: str


class NativeTable(NamedTuple):
    """All records of one kind, in the file's order, nothing left out.

    ``stamps_ns`` (M,), UTC, 0 where a record has no usable time.
    """

    stamps_ns: Stamps
    columns: dict[str, NativeColumn]


@dataclass(frozen=True, eq=False)
class Navigation:
    """Poses, velocities and accuracies at ``stamps_ns`` (N,), UTC, strictly increasing.

    Columns that a format has not are NaN; columns (N, 3) are in the order of their names. ``native`` keeps
    each kind of record whole: kind → table.
    """

    stamps_ns: Stamps
    latitude_deg: Array
    longitude_deg: Array
    height_m: Array
    """Above the WGS 84 ellipsoid."""
    velocity_enu_mps: Array
    roll_rad: Array
    pitch_rad: Array
    heading_rad: Array
    rates_radps: Array
    """About body x forward, y right, z down."""
    accelerations_mps2: Array
    """Along body x forward, y right, z down."""
    position_rms_m: Array
    """East, north, up."""
    velocity_rms_mps: Array
    """East, north, up."""
    attitude_rms_rad: Array
    """Roll, pitch, heading."""
    report: ReadReport
    native: dict[str, NativeTable] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def between(self, first_ns: int, last_ns: int) -> Navigation:
        """The rows from ``first_ns`` to ``last_ns``, both included; ``native`` stays whole."""
        low = int(np.searchsorted(self.stamps_ns, first_ns, side="left"))
        high = int(np.searchsorted(self.stamps_ns, last_ns, side="right"))
        return self._rows(slice(low, high))

    def origin(self) -> Origin:
        """The first position, for a log that is given no other origin."""
        return Origin(float(self.latitude_deg[0]), float(self.longitude_deg[0]), float(self.height_m[0]))

    def to_trajectory(self, origin: Origin) -> Trajectory:
        """Poses of the body (x forward, y left, z up) in ``map``, East-North-Up tangent at ``origin``.

        Rows without a heading are left out, unknown roll and pitch are taken as level. Raises MissingError
        where no row has a heading: such a log is a rough GPS, not a reference.
        """
        known = np.isfinite(self.heading_rad)
        if not known.any():
            hint = "use it as the rough GPS, and another log as the reference"
            raise MissingError(f"{self.report.path} holds positions without a heading", hint)
        rows = self if known.all() else self._rows(known)
        positions, quaternions = np.empty((len(rows), 3)), np.empty((len(rows), 4))
        for start in range(0, len(rows), CHUNK):
            part = rows._rows(slice(start, start + CHUNK))
            place = (part.latitude_deg, part.longitude_deg, part.height_m)
            positions[start : start + CHUNK] = enu_from_geodetic(*place, origin)
            quaternions[start : start + CHUNK] = part._quaternions(origin)
        return Trajectory(np.ascontiguousarray(rows.stamps_ns), positions, quaternions)

    def _quaternions(self, origin: Origin) -> Array:
        from scipy.spatial.transform import Rotation

        roll, pitch = (np.where(np.isfinite(a), a, 0.0) for a in (self.roll_rad, self.pitch_rad))
        angles = np.column_stack([self.heading_rad, pitch, roll])
        local = rotation_from_ned(Rotation.from_euler("ZYX", angles).as_matrix())
        # East and North turn with the place: by 0.04° five kilometres east of the origin, at 43° North.
        here = ecef_from_enu(self.latitude_deg, self.longitude_deg)
        there = ecef_from_enu(np.array([origin.latitude_deg]), np.array([origin.longitude_deg]))[0]
        quaternions: Array = Rotation.from_matrix(there.T @ here @ local).as_quat()
        return quaternions

    def _rows(self, rows: slice | NDArray[np.bool_]) -> Navigation:
        arrays = [f.name for f in fields(self) if f.name not in ("report", "native")]
        return replace(self, **{name: getattr(self, name)[rows] for name in arrays})


def make_navigation(
    report: ReadReport,
    stamps_ns: Stamps,
    place: tuple[Array, Array, Array],
    native: dict[str, NativeTable],
    columns: dict[str, Array],
) -> Navigation:
    """A Navigation of the usable rows; the others are counted in ``report``.

    ``place``: latitude, longitude (deg) and height (m) at ``stamps_ns`` (N,); ``columns``: the others by their
    names in Navigation, as far as the format has them: the rest are NaN.

    Usable: a time later than all before, and a position on the earth. Raises DamagedError where none is.
    """
    n = len(stamps_ns)
    latitude_deg, longitude_deg, height_m = place
    longitude_deg = np.where(longitude_deg > 180.0, longitude_deg - 360.0, longitude_deg)
    columns = dict(columns)
    # An absent column is one NaN seen N times: it takes no memory.
    for name in ("velocity_enu_mps", "rates_radps", "accelerations_mps2", "position_rms_m"):
        columns.setdefault(name, np.broadcast_to(np.nan, (n, 3)))
    for name in ("velocity_rms_mps", "attitude_rms_rad"):
        columns.setdefault(name, np.broadcast_to(np.nan, (n, 3)))
    for name in ("roll_rad", "pitch_rad", "heading_rad"):
        columns.setdefault(name, np.broadcast_to(np.nan, (n,)))
    columns = {name: _known(column) for name, column in columns.items()}
    columns |= {"latitude_deg": latitude_deg, "longitude_deg": longitude_deg, "height_m": height_m}

    timed = stamps_ns > 0
    # Comparisons with NaN are false: what is not a number is not on the earth.
    placed = (np.abs(latitude_deg) <= 90.0) & (np.abs(longitude_deg) <= 180.0)
    placed &= np.abs(height_m) <= MAX_HEIGHT_M
    null = (latitude_deg == 0.0) & (longitude_deg == 0.0) & (height_m == 0.0)
    report.drop("record without a usable time", int((~timed).sum()))
    report.drop("record before the first position (all zero)", int((timed & null).sum()))
    report.drop("record whose position is not on the earth", int((timed & ~placed & ~null).sum()))
    keep = timed & placed & ~null
    later = _increasing(stamps_ns if keep.all() else stamps_ns[keep])
    report.drop("record whose time does not increase", int((~later).sum()))
    keep[keep] = later
    report.rows = int(keep.sum())
    if not report.rows:
        reasons = "; ".join(f"{reason}: {count}" for reason, count in report.dropped.items())
        hint = "is it the right kind of file, and was the unit navigating?"
        raise DamagedError(
            f"{report.path} holds no usable {report.format} record ({reasons or 'none'})", hint
        )
    everything = Navigation(stamps_ns, report=report, native=native, **columns)
    return everything if report.rows == n else everything._rows(keep)


def _known(column: Array) -> Array:
    """The column with NaN for infinite numbers, which mean that a value is not known; as it is where it has none."""
    return np.where(np.isinf(column), np.nan, column) if np.isinf(column).any() else column


def _increasing(stamps_ns: Stamps) -> NDArray[np.bool_]:
    """Which stamps (N,) come later than all kept before; a single leap ahead must not shut out all that follow."""
    keep = np.ones(len(stamps_ns), dtype=np.bool_)
    if len(stamps_ns) < 2:
        return keep
    steps = np.diff(stamps_ns)
    if (steps > 0).all():
        return keep
    before = np.concatenate([[np.iinfo(np.int64).min], stamps_ns[:-2]])
    keep[:-1] = ~((steps < 0) & (stamps_ns[1:] > before))
    rest = stamps_ns[keep]
    later = np.concatenate([[True], rest[1:] > np.maximum.accumulate(rest)[:-1]])
    keep[keep] = later
    return keep


def rms_at(stamps_ns: Stamps, rms_stamps_ns: Stamps, rms: Array) -> Array:
    """Accuracies (N, 3) at ``stamps_ns``, linear between those (M, 3) at ``rms_stamps_ns``; NaN far from any."""
    order = np.flatnonzero(rms_stamps_ns > 0)
    order = order[np.argsort(rms_stamps_ns[order], kind="stable")]
    if not len(order):
        return np.broadcast_to(np.nan, (len(stamps_ns), rms.shape[1]))
    known = rms_stamps_ns[order]
    values = np.where(np.isfinite(rms[order]) & (rms[order] >= 0.0), rms[order], np.nan)
    # Floats hold nanoseconds of today to 0.2 µs only: count from the first.
    at, base = (stamps_ns - known[0]).astype(np.float64), (known - known[0]).astype(np.float64)
    right = np.clip(np.searchsorted(known, stamps_ns), 0, len(known) - 1)
    left = np.maximum(right - 1, 0)
    far = np.minimum(np.abs(at - base[left]), np.abs(at - base[right])) > MAX_RMS_AGE_NS
    joined = np.empty((len(stamps_ns), rms.shape[1]))
    for k in range(rms.shape[1]):
        joined[:, k] = np.interp(at, base, values[:, k])
    joined[far] = np.nan
    return joined
