"""Where a ray meets a face that the rasteriser found for it."""

from __future__ import annotations

from typing import Any, NamedTuple

from scpf.sample_logs.kernels import along, cross, dot, inlined, minus, rotated, transformed, unit_vector


class Hit(NamedTuple):
    """Where a ray meets a face."""

    point: Any
    distance_m: Any
    u: Any
    v: Any
    face_normal: Any
    """Of the plane of the face, towards the eye."""
    normal: Any
    """Smoothed over the faces."""


@inlined
def meet(meshes: Any, T: Any, first_vertex: Any, face: Any, origin: Any, direction: Any) -> Any:
    """The spot of a face that a ray meets, never outside of the face (Möller and Trumbore, 1997)."""
    vertices = meshes.vertices
    i, j = first_vertex + meshes.faces[face, 0], first_vertex + meshes.faces[face, 1]
    k = first_vertex + meshes.faces[face, 2]
    a = transformed(T, vertices[i, 0], vertices[i, 1], vertices[i, 2])
    side_b = minus(transformed(T, vertices[j, 0], vertices[j, 1], vertices[j, 2]), a)
    side_c = minus(transformed(T, vertices[k, 0], vertices[k, 1], vertices[k, 2]), a)
    across = cross(direction, side_c)
    volume = dot(side_b, across)
    if volume == 0.0:
        volume = 1e-12
    from_a = minus(origin, a)
    turned = cross(from_a, side_b)
    distance = dot(side_c, turned) / volume
    share_b = min(max(dot(from_a, across) / volume, 0.0), 1.0)
    share_c = min(max(dot(direction, turned) / volume, 0.0), 1.0 - share_b)
    if not distance > 0.05:
        distance = 0.05
    share_a = 1.0 - share_b - share_c
    uv, n = meshes.uv, meshes.normals
    normal = rotated(
        T,
        (
            share_a * n[face, 0, 0] + share_b * n[face, 1, 0] + share_c * n[face, 2, 0],
            share_a * n[face, 0, 1] + share_b * n[face, 1, 1] + share_c * n[face, 2, 1],
            share_a * n[face, 0, 2] + share_b * n[face, 1, 2] + share_c * n[face, 2, 2],
        ),
    )
    return Hit(
        along(origin, direction, distance),
        distance,
        share_a * uv[face, 0, 0] + share_b * uv[face, 1, 0] + share_c * uv[face, 2, 0],
        share_a * uv[face, 0, 1] + share_b * uv[face, 1, 1] + share_c * uv[face, 2, 1],
        unit_vector(cross(side_b, side_c)),
        unit_vector(normal),
    )
