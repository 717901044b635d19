"""Geodetic conversions and the one place for angle conventions."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from scpf.models.geodesy import (
    Origin,
    enu_from_geodetic,
    geodetic_from_enu,
    rotation_from_ned,
    wrap_angle,
    yaw_from_heading,
)

ORIGIN = Origin(43.4712, -80.5449, 334.0)


@given(st.lists(st.tuples(*[st.floats(-3000, 3000)] * 2, st.floats(-50, 50)), min_size=1, max_size=5))
def test_local_and_geodetic_are_inverse(points: list[tuple[float, float, float]]) -> None:
    enu = np.array(points)
    np.testing.assert_allclose(enu_from_geodetic(*geodetic_from_enu(enu, ORIGIN), ORIGIN), enu, atol=1e-6)


def test_north_is_north_and_a_degree_has_its_length() -> None:
    latitude = np.array([ORIGIN.latitude_deg + 0.01])
    enu = enu_from_geodetic(latitude, np.array([ORIGIN.longitude_deg]), np.array([ORIGIN.height_m]), ORIGIN)[
        0
    ]
    # Meridional radius of WGS 84 at 43.47° north, times 0.01°, at 334 m height.
    assert abs(enu[0]) < 1e-6
    np.testing.assert_allclose(enu[1], 1111.07, atol=0.1)
    assert -0.2 < enu[2] < 0.0  # the earth curves away


@given(st.floats(-50, 50))
def test_angles_wrap_to_one_turn(angle: float) -> None:
    wrapped = float(wrap_angle(np.array(angle)))
    assert -np.pi < wrapped <= np.pi
    np.testing.assert_allclose([np.cos(wrapped), np.sin(wrapped)], [np.cos(angle), np.sin(angle)], atol=1e-9)


def test_headings_become_yaws() -> None:
    headings = np.radians([0.0, 90.0, 180.0, 270.0])
    np.testing.assert_allclose(np.degrees(yaw_from_heading(headings)), [90.0, 0.0, -90.0, 180.0])


def test_attitudes_change_frames_as_their_axes_do() -> None:
    # A body level, heading East, in North-East-Down: its x axis is East, its y axis (right) is South.
    R_ned_frd = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(rotation_from_ned(R_ned_frd), np.eye(3), atol=1e-12)
