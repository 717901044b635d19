"""Velocities against the differences of positions."""

from __future__ import annotations

import numpy as np
from applanix_encoders import drive

from scpf.ingest.velocity_frame import agrees, misfits, sample_pairs, velocity_from_positions


def test_velocity_of_a_straight_drive() -> None:
    d = drive(4)
    stamps = np.rint(d.unix_s * 1e9).astype(np.int64)
    velocity = velocity_from_positions(stamps, d.latitude, d.longitude, d.height)
    north, east, down = d.velocity_ned[0]
    np.testing.assert_allclose(velocity, np.tile([east, north, -down], (2, 1)), rtol=1e-4)


def test_the_right_candidate_fits_best() -> None:
    d = drive(40)
    stamps = np.rint(d.unix_s * 1e9).astype(np.int64)
    north, east, down = d.velocity_ned.T
    candidates = {"right": np.column_stack([east, north, -down]), "wrong": d.velocity_ned}
    found, speed = misfits(stamps, (d.latitude, d.longitude, d.height), candidates)
    assert agrees(found["right"], speed)
    assert not agrees(found["wrong"], speed)


def test_no_usable_pair_is_no_verdict() -> None:
    stamps, same = np.array([5, 5], dtype=np.int64), np.full(2, 43.0)
    found, speed = misfits(stamps, (same, same, same), {"any": np.zeros((2, 3))})
    assert np.isnan(found["any"])
    assert np.isnan(speed)


def test_pairs_are_neighbours_inside_the_file() -> None:
    for count in (2, 3, 100, 1_000_000):
        rows = sample_pairs(count).reshape(-1, 2)
        assert (np.diff(rows, axis=1) == 1).all()
        assert rows.min() == 0
        assert rows.max() == count - 1
        assert len(rows) <= 10_000
