"""Colours the visibility buffer: each pixel of the distorted image from its four sub-samples."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scpf.sample_logs.drawing_types import NO_FACE
from scpf.sample_logs.kernels import (
    along,
    dot,
    hashed,
    inlined,
    kernel,
    mirrored,
    mixed,
    negative,
    rotated,
    smooth_step,
)
from scpf.sample_logs.materials import Material
from scpf.sample_logs.shading_hit import Hit, meet
from scpf.sample_logs.shading_light import (
    LAMP_RGB,
    LIT_WITHIN_M,
    lamplight,
    mirrored_sky,
    open_sky,
    schlick,
    sky_and_sun,
    skylight_on,
    sun_highlight,
    sunlight_on,
    sunlit,
    through_haze,
)
from scpf.sample_logs.shading_materials import surface_of
from scpf.sample_logs.shading_reflection import LEAST_SHARE, mirrored_thing, rippled
from scpf.sample_logs.shading_surface import BLACK, Spot
from scpf.sample_logs.sub_samples import look, majority, sub_sample_steps


class Shown(NamedTuple):
    """The instances in view, in the order in which they were drawn."""

    instance_of_face: NDArray[np.int32]
    """Which of them a face's number belongs to."""
    first_number: NDArray[np.int64]
    prototype: NDArray[np.int64]
    T_map_local: NDArray[np.float64]
    tint: NDArray[np.float64]
    parameters: NDArray[np.float64]
    pole_id: NDArray[np.int64]
    """0 where it is no landmark."""


class Eye(NamedTuple):
    """Where the camera stands, and its supersampled pinhole buffer."""

    T_map_camera: NDArray[np.float64]
    """(3, 4)."""
    focal: float
    centre_x: float
    centre_y: float
    pixel_rad: float
    """Angle that a pixel covers."""


@inlined
def _open_share(material: Any, hit: Any, spot: Any, lighting: Any, jitter: Any) -> Any:
    """Share of the sky's light that is not blocked."""
    if material == Material.LEAF:
        return 0.45 + 0.55 * (0.5 + 0.5 * hit.normal[2])
    if hit.face_normal[2] > 0.3:
        return open_sky(lighting.from_above, hit.point, jitter)
    return 0.80 + 0.20 * smooth_step(0.0, 1.2, spot.height_m)


@inlined
def _radiance(
    material: Any,
    surface: Any,
    hit: Any,
    spot: Any,
    direction: Any,
    images: Any,
    lighting: Any,
    jitter: Any,
    eye: Any,
    done: Any,
    row: Any,
) -> Any:
    """Light that the spot sends back along the ray."""
    normal, translucency = hit.normal, surface.translucency
    sun = sunlight_on(lighting, direction, normal, translucency)
    shadow = 0.0
    if lighting.casts_shadows and sun > 0.0:
        if translucency > 0:
            shadow = sunlit(lighting.towards_sun, hit.point, 0.45, jitter)
        else:
            raised = along(hit.point, hit.face_normal, 0.03 + spot.footprint_m * 1.5)
            shadow = sunlit(lighting.towards_sun, raised, 0.05, jitter)
    is_open = _open_share(material, hit, spot, lighting, jitter)
    sky, lamps = skylight_on(lighting, normal), 0.0
    if lighting.lamps.shape[0] > 0 and hit.distance_m < LIT_WITHIN_M:
        lamps = lamplight(lighting.lamps, hit.point, normal, translucency)
    sun_rgb, own, emission = lighting.sun_rgb, surface.reflectance, surface.emission
    direct = sun * shadow
    red = own[0] * (sun_rgb[0] * direct + sky[0] * is_open + LAMP_RGB[0] * lamps) + emission[0]
    green = own[1] * (sun_rgb[1] * direct + sky[1] * is_open + LAMP_RGB[1] * lamps) + emission[1]
    blue = own[2] * (sun_rgb[2] * direct + sky[2] * is_open + LAMP_RGB[2] * lamps) + emission[2]
    if surface.specular > 0:
        reflected = mirrored(direction, normal)
        share = schlick(surface.specular, surface.gloss, direction, normal) * is_open
        is_wet = lighting.wetness > 0.0 and normal[2] > 0.9 and surface.gloss > 0.3
        if is_wet:
            reflected = rippled(images.noise, hit.point, reflected, surface.gloss)
        trust, mirror = 0.0, BLACK
        if is_wet and share > LEAST_SHARE:
            trust, mirror = mirrored_thing(done, row, eye, hit.point, reflected, jitter)
        if trust < 1.0:
            mirror = mixed(mirrored_sky(lighting, images.sky, reflected), mirror, trust)
        highlight = sun_highlight(lighting, reflected, surface.specular, surface.gloss) * shadow
        red += share * mirror[0] + highlight * sun_rgb[0]
        green += share * mirror[1] + highlight * sun_rgb[1]
        blue += share * mirror[2] + highlight * sun_rgb[2]
    return red, green, blue


