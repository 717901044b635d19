"""The renderer: geometry against the camera model, masks and fractions, and the same bits every time."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from scpf.models.camera import Camera
from scpf.sample_logs import exposure, optics, rasteriser, renderer, shading, sub_samples
from scpf.sample_logs.basler import basler_camera
from scpf.sample_logs.lamp_poles import road_lamp
from scpf.sample_logs.materials import Material
from scpf.sample_logs.mesh import MeshBuilder
from scpf.sample_logs.renderer import RenderedFrame, Renderer
from scpf.sample_logs.scene import Scene, SceneBuilder
from scpf.sample_logs.textures import Textures, make_textures
from scpf.sample_logs.traffic import MovingObject
from scpf.sample_logs.weather import WEATHERS, Weather

Floats = NDArray[np.float64]

WIDTH_PX = 512
ALONE, BEHIND_WALL, HIDDEN, FRONT, BACK, NEAR = 1, 2, 3, 4, 5, 6
PLACES_M = {
    ALONE: (22.0, 5.0),
    BEHIND_WALL: (35.0, -6.0),
    HIDDEN: (44.0, -11.0),
    FRONT: (30.0, 11.0),
    BACK: (46.5, 17.3),
    NEAR: (10.0, -4.2),
}
"""Poles in map; the body stands at the origin and looks along x."""
LEANS = {ALONE: (0.01, -0.02), NEAR: (-0.01, 0.015)}
WALL_M = 30.0


@pytest.fixture(scope="module")
def textures() -> Textures:
    return make_textures(0)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Six poles on a lawn: one half behind a low wall, one wholly behind a high one, one behind another pole."""
    builder = SceneBuilder()
    ground, walls = MeshBuilder(), MeshBuilder()
    ground.quad([[-50, -90, 0], [300, -90, 0], [300, 90, 0], [-50, 90, 0]], material=Material.GRASS)
    builder.place(builder.add_prototype(ground.build()), [0, 0, 0], is_ground=True)
    walls.box([WALL_M + 0.15, -6, 2.0], [0.3, 3, 4.0], Material.PLAIN)
    walls.box([WALL_M + 0.15, -8.5, 6.0], [0.3, 4, 12.0], Material.PLAIN)
    builder.place(builder.add_prototype(walls.build()), [0, 0, 0])
    pole = builder.add_prototype(road_lamp(), cull_backfaces=True)
    for number, place in PLACES_M.items():
        lean = LEANS.get(number, (0.0, 0.0))
        yaw = -np.pi / 2 if place[1] > 0 else np.pi / 2
        # Raised by the centimetre that the foot is sunk into the ground otherwise: all of it can be seen.
        builder.place(pole, [*place, 0.02], yaw, tint=(0.3, 0.3, 0.3), instance_id=number, lean=lean)
    builder.place(pole, [60, 3, 0], np.pi / 2, instance_id=1000)
    return builder.build()


Render = Callable[..., RenderedFrame]


@pytest.fixture(scope="module")
def render(scene: Scene, textures: Textures) -> Render:
    """Renders with a camera and weather, each pair only set up once."""
    known: dict[tuple[int, Weather], Renderer] = {}

    def _render(
        weather: str | Weather = "cloudy", width_px: int = WIDTH_PX, **values: object
    ) -> RenderedFrame:
        chosen = WEATHERS[weather] if isinstance(weather, str) else weather
        key = width_px, chosen
        if key not in known:
            lamps = [[x, y - np.sign(y) * 1.9, 8.45] for x, y in PLACES_M.values()]
            camera = basler_camera(width_px)
            known[key] = Renderer(scene, textures, camera, chosen, seed=3, street_lamps_m=lamps)
        given = {"speed_mps": 0.0, "yaw_rate_radps": 0.0, "frame_seed": 0, **values}
        return known[key].render(np.eye(4), **given)  # type: ignore[arg-type]

    return _render


@pytest.fixture(scope="module")
def frame(render: Render) -> RenderedFrame:
    return render()


def axis_in_map(number: int, low_m: float, high_m: float) -> Floats:
    """Points (n, 3) on the axis of a pole's straight shaft."""
    height = np.linspace(low_m, high_m, 200)
    lean = LEANS.get(number, (0.0, 0.0))
    x, y = PLACES_M[number]
    return np.column_stack([x + lean[0] * height, y + lean[1] * height, 0.02 + height])


def pixel_of(camera: Camera, place_m: list[float]) -> tuple[int, int]:
    """Row and column that show a place in the body's frame."""
    T_camera_body = np.linalg.inv(camera.T_body_camera)
    in_camera = T_camera_body[:3, :3] @ place_m + T_camera_body[:3, 3]
    column, row = np.rint(camera.project(in_camera[None])[0]).astype(int)
    return int(row), int(column)


def off_the_axis(mask: NDArray[np.bool_], axis_px: Floats) -> Floats:
    """Mask centre minus axis (rows,), px, over the rows between the axis' ends that hold a mask."""
    order = np.argsort(axis_px[:, 1])
    low, high = int(np.ceil(axis_px[:, 1].min())), int(np.floor(axis_px[:, 1].max()))
    off = []
    for row in range(max(low, 0), min(high, len(mask) - 1) + 1):
        columns = np.nonzero(mask[row])[0]
        if len(columns):
            axis = np.interp(row, axis_px[order, 1], axis_px[order, 0])
            off.append((columns[0] + columns[-1]) / 2 - axis)
    return np.array(off)


