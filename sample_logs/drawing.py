"""From a Scene to the visibility buffer, the light maps, and the pixels that a pole would have alone."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from scpf.sample_logs.drawing_types import NO_FACE, Buffer, Cards, Meshes, View, empty_buffer, scratch_for
from scpf.sample_logs.lens import Lens
from scpf.sample_logs.light_maps import in_map
from scpf.sample_logs.rasteriser import draw
from scpf.sample_logs.scene import Scene
from scpf.sample_logs.shading import Shown
from scpf.sample_logs.shading_light import HeightMap
from scpf.sample_logs.shading_textures import Images, Noise
from scpf.sample_logs.sub_samples import count_pixels, empty_sub_samples
from scpf.sample_logs.textures import Textures

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

LANDMARKS = 1000
"""Instance ids above 0 and below this are landmark poles."""
LOWEST_M = -1e9
ALONG_RAYS = View(True, 1.0, 0.0, 0.0, 0.0)


def meshes_of(scene: Scene) -> Meshes:
    """The scene's prototypes as kernels take them."""
    return Meshes(*(np.ascontiguousarray(getattr(scene, name)) for name in Meshes._fields))


def cards_of(textures: Textures) -> Cards:
    """The holes of the leaf cards as kernels take them."""
    return Cards(textures.card_alpha, textures.card_offset, textures.card_size)


def images_of(textures: Textures, sky: NDArray[np.float32]) -> Images:
    """All textures as kernels take them."""
    size = math.isqrt(int(textures.noise_offset[1] - textures.noise_offset[0]))
    return Images(
        Noise(textures.noise, textures.noise_offset, size),
        textures.grass,
        textures.grass_offset,
        textures.grass_size,
        textures.card_luminance,
        textures.card_offset,
        textures.card_size,
        textures.signs,
        sky,
    )


def shown(scene: Scene, index: Indices) -> Shown:
    """The instances ``index`` in that order, with the numbers that their faces get."""
    prototype = scene.prototype[index]
    counts = scene.face_count[prototype]
    pole = scene.instance_id[index]
    return Shown(
        np.repeat(np.arange(len(index), dtype=np.int32), counts),
        np.cumsum(counts) - counts,
        prototype,
        np.ascontiguousarray(scene.T_map_local[index]),
        scene.tint[index],
        scene.parameters[index],
        np.where((pole > 0) & (pole < LANDMARKS), pole, 0),
    )


