"""Map files, lists of points, and lines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scpf.ingest.calibration import read_camera
from scpf.ingest.maps import decimate, read_map, read_points, shift_left, write_map
from scpf.ingest.trajectories import read_trajectory
from scpf.models.errors import InputError
from scpf.models.geodesy import Origin
from scpf.models.road_map import Landmark, RoadMap

POINTS = [
    Landmark("a", (10.0, 0.0, 1.0)),
    Landmark("b", (0.0, 20.0, 0.0), "tree"),
    Landmark("c", (90.0, 2.0, 0.0)),
]


@pytest.mark.parametrize("origin", [None, Origin(43.47, -80.54, 330.0)])
def test_maps_round_trip(tmp_path: Path, origin: Origin | None) -> None:
    line = np.column_stack([np.linspace(0, 90, 10), np.linspace(3, 5, 10)])
    path = tmp_path / "map.geojson"
    write_map(path, RoadMap(tuple(POINTS), line, 3.5, origin, "© someone"))
    back = read_map(path)
    assert [(m.id, m.landmark_class) for m in back.landmarks] == [(m.id, m.landmark_class) for m in POINTS]
    np.testing.assert_allclose(back.positions_m, [m.position_m[:2] for m in POINTS], atol=1e-3)
    np.testing.assert_allclose(back.centre_line_m, line, atol=1e-3)
    assert (back.half_width_m, back.origin, back.attribution) == (3.5, origin, "© someone")
    with pytest.raises(InputError, match="exists"):
        write_map(path, back)


def test_lines() -> None:
    assert len(decimate(np.zeros((5, 2)), 2.0)) == 1
    circle = 10 * np.column_stack([np.cos(np.linspace(0, 3, 100)), np.sin(np.linspace(0, 3, 100))])
    inside = shift_left(circle, 2.0)  # counter-clockwise: the centre is to the left
    np.testing.assert_allclose(np.hypot(*inside.T), 8.0, atol=0.05)


@pytest.mark.parametrize(
    "text",
    ["id,x,y,z,class\na,1,2,3,tree\nb,4,5,,\n", "class,y,x,id,z\ntree,2,1,a,3\n,5,4,b,\n", "a,1,2,3,tree\nb,4,5\n",
     "# poles\nid,x_m,y_m,z_m,class\na,1,2,3,tree\nb,4,5\n"],
)  # fmt: skip
def test_csv(tmp_path: Path, text: str) -> None:
    path = tmp_path / "points.csv"
    path.write_text(text)
    assert read_points(path) == [Landmark("a", (1.0, 2.0, 3.0), "tree"), Landmark("b", (4.0, 5.0, 0.0))]


@pytest.mark.parametrize(
    ("text", "what"),
    [("", "holds no point"), ("id,x\n", "no column y"), ("a,1,2\nb,x,3\n", ":2"), ("a,1,nan\n", "not finite"),
     ("a,1,2\na,3,4\n", "two points have the id 'a'"), ("a,1\n", ":1")],
)  # fmt: skip
def test_csv_that_is_no_list_of_points(tmp_path: Path, text: str, what: str) -> None:
    path = tmp_path / "points.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=what):
        read_points(path)


def test_arrays(tmp_path: Path) -> None:
    path = tmp_path / "points.npz"
    np.savez(path, poles=np.array([[1.0, 2.0], [3.0, 4.0]]), other=np.zeros(3))
    assert read_points(path) == [Landmark("0", (1.0, 2.0, 0.0)), Landmark("1", (3.0, 4.0, 0.0))]
    assert read_points(path, "poles") == read_points(path)
    for key in ("other", "none"):
        with pytest.raises(InputError, match=key):
            read_points(path, key)
    np.savez(path, a=np.zeros((2, 2)), b=np.zeros((2, 2)))
    with pytest.raises(InputError, match="2 arrays"):
        read_points(path)
    np.savez(path, a=np.array([[object(), 1]], dtype=object))
    with pytest.raises(InputError, match="cannot be read"):
        read_points(path)
    path.write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"not an \.npz"):
        read_points(path)
    np.savez_compressed(path, a=np.zeros((1 << 24, 2)))  # 256 MiB in 260 kB
    with pytest.raises(InputError, match="256 MiB"):
        read_points(path)


@pytest.mark.parametrize("text", ["", "[1", "[]", '{"type": "FeatureCollection"}', "[" * 100_000])
def test_files_that_are_no_map(tmp_path: Path, text: str) -> None:
    path = tmp_path / "map.geojson"
    path.write_text(text)
    with pytest.raises(InputError, match=r"map\.geojson"):
        read_map(path)


def test_kitti_06(shared_data: Path) -> None:
    assert len(read_points(shared_data / "kitti_06" / "poles.npz")) == 236


# Columns (px) of lamps and a sign at the height of the camera, read off the pictures by eye: frame, pole, column.
SEEN = ((0, 2, 137), (0, 18, 1031), (8, 24, 747), (15, 45, 290), (24, 24, 909), (30, 20, 1013), (30, 24, 1103),
        (30, 53, 374), (44, 53, 200), (45, 52, 524), (45, 63, 566))  # fmt: skip


def test_the_poles_of_kitti_06_stand_where_the_pictures_show_them(shared_data: Path) -> None:
    """The lidar's pole map fits the first camera when turned by +1.0° and moved by (−0.53, −0.23) m."""
    data = shared_data / "kitti_06"
    camera = read_camera(data / "calib.txt", image_size_px=(1226, 370))
    stamps = (np.arange(51) * 10**8).astype(np.int64)
    trajectory = read_trajectory(data / "poses.txt", stamps_ns=stamps)
    positions = np.array([mark.position_m[:2] for mark in read_points(data / "poles.npz")])
    turn = np.radians(1.0)
    positions = positions @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    positions += (-0.53, -0.23)
    for frame, pole, column_px in SEEN:
        T_camera_map = np.linalg.inv(trajectory.poses()[frame] @ camera.T_body_camera)
        point = T_camera_map @ np.array([*positions[pole], 0.0, 1.0])
        assert camera.project(point[None, :3])[0, 0] == pytest.approx(column_px, abs=6.0), (frame, pole)
