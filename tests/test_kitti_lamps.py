"""Which lamp a detection is of, as the figures of docs/KITTI.md count them."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from scpf.models.camera import Camera, looking_ahead

HEIGHT_M, FOCAL_PX = 1.65, 700.0
LAMPS_M = {
    "near": np.array([20.0, 2.0]),
    "behind it": np.array([100.0, 10.0]),
    "right": np.array([30.0, -5.0]),
}


@pytest.fixture
def judge(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(Path(__file__).parent / "benchmarks")
    return importlib.import_module("kitti_lamps")


def lamps_of(judge: ModuleType, *feet_px: tuple[float, float]) -> list[str | None]:
    T_body_camera = looking_ahead()
    T_body_camera[2, 3] = HEIGHT_M
    matrix = np.array([[FOCAL_PX, 0, 600], [0, FOCAL_PX, 180], [0, 0, 1]])
    camera = Camera(1200, 370, matrix, T_body_camera=T_body_camera)
    pose = np.eye(4)
    pose[2, 3] = 7.0  # the map's heights do not matter
    found: list[str | None] = judge.lamps_of(np.array(feet_px).reshape(-1, 2), camera, pose, LAMPS_M)
    return found


def foot(name: str, right_px: float = 0.0, up_px: float = 0.0) -> tuple[float, float]:
    ahead, left = LAMPS_M[name]
    return 600 - FOCAL_PX * left / ahead + right_px, 180 + FOCAL_PX * HEIGHT_M / ahead - up_px


def test_of_two_lamps_in_one_direction_the_foot_tells_which(judge: ModuleType) -> None:
    assert lamps_of(judge, foot("near")) == ["near"]
    assert lamps_of(judge, foot("behind it")) == ["behind it"]
    assert lamps_of(judge, foot("behind it"), foot("near"), foot("right")) == ["behind it", "near", "right"]


def test_a_bearing_a_little_nearer_to_the_lamp_behind_does_not_make_it_that_one(judge: ModuleType) -> None:
    assert lamps_of(judge, foot("near", right_px=5.0, up_px=18.0)) == ["near"]


def test_a_foot_hidden_by_a_car_leaves_the_bearing_to_decide(judge: ModuleType) -> None:
    assert lamps_of(judge, foot("right", right_px=3.0, up_px=60.0)) == ["right"]


def test_a_post_that_stands_nearer_in_that_direction_is_no_lamp(judge: ModuleType) -> None:
    assert lamps_of(judge, foot("right", up_px=-86.0)) == [None]


def test_a_picture_without_detections_has_none(judge: ModuleType) -> None:
    assert lamps_of(judge) == []


def test_what_stands_elsewhere_is_no_lamp_and_each_lamp_is_found_once(judge: ModuleType) -> None:
    assert lamps_of(judge, foot("right", right_px=60.0)) == [None]
    assert lamps_of(judge, foot("right", right_px=9.0), foot("right")) == [None, "right"]