class Canvas:
    """The buffers that scenes are drawn into, for one lens and one set of prototypes."""

    def __init__(self, lens: Lens, scene: Scene, textures: Textures) -> None:
        self.lens = lens
        self.buffer = empty_buffer(lens.rows, lens.columns)
        self.meshes, self.cards = meshes_of(scene), cards_of(textures)
        self._scratch = scratch_for(self.meshes)
        pixels = lens.pixels
        # A sub-sample lies a quarter of a step right or left and up or down of its pixel's middle.
        steps = [np.abs(np.diff(values, axis=axis)).max() for values in pixels for axis in (0, 1)]
        self._reach = math.ceil(0.5 * max(steps)) + 1
        self._row_bounds = pixels.y.min(axis=1), pixels.y.max(axis=1)
        self._column_bounds = pixels.x.min(axis=0), pixels.x.max(axis=0)

    def draw(self, instances: Shown, T_camera_map: Floats) -> None:
        """Fill the buffer with what the camera sees of the instances."""
        self.buffer.nearness.fill(0.0)
        self.buffer.face.fill(NO_FACE)
        self._draw(self.buffer, self.lens.view, instances, T_camera_map)

    def height_map(
        self, scene: Scene, chosen: NDArray[np.bool_], T_texel_map: Floats, buffer: Buffer
    ) -> HeightMap:
        """The chosen instances seen along parallel rays, drawn into a square buffer of its own."""
        buffer.nearness.fill(LOWEST_M)
        index = in_map(scene, chosen, T_texel_map, len(buffer.nearness))
        self._draw(buffer, ALONG_RAYS, shown(scene, index), T_texel_map)
        return HeightMap(buffer.nearness, T_texel_map)

    def pixels_alone(self, scene: Scene, index: Indices, T_camera_map: Floats) -> dict[int, int]:
        """How many pixels each pole among the instances would have if it stood alone, where that is any;
        overwrites the buffer."""
        ids = shown(scene, index).pole_id
        counts = {
            int(pole): self._pixels_of(shown(scene, index[ids == pole]), T_camera_map)
            for pole in np.unique(ids[ids > 0])
        }
        return {pole: count for pole, count in counts.items() if count > 0}

    def _pixels_of(self, pole: Shown, T_camera_map: Floats) -> int:
        low_x, low_y, high_x, high_y = self._bounds(pole, T_camera_map)
        rows, columns = self.buffer.face.shape
        reach, border = self._reach, 2 * self._reach + 1  # pixels that may see the pole; what those may read
        cleared = (
            slice(max(0, low_y - border), min(rows, high_y + border + 1)),
            slice(max(0, low_x - border), min(columns, high_x + border + 1)),
        )
        self.buffer.nearness[cleared] = 0.0
        self.buffer.face[cleared] = NO_FACE
        self._draw(self.buffer, self.lens.view, pole, T_camera_map)
        bounds = tuple(
            float(value) for value in (low_x - reach, low_y - reach, high_x + reach, high_y + reach)
        )
        image_columns = _touching(self._column_bounds, bounds[0], bounds[2])
        image_rows = _touching(self._row_bounds, bounds[1], bounds[3])
        faces, samples = self.buffer.face, empty_sub_samples()
        return int(count_pixels(self.lens.pixels, faces, image_rows, image_columns, bounds, samples))

    def _bounds(self, instances: Shown, T_camera_map: Floats) -> tuple[int, int, int, int]:
        """First and last column and row of the buffer that the instances can touch."""
        rows, columns = self.buffer.face.shape
        view, points = self.lens.view, []
        for prototype, T in zip(
            instances.prototype, _through(T_camera_map, instances.T_map_local), strict=True
        ):
            points.append(
                _before_the_camera(self._corners(int(prototype)) @ T[:, :3].T + T[:, 3], view.near_m)
            )
        found = np.concatenate(points)
        if not len(found):
            return 0, 0, -1, -1
        x = np.clip(view.focal * found[:, 0] / found[:, 2] + view.centre_x, 0, columns - 1)
        y = np.clip(view.focal * found[:, 1] / found[:, 2] + view.centre_y, 0, rows - 1)
        return int(x.min()), int(y.min()), int(x.max()), int(y.max())

    def _corners(self, prototype: int) -> Floats:
        """The corners (F, 3, 3) of a prototype's faces, in its own frame."""
        meshes = self.meshes
        first = meshes.first_face[prototype]
        faces = meshes.faces[first : first + meshes.face_count[prototype]]
        return np.asarray(meshes.vertices[meshes.first_vertex[prototype] + faces], np.float64)

    def _draw(self, buffer: Buffer, view: View, instances: Shown, T_view_map: Floats) -> None:
        T_view_local = _through(T_view_map, instances.T_map_local)
        first_number = instances.first_number
        prototype = instances.prototype
        draw(buffer, view, self.meshes, self.cards, prototype, T_view_local, first_number, self._scratch)


def _through(T_view_map: Floats, T_map_local: Floats) -> Floats:
    """T_view_local (n, 3, 4) of T_view_map (3, 4) and T_map_local (n, 3, 4)."""
    T: Floats = np.einsum("ij,njk->nik", T_view_map[:, :3], T_map_local)
    T[:, :, 3] += T_view_map[:, 3]
    return T


def _before_the_camera(corners: Floats, near_m: float) -> Floats:
    """Points (n, 3) about all of the faces with corners (F, 3, 3) that lies beyond the near plane."""
    following = np.roll(corners, -1, axis=1)
    z, z_after = corners[..., 2], following[..., 2]
    crosses = (z >= near_m) != (z_after >= near_m)
    share = (near_m - z[crosses]) / (z_after[crosses] - z[crosses])
    cut = corners[crosses] + share[:, None] * (following[crosses] - corners[crosses])
    cut[:, 2] = near_m
    return np.concatenate([corners[z >= near_m], cut])


def _touching(
    bounds: tuple[NDArray[np.float32], NDArray[np.float32]], low: float, high: float
) -> tuple[int, int]:
    """First row (or column) of the image that looks at low to high of the buffer, and the one after the last."""
    found = np.nonzero((bounds[1] >= low) & (bounds[0] <= high))[0]
    return (int(found[0]), int(found[-1]) + 1) if len(found) else (0, 0)
