"""Where the light poles, signs, path lamps, bollards and shelters stand."""

from __future__ import annotations

import math

import numpy as np

from scpf.sample_logs.lamp_poles import banner, path_lamp, road_lamp
from scpf.sample_logs.pole_looks import PoleLook
from scpf.sample_logs.street_furniture import bollard, shelter, sign_post
from scpf.sample_logs.textures_signs import (
    CROSSING,
    ENTRANCE,
    NO_PARKING,
    PARKING,
    RING_ROAD,
    SPEED_LIMIT,
    STOP,
)
from scpf.sample_logs.world_site import Site

PATH_LAMP_ID = 1001
SIGNS = (SPEED_LIMIT, STOP, NO_PARKING, CROSSING, ENTRANCE, PARKING)
SHELTER_AT_M = ((180.0, -1.0), (760.0, 1.0))
"""Distance after the start of the stretch, and side."""


def add_light_poles(site: Site, look: PoleLook) -> None:
    """Stand the landmarks, their arms over the road, each a little out of true; some bear a banner."""
    scene, rng = site.scene, site.rng
    shapes = [
        scene.add_prototype(road_lamp(height_m, arm_m, look.girth), cull_backfaces=True)
        for height_m, arm_m in look.shapes
    ]
    cloth = scene.add_prototype(banner())
    for pole in site.poles:
        _, heading = site.at(pole.s_m, pole.offset_m)
        to_road = heading - math.copysign(math.pi / 2, pole.offset_m)
        yaw = to_road + float(rng.normal(0, 0.035))
        scene.place(
            shapes[int(rng.integers(len(shapes)))],
            pole.position_m,
            yaw,
            tint=np.array(look.colour) * rng.uniform(0.85, 1.12),
            instance_id=pole.id,
            parameters=(0, rng.uniform()),
            lean=(float(rng.normal(0, 0.006)), float(rng.normal(0, 0.006))),
        )
        if rng.uniform() < look.banner_share:
            turned = yaw + math.pi * float(rng.uniform() < 0.5)
            scene.place(cloth, pole.position_m, turned, tint=(0.1, 0.1, 0.1), parameters=(RING_ROAD,))


def add_furniture(site: Site) -> None:
    """Stand signs at the kerb, lamps along paths, bollards, and two bus shelters."""
    scene, rng = site.scene, site.rng
    signs = [scene.add_prototype(sign_post(plate, float(rng.uniform(2.3, 2.8)))) for plate in SIGNS]
    lamp, post = scene.add_prototype(path_lamp()), scene.add_prototype(bollard())
    s_m = site.start_m
    while s_m < site.stop_m:
        side, kind = site.random_side(), int(rng.integers(len(SIGNS)))
        place, heading = site.at(s_m, side * (4.45 + float(rng.uniform(-0.2, 0.5))))
        # The plate looks at those who drive on its side: traffic keeps right.
        yaw = heading + (math.pi if side > 0 else 0.0) + float(rng.normal(0, 0.08))
        if site.pole_distance_m(place) > 1.0:
            scene.place(signs[kind], place, yaw, tint=(0.22, 0.22, 0.22), parameters=(SIGNS[kind],))
        if rng.uniform() < 0.5:
            place, _ = site.at(s_m + 8, site.random_side() * float(rng.uniform(9, 22)))
            if site.is_free(place, 1):
                scene.place(lamp, place, tint=(0.05, 0.06, 0.055), instance_id=PATH_LAMP_ID)
        if rng.uniform() < 0.12:
            for k in range(5):
                place, _ = site.at(s_m + k * 1.6, 5.35 * side)
                if site.pole_distance_m(place) > 0.5:
                    scene.place(post, place, tint=(0.35, 0.30, 0.05))
        s_m += float(rng.uniform(18, 46))
    roof = scene.add_prototype(shelter())
    for after_m, side in SHELTER_AT_M:
        if site.start_m + after_m < site.stop_m:
            place, heading = site.at(site.start_m + after_m, side * 8.2)
            yaw = heading + (0.0 if side > 0 else math.pi)
            scene.place(roof, place, yaw, tint=(0.18, 0.19, 0.2))
            site.occupy(place, 3.0)
