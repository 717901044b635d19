"""Draws what a camera on a vehicle sees of a scene: picture, pole masks, and how much of each pole is hidden.

Each frame depends on its own arguments alone. A renderer keeps large buffers: use one a process, never two threads on
one.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scpf.models.camera import Camera
from scpf.sample_logs.drawing import Canvas, images_of, shown
from scpf.sample_logs.drawing_types import empty_buffer
from scpf.sample_logs.exposure import automatic_gain, develop, noise_field, tone_curve
from scpf.sample_logs.lamps import lit_lamps
from scpf.sample_logs.lens import lens_of
from scpf.sample_logs.light_maps import (
    ABOVE_TEXELS,
    SUN_TEXELS,
    above_map,
    at_their_level,
    in_view,
    middle_ahead,
    sun_map,
)
from scpf.sample_logs.materials import Material
from scpf.sample_logs.mesh import MeshBuilder
from scpf.sample_logs.optics import add_glare, motion_blur, point_spread
from scpf.sample_logs.rain import add_rain
from scpf.sample_logs.scene import PARAMETERS, Scene, SceneBuilder
from scpf.sample_logs.shading import Eye, shade
from scpf.sample_logs.shading_light import HeightMap, Lighting
from scpf.sample_logs.shading_reflection import NEARNESS_STEP, Done
from scpf.sample_logs.sky import ambient_light, sky_panorama
from scpf.sample_logs.sub_samples import empty_sub_samples
from scpf.sample_logs.textures import Textures
from scpf.sample_logs.traffic import MovingObject
from scpf.sample_logs.weather import WEATHERS, Rgb, Weather

Floats = NDArray[np.float64]

STRONG_GLARE: Final = 1.2
PATIENCE_S: Final = 3.0
NO_MAP: Final = HeightMap(np.zeros((1, 1), np.float32), np.zeros((3, 4)))


@dataclass(frozen=True, eq=False)
class RenderedFrame:
    """One picture with its truth."""

    image: NDArray[np.uint8]
    """(H, W, 3), red, green, blue."""
    instance_ids: NDArray[np.int16]
    """(H, W), the pole that at least two of a pixel's four sub-samples see, 0 for none."""
    visible_fraction: dict[int, float]
    """Of each pole that reaches into the picture: its pixels, over those it would have if it stood alone."""
    depth_m: NDArray[np.float32]
    """(H, W), along the camera's axis, of the nearest face in the pixel; infinite in the sky."""


