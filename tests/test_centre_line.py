"""The centre line: arc length, direction and curvature against circles and straight roads."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from scpf.models.errors import InputError
from scpf.sample_logs.centre_line import CentreLine

RADIUS_M = 120.0


def circle(sides: int = 90) -> NDArray[np.float64]:
    angle = 2 * np.pi * np.arange(sides) / sides
    return RADIUS_M * np.column_stack([np.cos(angle), np.sin(angle)])


def test_a_circle_has_its_length_curvature_and_offsets() -> None:
    line = CentreLine(circle(), closed=True)
    assert line.length_m == pytest.approx(2 * np.pi * RADIUS_M, rel=3e-3)
    s = np.linspace(-50.0, 3 * line.length_m, 500)
    position, tangent, normal = line.at(s, 4.0)  # the left of a counter-clockwise circle is its inside
    assert np.linalg.norm(position[:, :2], axis=1) == pytest.approx(RADIUS_M - 4.0, abs=0.3)
    assert line.curvature_per_m(s) == pytest.approx(1 / RADIUS_M, rel=0.05)
    np.testing.assert_allclose(np.linalg.norm(tangent, axis=1), 1.0)
    np.testing.assert_allclose(np.einsum("ij,ij->i", tangent, normal), 0.0, atol=1e-12)


def test_s_is_the_length_that_one_drives() -> None:
    line = CentreLine(circle(24), closed=True)
    fine = np.linspace(10.0, 310.0, 30001)
    position, _, _ = line.at(fine)
    assert np.hypot(*np.diff(position[:, :2], axis=0).T).sum() == pytest.approx(300.0, abs=0.01)


def test_a_closed_line_has_no_seam() -> None:
    line = CentreLine(circle(), closed=True)
    before, after = line.at(line.length_m - 1e-6), line.at(1e-6)
    for one, other in zip(before, after, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-4)


def test_an_open_line_keeps_its_ends_and_goes_on_straight() -> None:
    line = CentreLine([[0.0, 0.0], [60.0, 0.0], [120.0, 40.0]])
    np.testing.assert_allclose(line.at(0.0)[0], [0.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(line.at(line.length_m)[0], [120.0, 40.0, 0.0], atol=1e-9)
    end, tangent, _ = line.at(line.length_m)
    np.testing.assert_allclose(line.at(line.length_m + 30.0)[0][:2], end[:2] + 30.0 * tangent)
    assert line.curvature_per_m(line.length_m + 30.0) == 0.0


def test_projection_undoes_at() -> None:
    line = CentreLine(circle(), closed=True)
    rng = np.random.default_rng(3)
    s, offset = rng.uniform(0, line.length_m, 200), rng.uniform(-9.0, 9.0, 200)
    points = line.at(s, offset)[0][:, :2]
    found_s, found_offset = line.project(points)
    np.testing.assert_allclose(found_s, s, atol=0.01)
    np.testing.assert_allclose(found_offset, offset, atol=0.01)
    np.testing.assert_allclose(line.distance_m(points), np.abs(offset), atol=0.02)


@pytest.mark.parametrize("points", [[[0, 0]], [[0, 0], [5, 0]], [[0, 0], [np.nan, 3], [90, 0]]])
def test_what_is_no_road_is_refused(points: list[list[float]]) -> None:
    with pytest.raises(InputError):
        CentreLine(points)
