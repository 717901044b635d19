"""What a frame of the simulated ring road costs: CPU time of the process, over the weathers and along the road.

Not run by default. By hand (about two minutes; compile first, as any earlier run of the renderer does):

    SCPF_BENCHMARK=1 pytest tests/benchmarks/test_render_cost.py -s
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from scpf.sample_logs.basler import basler_camera
from scpf.sample_logs.centre_line import CentreLine
from scpf.sample_logs.lamp_placement import place_poles
from scpf.sample_logs.renderer import Renderer
from scpf.sample_logs.traffic import Traffic
from scpf.sample_logs.weather import WEATHERS
from scpf.sample_logs.world import World, build_world

pytestmark = pytest.mark.skipif(
    "SCPF_BENCHMARK" not in os.environ, reason="a benchmark: SCPF_BENCHMARK=1 runs it"
)
BARS_S = {2048: 1.6, 1024: 0.5}
PLACES_M = (36.0, 214.0, 472.0, 612.0, 904.0, 1120.0)
COMPILATION_S = 25.0


@pytest.fixture(scope="module")
def world() -> World:
    turn = np.linspace(0, 2 * np.pi, 800, endpoint=False)
    radius = 1 + 0.12 * np.cos(3 * turn + 1) + 0.05 * np.cos(5 * turn)
    ring = CentreLine(
        np.column_stack([470 * radius * np.cos(turn), 350 * radius * np.sin(turn)]), closed=True
    )
    return build_world(ring, place_poles(ring, 99, seed=4), seed=4, route_m=(0.0, 1200.0))


def pose(world: World, s_m: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """T_map_body of a bus in its lane."""
    position, tangent, normal = world.centre_line.at(s_m, -1.85)
    T_map_body = np.eye(4)
    T_map_body[:2, 0], T_map_body[:2, 1], T_map_body[:3, 3] = tangent, normal, position
    return T_map_body


@pytest.mark.parametrize("width_px", list(BARS_S))
def test_cpu_of_a_frame(world: World, width_px: int) -> None:
    """The median of each weather, traffic and street lamps included, is within the bar."""
    lamps = [
        [*world.centre_line.at(pole.s_m, pole.offset_m - np.sign(pole.offset_m) * 1.9)[0][:2], 8.45]
        for pole in world.poles
    ]
    medians = {}
    for name, weather in WEATHERS.items():
        camera = basler_camera(width_px)
        renderer = Renderer(world.scene, world.textures, camera, weather, seed=1, street_lamps_m=lamps)
        traffic = Traffic(1, world, weather.lamps_are_lit)
        taken = []
        for number, s_m in enumerate((PLACES_M[0], *PLACES_M)):
            moving = traffic.at(s_m / 5.5, s_m)
            start = time.process_time()
            renderer.render(
                pose(world, s_m), speed_mps=5.5, yaw_rate_radps=0.02, moving=moving, frame_seed=number
            )
            taken.append(time.process_time() - start)
        medians[name] = statistics.median(taken[1:])  # the first frame touches the buffers' memory
        print(f"{width_px} px {name:9} median {medians[name]:.2f} s CPU, worst {max(taken[1:]):.2f}")
    assert max(medians.values()) <= BARS_S[width_px]


def test_cpu_of_the_first_use(tmp_path: Path) -> None:
    """Compilation, into a cache of its own."""
    code = """
import time
from scpf.sample_logs.renderer import warm_up
start = time.process_time()
warm_up()
print(time.process_time() - start)
"""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    for bar_s in (COMPILATION_S, 3.0):
        done = subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
        )
        print(f"warm_up {float(done.stdout):.1f} s CPU")
        assert float(done.stdout) <= bar_s
