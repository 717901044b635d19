"""Shapes of the simulated world: meshes, vehicles and textures."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from scpf.sample_logs.materials import Material
from scpf.sample_logs.mesh import Mesh, MeshBuilder
from scpf.sample_logs.textures import Textures, make_textures
from scpf.sample_logs.vehicles import Vehicle, vehicle


@pytest.mark.parametrize("kind", list(Vehicle))
def test_vehicles_stand_on_the_ground_and_face_outwards(kind: Vehicle) -> None:
    mesh = vehicle(kind)
    assert mesh.vertices[:, 2].min() == pytest.approx(0.0, abs=0.02)
    assert mesh.vertices[:, 0].max() == pytest.approx(-mesh.vertices[:, 0].min(), abs=0.1)
    assert _outward_share(mesh) > 0.85


def test_shapes_face_outwards() -> None:
    box, ball, tube = MeshBuilder(), MeshBuilder(), MeshBuilder()
    box.box([0, 0, 0], [1, 2, 3], Material.PLAIN, yaw_rad=0.3)
    ball.ellipsoid([0, 0, 0], [1, 2, 3], Material.PLAIN)
    tube.tube([[0, 0, -1], [0, 0, 0], [0, 0, 1]], [0.5, 0.4, 0.3], 9, Material.PLAIN, cap=True)
    for builder in (box, ball, tube):
        assert _outward_share(builder.build()) == 1.0


def test_textures_repeat_and_levels_fit() -> None:
    one, two, other = make_textures(1), make_textures(1), make_textures(2)
    assert all(np.array_equal(getattr(one, f.name), getattr(two, f.name)) for f in fields(Textures))
    assert not np.array_equal(one.noise, other.noise)
    assert one.noise_offset[-1] == one.noise.shape[1] - 1  # the coarsest level is one texel
    assert one.card_offset[-1, -1] + (one.card_size >> 5) ** 2 == len(one.card_alpha)
    for card in range(3):  # far crowns do not thin
        shares = []
        for level in range(4):
            size = one.card_size >> level
            texels = one.card_alpha[one.card_offset[card, level] :][: size * size]
            shares.append((texels > 110).mean())
        assert 0.15 < shares[0] < 0.85
        np.testing.assert_allclose(shares, shares[0], atol=0.06)


def _outward_share(mesh: Mesh) -> float:
    """Share of the surface whose geometric normal leads away from the middle of the mesh."""
    corners = mesh.vertices[mesh.faces].astype(float)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    middle = (mesh.vertices.max(axis=0) + mesh.vertices.min(axis=0)) / 2
    outwards = np.sum(across * (corners.mean(axis=1) - middle), axis=1) > -1e-9
    area = np.linalg.norm(across, axis=1)
    return float(area[outwards].sum() / area.sum())
