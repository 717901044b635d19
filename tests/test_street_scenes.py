"""Painted street scenes: the same for a seed, with plausible poles whose ids lie where they are painted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from scpf.models.errors import InputError
from scpf.models.labelled_images import IGNORED_ID
from scpf.sample_logs import street_scenes, street_signs
from scpf.sample_logs.scene_files import write_scenes
from scpf.sample_logs.street_billboards import billboard, poster
from scpf.sample_logs.street_canvas import Canvas, StreetCamera, Tube
from scpf.sample_logs.street_flags import flags
from scpf.sample_logs.street_houses import site_fence
from scpf.sample_logs.street_scenes import MOST_LAMPS, SIZES_PX, scene
from scpf.sample_logs.street_signs import sign_post


def black_canvas(width_px: int = 640, height_px: int = 480, *, level: bool = False) -> Canvas:
    """Without haze, seen by the camera of seed 0; ``level``: looking straight ahead."""
    camera = StreetCamera(np.random.default_rng(0), width_px, height_px)
    if level:
        camera.R_camera_street = np.eye(3)
    return Canvas(camera, (0.0, 0.0, 0.0), 1e9, 0.0)


def test_a_scene_is_the_same_for_its_seed_and_another_for_another() -> None:
    (image, ids), (again, ids_again), (other, _) = scene(3), scene(3), scene(3, (640, 480))
    assert np.array_equal(image, again)
    assert np.array_equal(ids, ids_again)
    assert other.shape == (480, 640, 3)
    assert not np.array_equal(scene(4, (640, 480))[0], other)


def test_scenes_have_poles_taller_than_wide_on_a_small_part_of_the_picture() -> None:
    tall = 0
    for seed in range(6):
        image, ids = scene(seed)
        assert image.shape[:2] == ids.shape
        assert ids.shape[::-1] in SIZES_PX
        assert image.std() > 10
        assert (ids > 0).mean() < 0.15
        for i in set(np.unique(ids).tolist()) - {0, 255}:
            assert i <= MOST_LAMPS
            rows, columns = np.nonzero(ids == i)
            tall += int(np.ptp(rows) > 60 and np.ptp(rows) > np.ptp(columns))
    assert tall >= 8


@pytest.mark.parametrize("radius_m", [0.02, 0.05, 0.2])
def test_a_tube_is_as_thick_as_the_camera_sees_it(radius_m: float) -> None:
    canvas = black_canvas(level=True)
    canvas.tubes([Tube((0.013, 0, 5), (0.013, 3, 5), radius_m, radius_m)], (200.0, 200.0, 200.0), 7)
    expected_px = 2 * radius_m * canvas.camera.focal_px / 5
    rows = slice(200, 260)
    assert (canvas.ids[rows] == 7).sum(1).mean() == pytest.approx(expected_px, abs=0.6)
    covered = np.count_nonzero(canvas.image[rows, :, 0], axis=1).mean()
    assert expected_px - 0.3 <= covered <= expected_px + 2


def test_what_stands_before_a_pole_hides_it() -> None:
    canvas = black_canvas(320, 240)
    canvas.tubes([Tube((0, 0, 9), (0, 6, 9), 0.1, 0.1)], (90.0, 90.0, 90.0), 1)
    assert (canvas.ids == 1).any()
    canvas.polygon(np.array([(0, 0), (320, 0), (320, 240), (0, 240)]), (1.0, 2.0, 3.0))
    assert not canvas.ids.any()


def test_a_pole_is_seen_through_the_mesh_of_a_site_fence() -> None:
    canvas = black_canvas()
    canvas.tubes([Tube((3, 0, 15), (3, 6, 15), 0.1, 0.1)], (90.0, 90.0, 90.0), 1)
    before, there = canvas.image.copy(), np.count_nonzero(canvas.ids)
    site_fence(canvas, np.random.default_rng(1), 1.0, 6.0)
    assert (canvas.image != before).any(2).sum() > 2000
    assert set(np.unique(canvas.ids).tolist()) == {0, 1}
    assert 0.7 * there < np.count_nonzero(canvas.ids) <= there


def test_a_flag_is_no_lamp_post_but_a_staff_without_its_cloth_may_be_one() -> None:
    for tilt, expected in ((0.0, {0}), (1.0, {0, IGNORED_ID})):  # looking ahead, and far down
        c, s = np.cos(0.35 * tilt), np.sin(0.35 * tilt)
        canvas = black_canvas()
        canvas.camera.R_camera_street = np.array([[1.0, 0, 0], [0, c, s], [0, -s, c]])
        for seed in range(5):
            flags(canvas, np.random.default_rng(seed), 0.5, 14.0)
        assert canvas.image.any()
        assert set(np.unique(canvas.ids).tolist()) == expected


def test_a_faint_lamp_post_takes_the_colour_of_what_is_behind_it() -> None:
    canvas = black_canvas(320, 240)
    canvas.image[:] = (10, 60, 110)
    seen = canvas.seen_along(np.array([0.0, 0, 12]), np.array([0.0, 4, 12]))
    assert seen == pytest.approx([10, 60, 110])
    assert canvas.seen_along(np.array([0.0, 50, 12]), np.array([0.0, 60, 12])) == pytest.approx([110] * 3)


def test_written_scenes_are_read_back(tmp_path: Path) -> None:
    write_scenes(tmp_path, range(5, 6))
    image, ids = scene(5)
    assert np.array_equal(cv2.imread(str(tmp_path / "toy_000005.png"), cv2.IMREAD_UNCHANGED), ids)
    written = cv2.imread(str(tmp_path / "toy_000005.jpg"))
    assert written is not None
    assert np.abs(written.astype(int) - image).mean() < 8


def test_two_processes_write_what_one_does(tmp_path: Path) -> None:
    told: list[int] = []
    write_scenes(tmp_path / "one", range(3))
    write_scenes(tmp_path / "two", range(3), workers=2, progress=told.append)
    assert told == [1, 2, 3]
    one, two = (sorted((tmp_path / name).iterdir()) for name in ("one", "two"))
    assert [path.name for path in one] == [path.name for path in two]
    assert all(a.read_bytes() == b.read_bytes() for a, b in zip(one, two, strict=True))


def test_a_scene_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    (tmp_path / "toy_000000.jpg").mkdir()
    with pytest.raises(InputError, match=r"toy_000000\.jpg cannot be written"):
        write_scenes(tmp_path, range(1))


@pytest.mark.parametrize("draw", [sign_post, billboard])
def test_signs_and_billboards_hide_lamp_posts_and_are_none(
    draw: Callable[[Canvas, np.random.Generator, float, float], None],
) -> None:
    heights_px = []
    for seed in range(12):
        canvas = black_canvas()
        canvas.ids[:] = 1
        draw(canvas, np.random.default_rng(seed), 0.5, 9.0)
        drawn, hidden = canvas.image.any(axis=2), canvas.ids == 0
        assert not (hidden & ~drawn).any()
        assert np.count_nonzero(hidden) > 0.7 * np.count_nonzero(drawn)  # the rest are rims half covered
        heights_px.append(np.ptp(np.flatnonzero(drawn.any(axis=1))) + 1)
    tallest_m = {sign_post: 4.5, billboard: 7.0}[draw]
    assert max(heights_px) <= tallest_m * canvas.camera.focal_px / 8.0


def test_the_post_of_a_sign_seen_from_behind_stands_before_its_plates(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(street_signs, "ON_A_BASE", 0.0)
    broken = {}
    for share in (0.0, 1.0):
        monkeypatch.setattr(street_signs, "FROM_BEHIND", share)
        broken[share] = 0
        for seed in range(20):
            canvas = black_canvas(level=True)
            sign_post(canvas, np.random.default_rng(seed), 0.0, 6.0)
            post = canvas.image[:, 320].astype(int)
            post = post[post.any(axis=1)]
            post = post[len(post) // 3 : -3]  # the uppermost plate may reach above its post
            broken[share] += int(np.ptp(post, axis=0).max() > 20)
    assert broken[0.0] >= 5
    assert broken[1.0] == 0


def test_lamp_posts_stand_before_scaffolds(monkeypatch: pytest.MonkeyPatch) -> None:
    scaffolds, lamps = [], []
    monkeypatch.setattr(street_scenes, "scaffold", lambda *given: scaffolds.append(given[2:5]))
    monkeypatch.setattr(street_scenes, "lamp_post", lambda *given: lamps.append(given[2:4]))
    monkeypatch.setattr(street_scenes, "BEFORE_A_SCAFFOLD", 1.0)
    for seed in range(3):
        scaffolds.clear()
        lamps.clear()
        scene(seed, (320, 240))
        assert scaffolds
        for front_m, z_m, length_m in scaffolds:
            near = [x for x, z in lamps if z_m <= z <= max(z_m, 5.0) + length_m / 2]
            assert any(0.5 <= abs(x - front_m) <= 3.5 for x in near)


def test_a_poster_is_printed_all_over_and_another_for_another_seed() -> None:
    first, again, other = (poster(np.random.default_rng(seed), 2.0, 1.5) for seed in (1, 1, 2))
    assert first.shape == (72, 96, 3)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    deviations = [poster(np.random.default_rng(seed), 2.0, 1.5).std() for seed in range(10)]
    assert min(deviations) > 3
    assert np.median(deviations) > 20
