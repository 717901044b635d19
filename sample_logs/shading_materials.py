"""Which material function answers for a face."""

from __future__ import annotations

from typing import Any

from scpf.sample_logs.kernels import inlined
from scpf.sample_logs.materials import Material
from scpf.sample_logs.shading_facade import facade
from scpf.sample_logs.shading_ground import KERB_STONE_M, SLAB_M, concrete, lawn, parking_lot
from scpf.sample_logs.shading_road import road
from scpf.sample_logs.shading_surface import matt
from scpf.sample_logs.shading_things import (
    bark,
    glass,
    headlight,
    lamp_lens,
    leaf,
    metal,
    paint,
    plain,
    rim,
    rubber,
    sign,
    tail_light,
)


@inlined
def surface_of(
    material: Any,
    spot: Any,
    direction: Any,
    normal: Any,
    cosine: Any,
    parameters: Any,
    images: Any,
    lighting: Any,
) -> Any:
    """What the spot is made of."""
    noise, wetness = images.noise, lighting.wetness
    if material == Material.ASPHALT:
        surface = road(noise, spot, parameters[0], parameters[1], wetness)
    elif material == Material.GRASS:
        surface = lawn(images, spot, lighting.leaf_litter, lighting.dryness)
    elif material == Material.LEAF:
        surface = leaf(images, spot, int(parameters[0]))
    elif material in (Material.KERB, Material.PAVEMENT):
        surface = concrete(noise, spot, KERB_STONE_M if material == Material.KERB else SLAB_M, wetness)
    elif material == Material.FACADE:
        surface = facade(images, spot, direction, normal, cosine, parameters, lighting.lamp_power)
    elif material == Material.BARK:
        surface = bark(noise, spot)
    elif material == Material.METAL:
        surface = metal(noise, spot, parameters[1])
    elif material == Material.LENS:
        surface = lamp_lens(lighting.lamp_power)
    elif material == Material.PAINT:
        surface = paint(spot)
    elif material == Material.GLASS:
        surface = glass()
    elif material == Material.RUBBER:
        surface = rubber()
    elif material == Material.SIGN:
        surface = sign(images.signs, spot, int(parameters[0]))
    elif material == Material.TAIL_LIGHT:
        surface = tail_light(parameters[2])
    elif material == Material.HEADLIGHT:
        surface = headlight(parameters[3])
    elif material == Material.RIM:
        surface = rim()
    elif material == Material.PARKING_LOT:
        surface = parking_lot(noise, spot, wetness)
    elif material == Material.PLAIN:
        surface = plain(noise, spot)
    else:
        surface = matt((0.5, 0.5, 0.5))
    return surface
