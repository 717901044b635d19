"""The scene that the renderer draws: packed prototypes, and the instances that stand in the world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scpf.sample_logs.mesh import Mesh, rotation_z

Floats = NDArray[np.float64]
PARAMETERS = 8


@dataclass(frozen=True)
class Scene:
    """P prototypes, their meshes one after the other in shared arrays, and N instances of them.

    The frame is ``map_local``: metres, x east, y north, z up.
    """

    vertices: NDArray[np.float32]
    """(V, 3), in the frame of the prototype."""
    faces: NDArray[np.int32]
    """(F, 3), counted from the prototype's own first vertex."""
    uv: NDArray[np.float32]
    """(F, 3, 2)."""
    normals: NDArray[np.float32]
    """(F, 3, 3), unit length."""
    materials: NDArray[np.uint8]
    """(F,), numbers of Material."""
    first_vertex: NDArray[np.int64]
    first_face: NDArray[np.int64]
    face_count: NDArray[np.int64]
    vertex_count: NDArray[np.int64]
    alpha_card: NDArray[np.int64]
    """(P,), the leaf card that cuts holes into the faces, -1 where they are opaque."""
    cull_backfaces: NDArray[np.bool_]
    centre_m: Floats
    """(P, 3), middle of the prototype's bounding box, in its own frame."""
    radius_m: Floats
    """(P,), of the sphere about centre_m that holds it all."""
    prototype: NDArray[np.int64]
    """(N,), which prototype the instance shows."""
    T_map_local: Floats
    """(N, 3, 4), from the prototype's frame to map_local, uniform scale within."""
    tint: Floats
    """(N, 3), linear reflectance, red, green, blue."""
    instance_id: NDArray[np.int64]
    """(N,), 1..999 a landmark pole, 1000 and above another lamp, 0 all else."""
    parameters: Floats
    """(N, 8), for the shading of its material."""
    lod_range_m: Floats
    """(N, 2), distances from the camera between which the instance is shown."""
    is_ground: NDArray[np.bool_]

    @cached_property
    def instance_centre_m(self) -> Floats:
        """(N, 3), centres of the instances' bounding spheres in map_local."""
        turned = np.einsum("nij,nj->ni", self.T_map_local[:, :, :3], self.centre_m[self.prototype])
        return np.asarray(turned + self.T_map_local[:, :, 3])

    @cached_property
    def instance_radius_m(self) -> Floats:
        """(N,), radii of the instances' bounding spheres."""
        scale = np.linalg.norm(self.T_map_local[:, :, :3], axis=1).max(axis=1)
        return np.asarray(self.radius_m[self.prototype] * scale)

    def with_instances(
        self, prototypes: ArrayLike, T_map_local: ArrayLike, tints: ArrayLike, parameters: ArrayLike
    ) -> Scene:
        """This scene and the moving objects of one moment: (M,), (M, 3, 4), (M, 3), (M, up to 8)."""
        index = np.asarray(prototypes, np.int64).reshape(-1)
        count = len(index)
        given = np.asarray(parameters, np.float64).reshape(count, -1) if count else np.zeros((0, PARAMETERS))
        padded = np.zeros((count, PARAMETERS))
        padded[:, : given.shape[1]] = given
        more = {
            "prototype": index,
            "T_map_local": np.asarray(T_map_local, np.float64).reshape(count, 3, 4),
            "tint": np.asarray(tints, np.float64).reshape(count, 3),
            "instance_id": np.zeros(count, np.int64),
            "parameters": padded,
            "lod_range_m": np.tile([0.0, 1e9], (count, 1)),
            "is_ground": np.zeros(count, np.bool_),
        }
        return replace(self, **{name: np.concatenate([getattr(self, name), more[name]]) for name in more})


class _Instance(NamedTuple):
    prototype: int
    T_map_local: Floats
    tint: tuple[float, ...]
    instance_id: int
    parameters: Floats
    lod_range_m: tuple[float, float]
    is_ground: bool


