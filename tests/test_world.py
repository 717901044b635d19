"""The simulated world: packed arrays, and what stands where."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from scpf.models.errors import InputError
from scpf.sample_logs.centre_line import CentreLine
from scpf.sample_logs.ground import LANE_HALF_WIDTH_M, ground_height_m
from scpf.sample_logs.lamp_placement import LightPole, place_poles, poles_of_a_map
from scpf.sample_logs.materials import Material
from scpf.sample_logs.scene import Scene
from scpf.sample_logs.traffic import Traffic
from scpf.sample_logs.world import World, build_world

SEED = 4
ROUTE_M = (0.0, 400.0)


@pytest.fixture(scope="module")
def ring() -> CentreLine:
    turn = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    return CentreLine(np.column_stack([480 * np.cos(turn), 350 * np.sin(turn)]), closed=True)


@pytest.fixture(scope="module")
def poles(ring: CentreLine) -> tuple[LightPole, ...]:
    return place_poles(ring, 99, seed=SEED)


@pytest.fixture(scope="module")
def world(ring: CentreLine, poles: tuple[LightPole, ...]) -> World:
    return build_world(ring, poles, seed=SEED, route_m=ROUTE_M)


def test_packed_ranges_are_valid(world: World) -> None:
    scene = world.scene
    assert np.array_equal(np.cumsum(scene.vertex_count)[:-1], scene.first_vertex[1:])
    assert np.array_equal(np.cumsum(scene.face_count)[:-1], scene.first_face[1:])
    assert scene.vertex_count.sum() == len(scene.vertices)
    assert scene.face_count.sum() == len(scene.faces) == len(scene.materials)
    assert scene.uv.shape == (len(scene.faces), 3, 2)
    owner = np.repeat(np.arange(len(scene.face_count)), scene.face_count)
    assert scene.faces.min() >= 0
    assert np.all(scene.faces < scene.vertex_count[owner][:, None])
    assert scene.prototype.min() >= 0 and scene.prototype.max() < len(scene.face_count)
    assert set(np.unique(scene.materials)) <= set(Material) - {Material.NONE}
    is_leaf = scene.materials == Material.LEAF
    assert np.array_equal(is_leaf, scene.alpha_card[owner] >= 0)
    assert scene.alpha_card.max() < len(world.textures.card_offset)


def test_normals_have_unit_length(world: World) -> None:
    lengths = np.linalg.norm(world.scene.normals, axis=-1)
    np.testing.assert_allclose(lengths, 1.0, atol=1e-5)


def test_spheres_hold_their_instances(world: World) -> None:
    scene = world.scene
    for n in range(0, len(scene.prototype), 37):
        p = scene.prototype[n]
        own = scene.vertices[scene.first_vertex[p] :][: scene.vertex_count[p]]
        placed = own @ scene.T_map_local[n, :, :3].T + scene.T_map_local[n, :, 3]
        reach = np.linalg.norm(placed - scene.instance_centre_m[n], axis=1).max()
        assert reach <= scene.instance_radius_m[n] * 1.001 + 1e-4


def test_the_same_seed_makes_the_same_world(ring: CentreLine, world: World) -> None:
    again = build_world(ring, place_poles(ring, 99, seed=SEED), seed=SEED, route_m=ROUTE_M)
    for field in fields(Scene):
        assert np.array_equal(getattr(world.scene, field.name), getattr(again.scene, field.name)), field.name
    other = build_world(ring, place_poles(ring, 99, seed=SEED), seed=SEED + 1, route_m=ROUTE_M)
    assert len(other.scene.prototype) != len(world.scene.prototype)


def test_pole_spacing(ring: CentreLine) -> None:
    pairs = gaps = 0
    for seed in range(6):
        poles = place_poles(ring, 99, seed=seed)
        s = np.array([pole.s_m for pole in poles])
        assert [pole.id for pole in poles] == list(range(1, 100))
        assert np.all(np.diff(s) >= 0) and s[0] >= 0 and s[-1] <= ring.length_m
        np.testing.assert_allclose(np.mean(np.diff(s)), ring.length_m / 99, rtol=0.03)
        pairs += int(np.sum(np.diff(s) < 5))
        gaps += int(np.sum(np.diff(s) > 1.7 * ring.length_m / 99))
    assert 10 <= pairs <= 70
    assert 10 <= gaps <= 80


def test_poles_stand_beside_the_lanes_and_change_sides_in_runs(
    ring: CentreLine, poles: tuple[LightPole, ...]
) -> None:
    distance = ring.distance_m(np.array([pole.position_m[:2] for pole in poles]))
    assert np.all((distance > 4.4) & (distance < 5.1))
    sides = np.sign([pole.offset_m for pole in poles])
    assert set(sides) == {-1.0, 1.0}
    assert np.sum(np.diff(sides) != 0) < 35
    assert all(pole.position_m[2] == pytest.approx(0.145, abs=0.01) for pole in poles)


def test_map_error(ring: CentreLine, poles: tuple[LightPole, ...]) -> None:
    error = np.array([np.linalg.norm(pole.mapped_position_m - pole.position_m[:2]) for pole in poles])
    assert np.all((error >= 1.0) & (error <= 2.0))
    exact = place_poles(ring, 99, seed=SEED, mapped_error_m=(0.0, 0.0))
    for pole, same in zip(poles, exact, strict=True):
        assert np.array_equal(same.mapped_position_m, same.position_m[:2])
        assert np.array_equal(pole.position_m, same.position_m)


def test_poles_of_a_map_keep_their_mapped_places(ring: CentreLine) -> None:
    mapped = [ring.at(s, offset)[0][:2] for s, offset in ((50.0, 5.0), (90.0, -6.0), (130.0, 1.0))]
    poles = poles_of_a_map(ring, mapped, seed=SEED)
    for pole, place in zip(poles, mapped, strict=True):
        assert np.array_equal(pole.mapped_position_m, place)
        assert abs(pole.offset_m) > LANE_HALF_WIDTH_M + 0.5
    error = [np.linalg.norm(pole.mapped_position_m - pole.position_m[:2]) for pole in poles[:2]]
    np.testing.assert_allclose(error, 1.5, atol=0.6)


def test_every_pole_of_the_stretch_is_an_instance(world: World) -> None:
    ids = world.scene.instance_id
    landmarks = ids[(ids > 0) & (ids < 1000)]
    assert len(set(landmarks)) == len(landmarks)
    on_route = {pole.id for pole in world.poles if ROUTE_M[0] <= pole.s_m <= ROUTE_M[1]}
    assert on_route <= set(landmarks.tolist())
    assert np.any(ids >= 1000)
    for pole in world.poles:
        for n in np.flatnonzero(ids == pole.id):
            np.testing.assert_allclose(world.scene.T_map_local[n, :, 3], pole.position_m)
            p = world.scene.prototype[n]
            own = world.scene.vertices[world.scene.first_vertex[p] :][: world.scene.vertex_count[p]]
            tip = world.scene.T_map_local[n] @ np.append(own[np.argmax(own[:, 0])], 1.0)
            reach = world.centre_line.distance_m(tip[None, :2])[0]
            assert reach < abs(pole.offset_m) - 1.5  # the arm points to the road


def test_nothing_parks_in_the_lanes(world: World) -> None:
    scene = world.scene
    parked = np.flatnonzero(np.isin(scene.prototype, world.car_prototypes))
    assert len(parked) > 10
    distance = world.centre_line.distance_m(scene.instance_centre_m[parked][:, :2])
    assert np.all(distance - scene.instance_radius_m[parked] > LANE_HALF_WIDTH_M)


def test_trunks_keep_away_from_poles(world: World) -> None:
    scene = world.scene
    owner = np.repeat(np.arange(len(scene.face_count)), scene.face_count)
    trunks = [p for p in range(len(scene.face_count)) if np.all(scene.materials[owner == p] == Material.BARK)]
    places = scene.T_map_local[np.isin(scene.prototype, trunks)][:, :2, 3]
    assert len(places) > 50
    standing = [pole.position_m[:2] for pole in world.poles if pole.id in scene.instance_id]
    apart = np.linalg.norm(places[:, None] - np.array(standing)[None], axis=-1)
    assert apart.min() > 1.0
    from_road = world.centre_line.distance_m(places)
    assert np.all((from_road > 7.2) | ((from_road > 4.7) & (from_road < 5.5)))  # none in lane or pavement


def test_crowns_stand_before_some_poles(world: World) -> None:
    scene = world.scene
    shown = (scene.alpha_card[scene.prototype] >= 0) & (scene.lod_range_m[:, 0] == 0)
    middles, radii = scene.instance_centre_m[shown], scene.instance_radius_m[shown] * 0.7
    hidden = []
    for pole in world.poles:
        if pole.id not in scene.instance_id:
            continue
        eye = world.centre_line.at(pole.s_m - 30, -1.8)[0] + [0, 0, 2.3]
        sight = pole.position_m + np.array([0, 0, 5.5]) - eye
        along = np.clip((middles - eye) @ sight / (sight @ sight), 0, 1)
        hidden.append(bool(np.any(np.linalg.norm(eye + along[:, None] * sight - middles, axis=1) < radii)))
    assert 0.1 < np.mean(hidden) < 0.6


def test_an_empty_route_is_refused(ring: CentreLine) -> None:
    with pytest.raises(InputError, match="empty"):
        build_world(ring, (), seed=SEED, route_m=(100.0, 100.0))


def test_an_open_road_is_built_within_its_ends() -> None:
    line = CentreLine(np.array([[0.0, 0.0], [150.0, 0.0], [300.0, 20.0]]), closed=False)
    world = build_world(line, place_poles(line, 8, seed=SEED), seed=SEED, route_m=(0.0, 300.0))
    road = world.scene.is_ground & (world.scene.instance_radius_m < 100)
    assert world.scene.instance_centre_m[road][:, 0].max() < 330


def test_ground_height_is_continuous_and_level_on_the_road() -> None:
    assert ground_height_m(0.0) == ground_height_m(-3.7) == 0.0
    assert ground_height_m(5.0) == ground_height_m(-5.0) == pytest.approx(0.148, abs=0.003)
    assert ground_height_m(80.0) == ground_height_m(26.0)


def test_traffic_repeats_and_never_meets_the_bus(world: World) -> None:
    for time_s in np.arange(0.0, 200.0, 3.7):
        bus_s_m = 6.0 * time_s % 400
        moment = Traffic(SEED, world).at(time_s, bus_s_m)
        again = Traffic(SEED, world).at(time_s, bus_s_m)
        assert [one.prototype for one in moment] == [one.prototype for one in again]
        bus, tangent, _ = world.centre_line.at(bus_s_m, -1.85)
        cars = [one for one in moment if one.prototype in world.car_prototypes]
        for one, same in zip(moment, again, strict=True):
            assert np.array_equal(one.T_map_local, same.T_map_local)
        for car in cars:
            apart = car.T_map_local[:2, 3] - bus[:2]
            assert np.linalg.norm(apart) > (3.0 if car.T_map_local[:2, 0] @ tangent < 0 else 14.0)
        oncoming = [car.T_map_local[:2, 3] for car in cars if car.T_map_local[:2, 0] @ tangent < 0]
        for i, place in enumerate(oncoming):
            assert all(np.linalg.norm(place - other) > 12.5 for other in oncoming[:i])


def test_moving_objects_join_the_scene(world: World) -> None:
    moment = Traffic(SEED, world).at(12.0, 100.0)
    assert moment
    scene = world.scene.with_instances(
        [one.prototype for one in moment],
        [one.T_map_local for one in moment],
        [one.tint for one in moment],
        [(*one.parameters, *[0.0] * (8 - len(one.parameters))) for one in moment],
    )
    before = len(world.scene.prototype)
    assert len(scene.prototype) == len(scene.instance_radius_m) == before + len(moment)
    assert np.array_equal(scene.T_map_local[before], moment[0].T_map_local)
    assert not scene.instance_id[before:].any()
    assert len(world.scene.with_instances([], [], [], []).prototype) == before