@pytest.mark.parametrize("number", [ALONE, NEAR, FRONT])
def test_masks_lie_on_the_projected_axis(frame: RenderedFrame, number: int) -> None:
    camera = basler_camera(WIDTH_PX)
    points = axis_in_map(number, 0.6, 7.0)
    T_camera_body = np.linalg.inv(camera.T_body_camera)
    in_camera = points @ T_camera_body[:3, :3].T + T_camera_body[:3, 3]
    turn, _ = cv2.Rodrigues(T_camera_body[:3, :3])
    by_opencv, _ = cv2.projectPoints(points, turn, T_camera_body[:3, 3], camera.matrix, camera.distortion)
    for axis_px in (camera.project(in_camera), by_opencv.reshape(-1, 2)):
        off = off_the_axis(frame.instance_ids == number, axis_px)
        assert len(off) > 40
        assert abs(off.mean()) <= 0.25
        assert off.std() <= 0.5


def test_a_shifted_axis_would_be_noticed(frame: RenderedFrame) -> None:
    """Half a pixel of convention, as between pixel centres and pixel corners, is well above what is measured."""
    camera = basler_camera(WIDTH_PX)
    T_camera_body = np.linalg.inv(camera.T_body_camera)
    in_camera = axis_in_map(ALONE, 0.6, 7.0) @ T_camera_body[:3, :3].T + T_camera_body[:3, 3]
    off = off_the_axis(frame.instance_ids == ALONE, camera.project(in_camera) + 0.5)
    assert abs(off.mean()) > 0.3


def test_visible_fractions(frame: RenderedFrame) -> None:
    fraction = frame.visible_fraction
    assert fraction[ALONE] == fraction[FRONT] == fraction[NEAR] == 1.0
    assert 0.3 < fraction[BEHIND_WALL] < 0.8
    assert fraction[HIDDEN] < 0.2
    assert 0.5 < fraction[BACK] < 1.0
    assert all(0.0 <= value <= 1.0 for value in fraction.values())
    assert set(np.unique(frame.instance_ids)) <= {0, *PLACES_M}