class SceneBuilder:
    """Takes prototypes and places instances of them; ``build`` packs both."""

    def __init__(self) -> None:
        self._meshes: list[Mesh] = []
        self._alpha_cards: list[int] = []
        self._culled: list[bool] = []
        self._instances: list[_Instance] = []

    def add_prototype(self, mesh: Mesh, alpha_card: int = -1, cull_backfaces: bool = False) -> int:
        """Add a mesh to be placed; returns its number. ``alpha_card`` names the leaf card of its faces."""
        self._meshes.append(mesh)
        self._alpha_cards.append(alpha_card)
        self._culled.append(cull_backfaces)
        return len(self._meshes) - 1

    def place(
        self,
        prototype: int,
        position_m: ArrayLike,
        yaw_rad: float = 0.0,
        scale: float = 1.0,
        tint: ArrayLike = (0.5, 0.5, 0.5),
        instance_id: int = 0,
        parameters: Sequence[float] = (),
        lod_range_m: tuple[float, float] = (0.0, 1e9),
        lean: tuple[float, float] = (0.0, 0.0),
        is_ground: bool = False,
    ) -> None:
        """Stand an instance at position_m (3,), turned by yaw_rad; ``lean`` is how far its top goes to
        x and y per metre of height."""
        padded = np.zeros(PARAMETERS)
        padded[: len(parameters)] = parameters
        pose = placement(position_m, yaw_rad, scale, lean)
        colour = tuple(float(value) for value in np.asarray(tint, np.float64))
        self._instances.append(
            _Instance(prototype, pose, colour, instance_id, padded, lod_range_m, is_ground)
        )

    def build(self) -> Scene:
        """Pack all that was added and placed."""
        meshes, instances = self._meshes, self._instances
        vertex_count = np.array([len(mesh.vertices) for mesh in meshes], np.int64)
        face_count = np.array([len(mesh.faces) for mesh in meshes], np.int64)
        centres = [(mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2.0 for mesh in meshes]
        radii = [
            np.linalg.norm(mesh.vertices - centre, axis=1).max()
            for mesh, centre in zip(meshes, centres, strict=True)
        ]
        return Scene(
            vertices=np.concatenate([mesh.vertices for mesh in meshes]),
            faces=np.concatenate([mesh.faces for mesh in meshes]),
            uv=np.concatenate([mesh.uv for mesh in meshes]),
            normals=np.concatenate([mesh.normals for mesh in meshes]),
            materials=np.concatenate([mesh.materials for mesh in meshes]),
            first_vertex=np.cumsum(vertex_count) - vertex_count,
            first_face=np.cumsum(face_count) - face_count,
            face_count=face_count,
            vertex_count=vertex_count,
            alpha_card=np.array(self._alpha_cards, np.int64),
            cull_backfaces=np.array(self._culled, np.bool_),
            centre_m=np.array(centres, np.float64),
            radius_m=np.array(radii, np.float64),
            prototype=np.array([one.prototype for one in instances], np.int64),
            T_map_local=np.array([one.T_map_local for one in instances]),
            tint=np.array([one.tint for one in instances]),
            instance_id=np.array([one.instance_id for one in instances], np.int64),
            parameters=np.array([one.parameters for one in instances]),
            lod_range_m=np.array([one.lod_range_m for one in instances], np.float64),
            is_ground=np.array([one.is_ground for one in instances], np.bool_),
        )


def placement(
    position_m: ArrayLike, yaw_rad: float, scale: float = 1.0, lean: tuple[float, float] = (0.0, 0.0)
) -> Floats:
    """T_map_local (3, 4) of an object at position_m (3,), turned by yaw_rad, leaning a little."""
    tilt = np.array([[1.0, 0.0, lean[0]], [0.0, 1.0, lean[1]], [-lean[0], -lean[1], 1.0]])
    return np.column_stack([tilt @ rotation_z(yaw_rad) * scale, np.asarray(position_m, np.float64)])
