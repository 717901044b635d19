"""Where trees, groves and hedges grow: along the street, over some of the poles, and on the lawns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scpf.sample_logs.mesh import Floats
from scpf.sample_logs.textures_cards import LARGE_LEAVES, NEEDLES, SMALL_LEAVES
from scpf.sample_logs.trees import LOD_RANGES_M, broadleaf, bush, conifer
from scpf.sample_logs.world_site import Site

TRUNK_CLEARANCE_M = 1.3
"""Between a trunk and a light pole."""
VERGE_M = (4.9, 5.3)
"""Between kerb and pavement: young trees only, whose crowns keep out of the lane."""
BEHIND_PAVEMENT_M = 7.3
OVERHANGING_SHARE, YOUNG_SHARE = 0.40, 0.20
"""Of the poles have, on the side they are approached from, a large tree behind the pavement whose crown
reaches in front of them, or a young one on the verge."""
GREENS = ((0.078, 0.118, 0.036), (0.092, 0.130, 0.044), (0.060, 0.098, 0.034), (0.108, 0.138, 0.050))
AUTUMN = ((0.36, 0.20, 0.03), (0.34, 0.10, 0.03), (0.28, 0.22, 0.04), (0.16, 0.16, 0.04))
SPRUCE, BARK, HEDGE = (0.045, 0.085, 0.040), (0.13, 0.105, 0.085), (0.07, 0.12, 0.04)


class _Species(NamedTuple):
    levels: list[tuple[int, int]]
    """(trunk, crown) prototypes of each level of detail."""
    card: int
    radius_m: float


class _Nursery(NamedTuple):
    broadleaves: list[_Species]
    conifers: list[_Species]


def add_plants(site: Site, season: float) -> None:
    """Plant the stretch; ``season`` is the share of broad-leaved trees in autumn colours, 0 to 1."""
    nursery = _nursery(site)
    _occluding_trees(site, nursery, season)
    for side in (-1.0, 1.0):
        _street_trees(site, nursery, side, season)
        _groves(site, nursery, side, season)
    _hedges(site)


def _occluding_trees(site: Site, nursery: _Nursery, season: float) -> None:
    rng = site.rng
    by_size = sorted(nursery.broadleaves, key=lambda species: species.radius_m)
    for pole in site.poles:
        side, choice = float(np.sign(pole.offset_m)), rng.uniform()
        if choice < OVERHANGING_SHARE:
            offset_m, scale = side * float(rng.uniform(7.4, 8.0)), float(rng.uniform(1.1, 1.35))
            place, _ = site.at(pole.s_m - float(rng.uniform(1.5, 9.0)), offset_m)
            if site.is_free(place, 1.5):
                _tree(site, by_size[-1], place, season, scale)
        elif choice < OVERHANGING_SHARE + YOUNG_SHARE:
            offset_m, scale = side * float(rng.uniform(*VERGE_M)), float(rng.uniform(0.55, 0.68))
            place, _ = site.at(pole.s_m - float(rng.uniform(2.5, 9.0)), offset_m)
            _tree(site, by_size[int(rng.integers(2))], place, season, scale)


def _nursery(site: Site) -> _Nursery:
    scene, rng = site.scene, site.rng
    broadleaves, conifers = [], []
    for k in range(5):
        seed, card = int(rng.integers(1 << 30)), (LARGE_LEAVES, SMALL_LEAVES)[k % 2]
        height_m, trunk_m = float(rng.uniform(7.5, 11.5)), float(rng.uniform(2.3, 3.0))
        radius_m, levels = float(rng.uniform(2.4, 3.5)), []
        for level in range(len(LOD_RANGES_M)):
            tree = broadleaf(np.random.default_rng(seed), height_m, trunk_m, radius_m, level)
            levels.append((scene.add_prototype(tree.trunk), scene.add_prototype(tree.crown, alpha_card=card)))
        broadleaves.append(_Species(levels, card, radius_m))
    for _ in range(2):
        seed, height_m, levels = int(rng.integers(1 << 30)), float(rng.uniform(8, 12)), []
        for level in range(len(LOD_RANGES_M)):
            tree = conifer(np.random.default_rng(seed), height_m, level)
            levels.append(
                (scene.add_prototype(tree.trunk), scene.add_prototype(tree.crown, alpha_card=NEEDLES))
            )
        conifers.append(_Species(levels, NEEDLES, 0.24 * height_m))
    return _Nursery(broadleaves, conifers)


def _any(rng: np.random.Generator, nursery: _Nursery, broadleaf_share: float) -> _Species:
    kind = nursery.broadleaves if rng.uniform() < broadleaf_share else nursery.conifers
    return kind[int(rng.integers(len(kind)))]


def _tree(site: Site, species: _Species, place: Floats, season: float, scale: float | None = None) -> None:
    rng = site.rng
    size, yaw = scale or float(rng.uniform(0.78, 1.18)), float(rng.uniform(0, 2 * np.pi))
    if species.card == NEEDLES:
        leaves = np.array(SPRUCE) * rng.uniform(0.8, 1.2)
    else:
        colours = AUTUMN if rng.uniform() < season else GREENS
        leaves = np.array(colours[int(rng.integers(len(colours)))]) * rng.uniform(0.8, 1.2)
    bark = np.array(BARK) * rng.uniform(0.7, 1.3)
    if site.pole_distance_m(place) < TRUNK_CLEARANCE_M:
        return
    from_road_m = site.road_distance_m(place)
    if from_road_m < VERGE_M[0] - 0.1 or VERGE_M[1] + 0.1 < from_road_m < BEHIND_PAVEMENT_M:
        return
    for (trunk, crown), lod in zip(species.levels, LOD_RANGES_M, strict=True):
        site.scene.place(trunk, place, yaw, size, tint=bark, lod_range_m=lod)
        site.scene.place(crown, place, yaw, size, tint=leaves, parameters=(species.card,), lod_range_m=lod)


def _street_trees(site: Site, nursery: _Nursery, side: float, season: float) -> None:
    s_m = site.start_m
    while s_m < site.stop_m:
        if site.rng.uniform() < 0.62:
            place, _ = site.at(s_m, side * float(site.rng.uniform(8.4, 12.5)))
            if site.is_free(place, 2.5):
                _tree(site, _any(site.rng, nursery, 0.85), place, season)
        s_m += float(site.rng.uniform(7, 17))


def _groves(site: Site, nursery: _Nursery, side: float, season: float) -> None:
    for _ in range(int((site.stop_m - site.start_m) / 9)):
        middle, _ = site.at(site.random_s_m(), side * float(site.rng.uniform(14, 95)))
        for k in range(int(site.rng.integers(1, 4))):
            place = middle[:2] + site.rng.normal(0, 4.5, 2) * (k > 0)
            if site.road_distance_m(place) > 9 and site.is_free(place, 3.0 if k == 0 else 2.0):
                _tree(site, _any(site.rng, nursery, 0.78), site.grounded(place), season)


def _hedges(site: Site) -> None:
    prototype = site.scene.add_prototype(bush(site.rng), alpha_card=SMALL_LEAVES)
    for _ in range(int((site.stop_m - site.start_m) / 14)):
        s_m, side = site.random_s_m(), site.random_side()
        offset_m = float(site.rng.uniform(9, 20))
        for k in range(int(site.rng.integers(3, 9))):
            place, _ = site.at(s_m + k * 1.1, side * (offset_m + float(site.rng.normal(0, 0.15))))
            if site.is_free(place, 0.5) and site.road_distance_m(place) > 8:
                site.scene.place(
                    prototype,
                    place - [0, 0, 0.05],
                    float(site.rng.uniform(0, 2 * np.pi)),
                    float(site.rng.uniform(0.8, 1.3)),
                    tint=np.array(HEDGE) * site.rng.uniform(0.8, 1.2),
                    parameters=(SMALL_LEAVES,),
                    lod_range_m=(0.0, 120.0),
                )