def test_depth_is_measured_along_the_axis(frame: RenderedFrame) -> None:
    camera = basler_camera(WIDTH_PX)
    T_camera_body = np.linalg.inv(camera.T_body_camera)
    spot = T_camera_body[:3, :3] @ [WALL_M, -8.5, 5.0] + T_camera_body[:3, 3]
    column, row = np.rint(camera.project(spot[None])[0]).astype(int)
    assert frame.depth_m[row, column] == pytest.approx(spot[2], abs=0.05)
    assert np.isinf(frame.depth_m[0, WIDTH_PX // 2])


def test_two_renderers_give_the_same_bits(scene: Scene, textures: Textures, render: Render) -> None:
    values = {"speed_mps": 6.0, "yaw_rate_radps": 0.1}
    first = render("rain", **values, frame_seed=4)
    other = Renderer(scene, textures, basler_camera(WIDTH_PX), WEATHERS["rain"], seed=3)
    moved = np.eye(4)
    moved[0, 3] = 8.0
    other.render(moved, **values, frame_seed=1)  # what was rendered before does not matter
    again = Renderer(
        scene,
        textures,
        basler_camera(WIDTH_PX),
        WEATHERS["rain"],
        seed=3,
        street_lamps_m=[[x, y - np.sign(y) * 1.9, 8.45] for x, y in PLACES_M.values()],
    )
    again.render(moved, **values, frame_seed=1)
    second = again.render(np.eye(4), **values, frame_seed=4)
    assert np.array_equal(first.image, second.image)
    assert np.array_equal(first.instance_ids, second.instance_ids)
    assert np.array_equal(first.depth_m, second.depth_m)
    assert first.visible_fraction == second.visible_fraction
    assert not np.array_equal(first.image, render("rain", **values, frame_seed=5).image)


@pytest.mark.parametrize("name", list(WEATHERS))
def test_every_weather_shows_the_same_scene(render: Render, frame: RenderedFrame, name: str) -> None:
    shown = render(name)
    assert shown.image.dtype == np.uint8 and shown.image.shape == (WIDTH_PX * 3 // 4, WIDTH_PX, 3)
    assert np.array_equal(shown.instance_ids, frame.instance_ids)
    assert 40 < shown.image.mean() < 215
    assert shown.image.std() > 15


def test_kernels_are_compiled_once(render: Render) -> None:
    for name in WEATHERS:
        render(name)
    for compiled in (
        shading.shade,
        rasteriser.draw,
        sub_samples.count_pixels,
        exposure._develop,
        optics._smear,
    ):
        assert len(compiled.signatures) == 1  # type: ignore[attr-defined]


def test_the_sun_casts_shadows(render: Render) -> None:
    """The lawn behind the high wall is dark when the sun stands before it, and only then."""
    weather = replace(WEATHERS["clear"], sun_azimuth_rad=0.0, sun_elevation_rad=0.7)
    lit = replace(weather, sun_azimuth_rad=np.pi)
    camera = basler_camera(WIDTH_PX)
    row, column = pixel_of(camera, [WALL_M - 3.0, -8.5, 0.0])
    patch = (slice(row - 2, row + 3), slice(column - 2, column + 3))
    dark, bright = render(weather).image[patch].mean(), render(lit).image[patch].mean()
    assert dark < 0.75 * bright


def test_lamps_light_the_road_at_dusk(scene: Scene, textures: Textures, render: Render) -> None:
    camera = basler_camera(WIDTH_PX)
    without = Renderer(scene, textures, camera, WEATHERS["dusk"], seed=3)
    dark = without.render(np.eye(4), speed_mps=0.0, yaw_rate_radps=0.0, frame_seed=0).image
    row, column = pixel_of(camera, [PLACES_M[ALONE][0], 3.1, 0.0])
    patch = (slice(row - 2, row + 3), slice(column - 2, column + 3))
    assert render("dusk").image[patch].mean() > dark[patch].mean() + 10


def test_wet_ground_mirrors_what_stands_on_it(textures: Textures) -> None:
    """A red wall at the end of a car park is seen in it upside down when it is wet."""
    builder, ground, wall = SceneBuilder(), MeshBuilder(), MeshBuilder()
    ground.quad([[-50, -90, 0], [60, -90, 0], [60, 90, 0], [-50, 90, 0]], material=Material.PARKING_LOT)
    wall.box([0.0, 0, 2.0], [0.3, 6, 4.0], Material.PLAIN)
    builder.place(builder.add_prototype(ground.build()), [0, 0, 0], is_ground=True)
    shape = builder.add_prototype(wall.build())
    place = np.column_stack([np.eye(3), [20.0, 0, 0]])
    camera, scene = basler_camera(256), builder.build()
    # The mirror image of the wall's upper part is 3 m below ground: here the sight of it crosses the ground.
    height_m, ahead_m = camera.T_body_camera[2, 3], camera.T_body_camera[0, 3]
    ahead_m += (20.0 - ahead_m) * height_m / (height_m + 3.0)
    row, column = pixel_of(camera, [ahead_m, 0.0, 0.0])
    patch = (slice(row - 1, row + 2), slice(column - 3, column + 4))
    redder = {}
    for name in ("rain", "overcast"):
        one = Renderer(scene, textures, camera, WEATHERS[name], seed=3)
        seen = []
        for moving in ((), [MovingObject(shape, place, (0.9, 0.05, 0.05), ())]):
            frame = one.render(np.eye(4), speed_mps=0.0, yaw_rate_radps=0.0, frame_seed=0, moving=moving)
            colour = frame.image[patch].reshape(-1, 3).mean(axis=0)
            seen.append(colour[0] / colour[2])
        redder[name] = seen[1] / seen[0] - 1.0
    assert redder["rain"] > 0.03
    assert abs(redder["overcast"]) < 0.01


def test_moving_objects_hide_poles(render: Render, frame: RenderedFrame) -> None:
    """A copy of the wall in front of the free pole."""
    prototype, pose = 1, np.column_stack([np.eye(3), [-12.0, 13.5, 0.0]])
    moving = [MovingObject(prototype, pose, (0.4, 0.1, 0.1), ())]
    assert render(moving=moving).visible_fraction[ALONE] < 0.9 * frame.visible_fraction[ALONE]


def test_speed_smears_what_is_near(render: Render) -> None:
    weather = replace(WEATHERS["overcast"], gain=0.0)  # no noise
    still, fast = render(weather).image, render(weather, speed_mps=20.0, exposure_s=0.02).image

    def grain(image: NDArray[np.uint8], rows: slice) -> float:
        return float(np.abs(np.diff(image[rows].astype(float), axis=0)).mean())

    assert grain(fast, slice(-40, None)) < 0.8 * grain(still, slice(-40, None))
    # The sky is too far to smear; the automatic exposure may differ by a little.
    sky = (0, slice(WIDTH_PX // 2 - 60, WIDTH_PX // 2 + 60))
    assert np.abs(still[sky].astype(int) - fast[sky]).max() <= 2


def test_warm_up_says_that_it_takes_long(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    monkeypatch.setattr(renderer, "PATIENCE_S", 0.0)
    renderer.warm_up(said.append)
    assert len(said) == 1 and "compiling" in said[0]


def test_no_graphics_library_is_needed_or_loaded() -> None:
    code = """
import sys

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {"OpenGL", "moderngl", "glfw", "vtk", "pyglet", "vulkan", "wgpu", "glcontext"}:
            raise ImportError(name)

sys.meta_path.insert(0, Blocker())
from pathlib import Path
from scpf.sample_logs.renderer import warm_up
warm_up()
maps = Path("/proc/self/maps")
loaded = maps.read_text() if maps.exists() else ""
names = ("libGL", "libEGL", "libOSMesa", "libvulkan", "libX11", "libwayland")
print([name for name in names if name in loaded])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
