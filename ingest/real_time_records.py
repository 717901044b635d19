"""What GSOF 49/50 and $GRP 1/2 have in common: the same fields under the same names, in other bytes."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.navigation import (
    NativeColumn,
    NativeTable,
    Navigation,
    make_navigation,
    rms_at,
)
from scpf.ingest.read_report import ReadReport
from scpf.models.geodesy import wrap_angle

Array = NDArray[np.float64]
Records = NDArray[np.void]
Stamps = NDArray[np.int64]

AXES: Final = ("longitudinal", "transverse", "down")


def native_table(records: Records, stamps_ns: Stamps, units: dict[str, str]) -> NativeTable:
    """Every field of the records, as it is; ``units``: field → unit."""
    return NativeTable(stamps_ns, {name: NativeColumn(records[name], unit) for name, unit in units.items()})


def navigation_of(
    report: ReadReport,
    records: Records,
    stamps_ns: Stamps,
    rms_records: Records,
    rms_stamps_ns: Stamps,
    native: dict[str, NativeTable],
) -> Navigation:
    """The navigation of records (N,), with the accuracies of ``rms_records`` (M,) where there are any."""
    columns = {
        "velocity_enu_mps": _columns(records, "east_velocity", "north_velocity", "down_velocity")
        * [1, 1, -1],
        "roll_rad": np.radians(_columns(records, "roll")[:, 0]),
        "pitch_rad": np.radians(_columns(records, "pitch")[:, 0]),
        "heading_rad": wrap_angle(np.radians(_columns(records, "heading")[:, 0])),
        "rates_radps": np.radians(_columns(records, *(f"{axis}_angular_rate" for axis in AXES))),
        "accelerations_mps2": _columns(records, *(f"{axis}_acceleration" for axis in AXES)),
    }
    if len(rms_records):

        def joined(*names: str) -> Array:
            return rms_at(stamps_ns, rms_stamps_ns, _columns(rms_records, *names))

        columns |= {
            "position_rms_m": joined("east_position_rms", "north_position_rms", "down_position_rms"),
            "velocity_rms_mps": joined("east_velocity_rms", "north_velocity_rms", "down_velocity_rms"),
            "attitude_rms_rad": np.radians(joined("roll_rms", "pitch_rms", "heading_rms")),
        }
    latitude, longitude, altitude = _columns(records, "latitude", "longitude", "altitude").T
    return make_navigation(report, stamps_ns, (latitude, longitude, altitude), native, columns)


def _columns(table: Records, *names: str) -> Array:
    """Columns (N, M) as float64, with NaN for infinite numbers: not known is what they mean."""
    with np.errstate(invalid="ignore"):  # the cast complains of signalling NaNs
        values = np.column_stack([table[name].astype(np.float64) for name in names])
    return np.where(np.isfinite(values), values, np.nan)
