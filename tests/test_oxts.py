"""KITTI raw OXTS folders: axes, times, and what is refused."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from scpf.ingest.oxts import is_oxts, read_oxts
from scpf.ingest.trajectories import read_trajectory
from scpf.models.errors import InputError
from scpf.models.geodesy import Origin, geodetic_from_enu

BASE = (49.0, 8.4, 116.0)


def write(folder: Path, rows: list[tuple[float, ...]], times: int | None = None) -> Path:
    (folder / "data").mkdir(parents=True)
    for k, row in enumerate(rows):
        numbers = [*row, *[0.0] * (30 - len(row))]
        (folder / "data" / f"{k:010d}.txt").write_text(" ".join(f"{value:.12f}" for value in numbers))
    lines = [f"2011-09-26 13:02:{44 + k}.335092332" for k in range(len(rows) if times is None else times)]
    (folder / "timestamps.txt").write_text("\n".join(lines) + "\n")
    return folder


def at(east: float, north: float, up: float = 0.0) -> tuple[float, float, float]:
    place = geodetic_from_enu(np.array([[east, north, up]]), Origin(*BASE))
    return float(place[0][0]), float(place[1][0]), float(place[2][0])


def test_axes_and_times(tmp_path: Path) -> None:
    """Driving North at first, then East, nose up, leaning left side up."""
    rows = [(*at(0, 0), 0, 0, np.pi / 2), (*at(0, 10), 0, 0, 0), (*at(10, 10, 1), 0.1, -0.2, 0)]
    found = read_oxts(write(tmp_path / "oxts", rows))
    assert found.origin == pytest.approx(BASE)
    assert found.trajectory.stamps_ns[0] == 1317042164335092332
    np.testing.assert_allclose(found.trajectory.positions_m, [[0, 0, 0], [0, 10, 0], [10, 10, 1]], atol=1e-6)
    poses = found.trajectory.poses()
    np.testing.assert_allclose(poses[0][:3, 0], [0, 1, 0], atol=1e-9)  # ahead is North
    np.testing.assert_allclose(poses[1][:3, 0], [1, 0, 0], atol=1e-5)
    assert poses[2][2, 0] == pytest.approx(np.sin(0.2), abs=1e-5)  # pitch is positive front down
    assert poses[2][2, 1] > 0.09  # roll is positive left side up


def test_a_drive_s_folder_will_do_and_an_origin_is_used(tmp_path: Path) -> None:
    write(tmp_path / "oxts", [(*at(0, 0), 0, 0, 0), (*at(5, 0), 0, 0, 0)])
    assert is_oxts(tmp_path)
    assert not is_oxts(tmp_path / "oxts" / "data")
    assert not is_oxts(tmp_path / "nowhere")
    latitude, longitude, height = at(-100, 0)
    trajectory = read_trajectory(tmp_path, origin=Origin(latitude, longitude, height))
    np.testing.assert_allclose(trajectory.positions_m[:, 0], [100, 105], atol=1e-3)


def test_more_times_than_records_need_a_decision(tmp_path: Path) -> None:
    folder = write(tmp_path / "oxts", [(*at(0, 0), 0, 0, 0), (*at(5, 0), 0, 0, 0)], times=7)
    with pytest.raises(InputError, match="7 times for 2 records") as caught:
        read_oxts(folder)
    assert "keep the first 2 lines" in caught.value.hint
    assert len(read_oxts(folder, cut_times=True).trajectory) == 2


@pytest.mark.parametrize(
    ("name", "content", "what"),
    [
        ("timestamps.txt", "2011-09-26 13:02:44.3\n", "1 times for 2 records"),
        (
            "timestamps.txt",
            "2011-09-26 13:02:44.3\n2011-09-26 13:02:44.3\n",
            ":2: the time does not increase",
        ),
        ("timestamps.txt", "2011-09-26 13:02:44.3\nlater\n", ":2: 'later' is not a time"),
        ("data/0000000001.txt", "49 8.4 116", "1.txt:1: 3 numbers"),
        ("data/0000000001.txt", "49 8.4 x" + " 0" * 27, "could not convert"),
        ("data/0000000001.txt", "149 8.4 116" + " 0" * 27, "latitude 149.0"),
        ("data/0000000001.txt", "nan 8.4 116" + " 0" * 27, "is no position"),
        ("data/0000000007.txt", "49 8.4 116" + " 0" * 27, "record 2 is missing"),
        ("data/readme.txt", "x", "its name is no number"),
    ],
)
def test_folders_that_are_refused(tmp_path: Path, name: str, content: str, what: str) -> None:
    folder = write(tmp_path / "oxts", [(*at(0, 0), 0, 0, 0), (*at(5, 0), 0, 0, 0)])
    (folder / name).write_text(content)
    with pytest.raises(InputError, match=what):
        read_oxts(folder)


def test_kitti_0002_moves_as_its_own_velocities_say(shared_data: Path, tmp_path: Path) -> None:
    source = shared_data / "kitti_raw_0002" / "oxts"
    with pytest.raises(InputError, match="77 times for 10 records"):
        read_oxts(source)
    shutil.copytree(source / "data", tmp_path / "data")
    lines = (source / "timestamps.txt").read_text().splitlines()[:10]
    (tmp_path / "timestamps.txt").write_text("\n".join(lines))
    trajectory = read_oxts(tmp_path).trajectory
    step = np.diff(trajectory.positions_m, axis=0) / (np.diff(trajectory.stamps_ns) * 1e-9)[:, None]
    stated = [np.loadtxt(file)[[7, 6]] for file in sorted((tmp_path / "data").glob("*.txt"))]
    # The published times are a few ms off the positions.
    np.testing.assert_allclose(step[:, :2].mean(axis=0), np.mean(stated, axis=0), rtol=0, atol=0.05)
    ahead = trajectory.poses()[:-1, :3, 0]
    assert ((ahead * step).sum(axis=1) / np.linalg.norm(step, axis=1)).min() > 0.999
