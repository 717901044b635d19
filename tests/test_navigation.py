"""The common record: which rows it keeps, and its change of frames."""

from __future__ import annotations

import numpy as np
import pytest

from scpf.ingest.navigation import Navigation, make_navigation, rms_at
from scpf.ingest.read_report import ReadReport
from scpf.models.errors import DamagedError, MissingError
from scpf.models.geodesy import Origin, ecef_from_enu, geodetic_from_enu
from scpf.models.trajectory import yaw_of

ORIGIN = Origin(43.4723, -80.5449, 300.0)


def _navigation(stamps: list[int], **columns: np.ndarray) -> Navigation:
    n = len(stamps)
    place = tuple(
        columns.pop(name, np.full(n, value))
        for name, value in zip(("latitude", "longitude", "height"), ORIGIN, strict=True)
    )
    report = ReadReport("file", "test")
    return make_navigation(report, np.array(stamps, dtype=np.int64), place, {}, columns)


@pytest.mark.parametrize(("heading_deg", "yaw_deg"), [(0.0, 90.0), (90.0, 0.0), (20.0, 70.0), (270.0, 180.0)])
def test_heading_becomes_yaw(heading_deg: float, yaw_deg: float) -> None:
    pose = _navigation([1], heading_rad=np.radians([heading_deg])).to_trajectory(ORIGIN).poses()[0]
    assert abs(np.degrees(yaw_of(pose))) == pytest.approx(abs(yaw_deg), abs=1e-9)


def test_roll_lowers_the_right_side_and_pitch_raises_the_nose() -> None:
    angles = {
        name: np.radians([value])
        for name, value in (("heading_rad", 30.0), ("pitch_rad", 5.0), ("roll_rad", 3.0))
    }
    pose = _navigation([1], **angles).to_trajectory(ORIGIN).poses()[0]
    assert pose[2, 0] == pytest.approx(np.sin(np.radians(5.0)))  # forward points up
    right = -pose[:3, 1]
    assert right[2] == pytest.approx(-np.sin(np.radians(3.0)) * np.cos(np.radians(5.0)))


def test_north_turns_with_the_place() -> None:
    """A body that heads for true North five kilometres east of the origin does not head along y of map."""
    latitude, longitude, height = geodetic_from_enu(
        np.array([[5000.0, 0.0, 0.0], [5000.0, 1.0, 0.0]]), ORIGIN
    )
    navigation = _navigation(
        [1, 2], latitude=latitude, longitude=longitude, height=height, heading_rad=np.zeros(2)
    )
    yaw = yaw_of(navigation.to_trajectory(ORIGIN).poses()[0])
    # The meridians' convergence: Δλ·sin φ.
    convergence = np.radians(longitude[0] - ORIGIN.longitude_deg) * np.sin(np.radians(ORIGIN.latitude_deg))
    assert yaw - np.pi / 2 == pytest.approx(convergence, rel=1e-3)


def test_axes_of_east_north_up_at_the_equator() -> None:
    np.testing.assert_allclose(
        ecef_from_enu(np.array([0.0]), np.array([0.0]))[0], [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-12
    )


def test_rows_that_cannot_be_used_are_counted() -> None:
    latitude = np.array([43.0, np.nan, 43.0, 0.0, 43.0, 95.0, 43.0])
    zero = np.array([-80.0, -80.0, -80.0, 0.0, -80.0, -80.0, -80.0])
    height = np.array([300.0, 300.0, 300.0, 0.0, np.inf, 300.0, 300.0])
    navigation = _navigation([1, 2, 0, 4, 5, 6, 7], latitude=latitude, longitude=zero, height=height)
    assert navigation.stamps_ns.tolist() == [1, 7]
    assert navigation.report.rows == 2
    assert navigation.report.dropped == {
        "record without a usable time": 1,
        "record before the first position (all zero)": 1,
        "record whose position is not on the earth": 3,
    }


def test_one_leap_ahead_does_not_shut_out_what_follows() -> None:
    assert _navigation([1, 2, 900, 3, 4, 4, 5]).stamps_ns.tolist() == [1, 2, 3, 4, 5]


def test_no_row_at_all_is_an_error_that_says_why() -> None:
    with pytest.raises(DamagedError, match="without a usable time: 2"):
        _navigation([0, 0])


def test_longitudes_beyond_180_are_west() -> None:
    assert _navigation([1], longitude=np.array([279.5])).longitude_deg[0] == pytest.approx(-80.5)


def test_positions_without_a_heading_are_no_trajectory() -> None:
    with pytest.raises(MissingError, match="without a heading"):
        _navigation([1, 2]).to_trajectory(ORIGIN)


def test_rows_without_a_heading_are_left_out_of_the_trajectory() -> None:
    navigation = _navigation([1, 2, 3], heading_rad=np.array([0.1, np.nan, 0.3]))
    assert navigation.to_trajectory(ORIGIN).stamps_ns.tolist() == [1, 3]


def test_between_keeps_both_ends() -> None:
    assert _navigation([1, 2, 3, 4]).between(2, 3).stamps_ns.tolist() == [2, 3]


def test_accuracies_are_interpolated_but_not_carried_far() -> None:
    second = 10**9
    base = 1_600_000_000 * second
    known = base + np.array([0, 1, 2], dtype=np.int64) * second
    at = base + np.array([0, 500_000_000, 2 * second, 20 * second], dtype=np.int64)
    joined = rms_at(at, known, np.array([[1.0], [2.0], [4.0]]))
    np.testing.assert_allclose(joined[:3, 0], [1.0, 1.5, 4.0])
    assert np.isnan(joined[3, 0])
    assert np.isnan(rms_at(at, np.zeros(2, dtype=np.int64), np.ones((2, 3)))).all()
