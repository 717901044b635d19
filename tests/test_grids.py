"""Grids against PROJ's own UTM and its convergence."""

from __future__ import annotations

import numpy as np
import pytest

from scpf.models.errors import UsageError
from scpf.models.grids import Grid, from_geodetic, from_grid_north, to_geodetic, utm


@pytest.mark.parametrize(("zone", "epsg", "northing"), [("17N", 32617, 4.8e6), ("33s", 32733, 7.2e6)])
def test_utm_is_the_utm_of_the_registry(zone: str, epsg: int, northing: float) -> None:
    from pyproj import Transformer

    easting = np.array([300e3, 500e3, 640e3])
    latitude, longitude, _ = to_geodetic(utm(zone), easting, np.full(3, northing))
    expected = Transformer.from_crs(f"EPSG:{epsg}", "EPSG:4326").transform(easting, np.full(3, northing))
    np.testing.assert_allclose([latitude, longitude], expected, rtol=0, atol=1e-10)


def test_convergence_is_that_of_the_projection() -> None:
    from pyproj import Proj

    easting, northing = np.array([300e3, 500e3, 640e3]), np.full(3, 4.8e6)
    latitude, longitude, convergence = to_geodetic(utm("17N"), easting, northing)
    factors = Proj(proj="utm", zone=17, ellps="WGS84").get_factors(longitude, latitude)
    np.testing.assert_allclose(np.degrees(convergence), factors.meridian_convergence, rtol=0, atol=1e-3)


def test_grid_north_has_the_heading_of_the_convergence() -> None:
    """A step along the grid's North, seen on the earth."""
    latitude, longitude, convergence = to_geodetic(
        utm("17N"), np.full(2, 623e3), np.array([4848e3, 4848.1e3])
    )
    east = np.diff(longitude)[0] * np.cos(np.radians(latitude[0])) * 6.388e6
    north = np.diff(latitude)[0] * 6.366e6
    heading = np.arctan2(east, north)
    assert heading == pytest.approx(convergence[0], abs=1e-3)
    turned = from_grid_north(np.array([[0.0, 1.0, 0.5]]), convergence[:1])[0]
    np.testing.assert_allclose(turned, [np.sin(heading), np.cos(heading), 0.5], atol=1e-3)


def test_beyond_the_grid_is_no_place() -> None:
    latitude, *_ = to_geodetic(utm("17N"), np.array([5e5, 1e300, np.nan]), np.full(3, 4.8e6))
    assert np.isfinite(latitude).tolist() == [True, False, False]


@pytest.mark.parametrize("zone", ["0N", "61N", "17", "N17", "17X", ""])
def test_zones_that_are_none(zone: str) -> None:
    with pytest.raises(UsageError):
        utm(zone)


def test_the_grid_of_a_header() -> None:
    assert utm("17N") == Grid(-81.0, 0.0, 0.9996, 500_000.0, 0.0)


def test_there_and_back() -> None:
    latitude, longitude = np.array([43.47, -33.9, 0.5]), np.array([-80.54, -79.0, -83.9])
    for zone in ("17N", "17S"):
        back = to_geodetic(utm(zone), *from_geodetic(utm(zone), latitude, longitude))
        np.testing.assert_allclose(back[0], latitude, atol=1e-9)
        np.testing.assert_allclose(back[1], longitude, atol=1e-9)
    easting, northing = from_geodetic(utm("17N"), np.array([43.4723]), np.array([-80.5449]))
    assert easting[0] == pytest.approx(536_800, abs=30)
    assert northing[0] == pytest.approx(4_813_500, abs=300)