class Renderer:
    """One camera in one scene and weather; the same arguments give the same bits."""

    def __init__(
        self,
        scene: Scene,
        textures: Textures,
        camera: Camera,
        weather: Weather,
        *,
        seed: int,
        street_lamps_m: ArrayLike = (),
    ) -> None:
        """``street_lamps_m`` (L, 3) are the places in map from which street lamps shine when they are lit.

        Raises InputError for a camera whose lens cannot be drawn, see lens_of.
        """
        self._scene, self._camera, self._weather, self._seed = scene, camera, weather, seed
        self._lamps_m = np.asarray(street_lamps_m, np.float64).reshape(-1, 3)
        self._lens = lens_of(camera)
        self._canvas = Canvas(self._lens, scene, textures)
        sky = sky_panorama(weather, seed)
        self._images = images_of(textures, sky)
        self._sky_rgb, self._ground_rgb = ambient_light(weather, sky)
        self._sun_buffer = empty_buffer(SUN_TEXELS, SUN_TEXELS)
        self._above_buffer = empty_buffer(ABOVE_TEXELS, ABOVE_TEXELS)
        self._noise, self._curve = noise_field(seed), tone_curve()
        size = camera.height_px, camera.width_px
        self._radiance = np.empty((*size, 3), np.float32)
        self._blurred = np.empty_like(self._radiance)

    def render(
        self,
        T_map_body: ArrayLike,
        *,
        speed_mps: float,
        yaw_rate_radps: float,
        exposure_s: float = 0.004,
        moving: Sequence[MovingObject] = (),
        frame_seed: int,
    ) -> RenderedFrame:
        """The frame that the camera takes on a body at T_map_body (4, 4), whose origin is on the road.

        ``moving`` are the objects that the scene does not hold; ``frame_seed`` chooses noise and rain.
        """
        body = np.asarray(T_map_body, np.float64)
        T_map_camera = body @ self._camera.T_body_camera
        T_camera_map: Floats = np.linalg.inv(T_map_camera)[:3].astype(np.float64)
        scene = _with_moving(self._scene, moving)
        chosen, distance_m = at_their_level(scene, T_map_camera[:3, 3])
        index = in_view(scene, chosen, distance_m, T_camera_map, self._lens)
        instances = shown(scene, index)
        lighting = self._lighting(scene, chosen, body, T_map_camera)
        self._canvas.draw(instances, T_camera_map)
        size = self._camera.height_px, self._camera.width_px
        depth_m, instance_ids = np.empty(size, np.float32), np.empty(size, np.int16)
        view = self._lens.view
        T_eye = np.ascontiguousarray(T_map_camera[:3])
        eye = Eye(T_eye, view.focal, view.centre_x, view.centre_y, self._lens.pixel_rad)
        shade(
            self._radiance,
            depth_m,
            instance_ids,
            self._lens.pixels,
            self._canvas.buffer.face,
            eye,
            instances,
            self._canvas.meshes,
            self._images,
            lighting,
            self._mirrored(),
            empty_sub_samples(),
        )
        alone = self._canvas.pixels_alone(scene, index, T_camera_map)
        pixels = np.bincount(instance_ids.ravel(), minlength=max(alone, default=0) + 1)
        fractions = {pole: float(pixels[pole] / count) for pole, count in alone.items()}
        optical = self._through_the_lens(depth_m, speed_mps, yaw_rate_radps, exposure_s)
        image = self._developed(optical, np.random.default_rng([self._seed, 17, frame_seed]))
        return RenderedFrame(image, instance_ids, fractions, depth_m)

    def _lighting(
        self, scene: Scene, chosen: NDArray[np.bool_], body: Floats, T_map_camera: Floats
    ) -> Lighting:
        weather, ground_m = self._weather, float(body[2, 3])
        middle = middle_ahead(T_map_camera, ground_m)
        towards_sun = NO_MAP
        if weather.casts_shadows:
            T_sun = sun_map(weather.sun_direction, middle)
            towards_sun = self._canvas.height_map(scene, chosen, T_sun, self._sun_buffer)
        from_above = self._canvas.height_map(scene, chosen, above_map(middle), self._above_buffer)
        return Lighting(
            sun_direction=_triple(weather.sun_direction),
            sun_rgb=weather.sun_rgb,
            sky_rgb=_triple(self._sky_rgb),
            ground_rgb=_triple(self._ground_rgb),
            fog_rgb=_triple(0.92 * np.array(weather.horizon_rgb)),
            fog_per_m=weather.fog_per_m,
            glare=weather.glare,
            casts_shadows=weather.casts_shadows,
            wetness=weather.wetness,
            lamp_power=weather.lamp_power,
            leaf_litter=weather.leaf_litter,
            dryness=weather.dryness,
            ground_m=ground_m,
            towards_sun=towards_sun,
            from_above=from_above,
            lamps=lit_lamps(self._lamps_m, weather, body),
        )

    def _mirrored(self) -> Done:
        """What wet ground can mirror."""
        nearness = self._canvas.buffer.nearness[::NEARNESS_STEP, ::NEARNESS_STEP]
        if self._weather.wetness == 0.0:
            nearness = nearness[:1, :1]
        return Done(self._radiance, np.ascontiguousarray(nearness), self._lens.table)

    def _through_the_lens(
        self,
        depth_m: NDArray[np.float32],
        speed_mps: float,
        yaw_rate_radps: float,
        exposure_s: float,
    ) -> NDArray[np.float32]:
        if self._weather.lamps_are_lit or self._weather.glare > STRONG_GLARE:
            add_glare(self._radiance)
        T_body_camera, matrix = self._camera.T_body_camera, self._camera.matrix
        rate = np.array([0.0, 0.0, yaw_rate_radps])
        velocity = np.array([speed_mps, 0.0, 0.0]) + np.cross(rate, T_body_camera[:3, 3])
        to_camera = T_body_camera[:3, :3].T
        focal_px = float(matrix[0, 0]), float(matrix[1, 1])
        slopes = self._lens.x, self._lens.y
        moved = to_camera @ velocity, to_camera @ rate
        motion_blur(self._radiance, depth_m, *slopes, focal_px, *moved, exposure_s, self._blurred)
        return point_spread(self._blurred)

    def _developed(self, radiance: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.uint8]:
        gain = automatic_gain(radiance, self._weather.exposure)
        image = develop(
            radiance, self._lens.vignetting, self._noise, self._curve, gain, self._weather.gain, rng
        )
        return add_rain(image, rng) if self._weather.wetness > 0.5 else image


def _with_moving(scene: Scene, moving: Sequence[MovingObject]) -> Scene:
    if not moving:
        return scene
    parameters = np.zeros((len(moving), PARAMETERS))
    for row, one in zip(parameters, moving, strict=True):
        row[: len(one.parameters)] = one.parameters
    return scene.with_instances(
        [one.prototype for one in moving],
        [one.T_map_local for one in moving],
        [one.tint for one in moving],
        parameters,
    )


def _triple(values: Floats) -> Rgb:
    return float(values[0]), float(values[1]), float(values[2])


def warm_up(say: Callable[[str], None] | None = None) -> None:
    """Compile the kernels, or load them where an earlier run left them compiled; ``say`` is told if it takes long.

    Without it, the first frame does so; with several processes each would.
    """
    told = threading.Timer(
        PATIENCE_S,
        say or (lambda _: None),
        ["loading the renderer (compiling it, the first time: about 20 s)"],
    )
    told.daemon = True
    told.start()
    try:
        scene, camera = SceneBuilder(), Camera(16, 12, np.array([[20.0, 0, 7.5], [0, 20.0, 5.5], [0, 0, 1]]))
        post = MeshBuilder()
        post.box([0.0, 0.0, 1.0], [0.2, 0.2, 2.0], Material.LENS)
        scene.place(scene.add_prototype(post.build()), [9.0, 0.0, 0.0], instance_id=1)
        scene_of_one, images = scene.build(), _blank_textures()
        for name in ("clear", "rain"):
            renderer = Renderer(scene_of_one, images, camera, WEATHERS[name], seed=0)
            renderer.render(np.eye(4), speed_mps=1.0, yaw_rate_radps=0.0, frame_seed=0)
    finally:
        told.cancel()


def _blank_textures() -> Textures:
    tile, first = np.zeros((3, 4), np.float32), np.zeros(1, np.int64)
    card, plate = np.zeros(1, np.uint8), np.zeros((1, 1, 1, 4), np.float32)
    return Textures(tile, np.array([0, 4]), tile, np.array([0, 4]), 2, card, card, first[None], 1, plate)
