"""Unix times as weeks and times of week, which the raw logs of receivers count in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import InputError

Stamps = NDArray[np.int64]

GPS_EPOCH_UNIX_S = 315_964_800
"""1980-01-06."""
WEEK_NS = 604_800 * 10**9
LEAP_SECONDS = 18
"""GPS − UTC since 2017."""
SINCE_NS = 1_483_228_800 * 10**9
"""2017-01-01."""


def weeks_of(stamps_ns: Stamps) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """GPS weeks (N,), without roll-over, and nanoseconds of the week (N,), of Unix times (UTC, ns).

    Raises InputError before 2017, when there were fewer leap seconds.
    """
    if len(stamps_ns) and int(stamps_ns.min()) < SINCE_NS:
        raise InputError(
            "a simulated drive before 2017", "let it begin later: leap seconds are those since then"
        )
    gps_ns = np.asarray(stamps_ns, dtype=np.int64) + (LEAP_SECONDS - GPS_EPOCH_UNIX_S) * 10**9
    return gps_ns // WEEK_NS, gps_ns % WEEK_NS