@inlined
def _seen(
    x: Any,
    y: Any,
    number: Any,
    eye: Any,
    shown: Any,
    meshes: Any,
    images: Any,
    lighting: Any,
    jitter: Any,
    done: Any,
    row: Any,
) -> Any:
    """Colour and distance along the camera's axis of a face at (x, y) of the buffer, or of the sky."""
    ray_x, ray_y = (x - eye.centre_x) / eye.focal, (y - eye.centre_y) / eye.focal
    axial = 1.0 / math.sqrt(ray_x * ray_x + ray_y * ray_y + 1.0)
    T = eye.T_map_camera
    direction = rotated(T, (ray_x * axial, ray_y * axial, axial))
    if number == NO_FACE:
        return sky_and_sun(lighting, images.sky, direction), np.inf
    k = shown.instance_of_face[number]
    prototype = shown.prototype[k]
    face = meshes.first_face[prototype] + number - shown.first_number[k]
    origin = (T[0, 3], T[1, 3], T[2, 3])
    hit = meet(meshes, shown.T_map_local[k], meshes.first_vertex[prototype], face, origin, direction)
    material = meshes.materials[face]
    cosine = dot(hit.face_normal, direction)
    if material != Material.LEAF:
        face_normal = negative(hit.face_normal) if cosine > 0 else hit.face_normal
        normal = negative(hit.normal) if dot(hit.normal, face_normal) < 0 else hit.normal
        hit = Hit(hit.point, hit.distance_m, hit.u, hit.v, face_normal, normal)
    cosine = abs(cosine)
    footprint = hit.distance_m * eye.pixel_rad / math.sqrt(max(cosine, 0.02))
    tint = (shown.tint[k, 0], shown.tint[k, 1], shown.tint[k, 2])
    spot = Spot(hit.point, hit.point[2] - lighting.ground_m, hit.u, hit.v, footprint, tint, face)
    surface = surface_of(
        material, spot, direction, hit.face_normal, cosine, shown.parameters[k], images, lighting
    )
    colour = _radiance(material, surface, hit, spot, direction, images, lighting, jitter, eye, done, row)
    return through_haze(lighting, colour, hit.distance_m), hit.distance_m * axial


@kernel
def shade(
    image: Any,
    depth_m: Any,
    instance_ids: Any,
    pixels: Any,
    faces: Any,
    eye: Any,
    shown: Any,
    meshes: Any,
    images: Any,
    lighting: Any,
    done: Any,
    samples: Any,
) -> None:
    """Fill ``image`` (H, W, 3) with linear radiance, ``depth_m`` (H, W) with the nearest distance along the
    camera's axis (infinite in the sky), ``instance_ids`` (H, W) with the pole of at least two sub-samples."""
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            look(samples, sub_sample_steps(pixels, row, column), faces)
            jitter = hashed(column, row)
            red = green = blue = 0.0
            nearest = np.inf
            for k in range(4):
                number = samples.face[k]
                samples.pole[k] = 0 if number == NO_FACE else shown.pole_id[shown.instance_of_face[number]]
                is_new = True
                for before in range(k):
                    if samples.face[before] == number:
                        is_new = False
                if not is_new:
                    continue
                # Sub-samples that see the same face are shaded once, in their middle.
                x, y, count = samples.x[k], samples.y[k], 1
                for later in range(k + 1, 4):
                    if samples.face[later] == number:
                        x, y, count = x + samples.x[later], y + samples.y[later], count + 1
                colour, distance = _seen(
                    x / count, y / count, number, eye, shown, meshes, images, lighting, jitter, done, row
                )
                red += colour[0] * count * 0.25
                green += colour[1] * count * 0.25
                blue += colour[2] * count * 0.25
                nearest = min(nearest, distance)
            image[row, column, 0], image[row, column, 1], image[row, column, 2] = red, green, blue
            depth_m[row, column] = nearest
            instance_ids[row, column] = majority(samples)
