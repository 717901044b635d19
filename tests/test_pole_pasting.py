"""Poles pasted into training pictures: where they are labelled, they are; what hides them takes the label away."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from scpf.models import pole_pasting
from scpf.models.instances import instance_from_mask
from scpf.models.labelled_images import IdsImage, LabelledObject, Picture
from scpf.models.pasted_scaffold import draw_scaffold
from scpf.models.pole_pasting import paste_poles
from scpf.models.polenet_samples import make_sample

POLE = (30, 200, 60)  # a colour that nothing else has


def donor(top: int = 20, *, gap: int = 0) -> Picture:
    """A picture (240, 160) with a pole 6 px wide from the row ``top`` on, ``gap`` rows of it hidden."""
    image = np.full((240, 160, 3), 120, np.uint8)
    mask = np.zeros((240, 160), np.bool_)
    mask[top:210, 80:86] = True
    mask[100 : 100 + gap] = False
    image[mask] = POLE
    return Picture(image, [LabelledObject(instance_from_mask(mask))])


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    """Poles alone: no scaffold behind, no signs, nothing on them, their colours kept."""
    monkeypatch.setattr(pole_pasting, "WITH_SCAFFOLD", 0.0)
    monkeypatch.setattr(pole_pasting, "WITH_SIGNS", 0.0)
    monkeypatch.setattr(pole_pasting, "_hang", lambda *arguments: None)
    monkeypatch.setattr(pole_pasting, "_rails", lambda *arguments: None)
    monkeypatch.setattr(pole_pasting, "_toned", lambda colours, *arguments: colours)


def pasted(seed: int, picture: Picture, grey: int = 120) -> tuple[np.ndarray, np.ndarray]:
    image, ids = np.full((300, 400, 3), grey, np.uint8), np.zeros((300, 400), np.uint8)
    ids[40:200, 10:16] = 1
    paste_poles(image, ids, picture, 140.0, np.random.default_rng(seed))
    return image, ids


@pytest.mark.usefixtures("bare")
def test_a_pasted_pole_is_labelled_where_it_is_seen_and_brings_no_background() -> None:
    seen = 0
    for seed in range(20):
        image, ids = pasted(seed, donor(), grey=40)
        green = image[..., 1].astype(int) - image[..., 0]  # 170 where a pole is, 0 in grey
        for number in set(np.unique(ids).tolist()) - {0, 1}:
            rows, columns = np.nonzero(ids == number)
            assert np.ptp(rows) > 2 * np.ptp(columns)
            seen += 1
        assert (green[ids > 1] > 60).all()
        assert green[cv2.dilate((ids > 1).astype(np.uint8), np.ones((9, 9))) == 0].max() <= 2
        assert image[..., 0].max() <= 41  # the donor's grey, 120, stays behind
    assert seen >= 20


@pytest.mark.usefixtures("bare")
def test_a_pole_without_its_top_stays_without_it() -> None:
    whole = [np.nonzero(pasted(seed, donor())[1] > 1)[0].min() for seed in range(12)]
    cut = [np.nonzero(pasted(seed, donor(top=0))[1] > 1)[0].min() for seed in range(12)]
    assert max(whole) > 40
    assert max(cut) == 0


def test_nothing_is_pasted_of_poles_behind_leaves_or_that_are_not_judged() -> None:
    plain = donor()
    ignored = Picture(plain.image, [replace(plain.objects[0], ignored=True)])
    for picture in (donor(gap=40), donor(top=170), ignored):
        image, ids = pasted(3, picture)
        assert (image == 120).all() and ids.max() == 1


@pytest.mark.usefixtures("bare")
def test_what_could_not_be_seen_is_not_labelled() -> None:
    plain = donor()
    faint = Picture(np.full_like(plain.image, 126), plain.objects)
    for seed in range(8):
        image, ids = pasted(seed, faint)
        assert (image == 120).all() and ids.max() == 1


def test_boards_rails_and_scaffolds_hide_what_is_behind_them() -> None:
    hidden = 0
    for seed in range(12):
        image, ids = np.full((300, 400, 3), 120, np.uint8), np.full((300, 400), 7, np.uint8)
        x1, y1, x2, y2 = draw_scaffold(image, ids, np.random.default_rng(seed))
        assert not ids[y1:y2, x1:x2].any()
        outside = np.ones(ids.shape, np.bool_)
        outside[y1:y2, x1:x2] = False
        assert (ids[outside] == 7).all() and (image[outside] == 120).all()
        assert image[y1:y2, x1:x2].std() > 5
        hidden += int((pasted(seed, donor())[1][40:200, 10:16] != 1).any())
    assert hidden


@pytest.mark.parametrize("size", [(1, 1), (3, 200), (200, 2), (9, 9)])
def test_a_picture_however_small_takes_a_scaffold_and_poles(size: tuple[int, int]) -> None:
    for seed in range(12):
        image, ids = np.full((*size, 3), 120, np.uint8), np.ones(size, np.uint8)
        x1, y1, x2, y2 = draw_scaffold(image, ids, np.random.default_rng(seed))
        assert 0 <= x1 < x2 <= size[1] and 0 <= y1 < y2 <= size[0]
        paste_poles(image, ids, donor(), size[0] / 2, np.random.default_rng(seed))


def test_signs_come_with_pasted_poles_and_stand_on_the_road(monkeypatch: pytest.MonkeyPatch) -> None:
    places: list[tuple[float, float]] = []
    monkeypatch.setattr(
        pole_pasting, "draw_sign", lambda image, ids, x, foot, horizon, rng: places.append((x, foot))
    )
    for seed in range(30):
        pasted(seed, donor())
    assert 10 <= len(places) <= 40
    assert all(0 <= x < 400 and 140 < foot <= 140 + 0.6 * 300 for x, foot in places)


def test_what_hangs_on_a_pole_or_crosses_it_is_no_pole() -> None:
    for hide in (pole_pasting._hang, pole_pasting._rails):
        taken = 0
        for seed in range(12):
            image, ids = np.full((300, 400, 3), 120, np.uint8), np.zeros((300, 400), np.uint8)
            ids[20:280, 200:212], image[20:280, 200:212] = 5, POLE
            before = ids.copy()
            hide(image, ids, (200, 20, 212, 280), np.random.default_rng(seed))
            gone = (before == 5) & (ids != 5)
            taken += int(gone.any())
            assert (ids[~gone] == before[~gone]).all()
            assert (image[gone] != POLE).any(axis=-1).mean() > 0.95 if gone.any() else True
        assert taken


@pytest.mark.usefixtures("bare")
def test_pasted_poles_stand_on_the_road_and_are_higher_than_signs() -> None:
    found = 0
    for seed in range(40):
        _, ids = pasted(seed, donor())
        for number in set(np.unique(ids).tolist()) - {0, 1}:
            rows = np.nonzero((ids == number).any(1))[0]
            if rows[0] > 0 and rows[-1] < 299 and np.count_nonzero(ids == number) > 60:
                found += 1
                below = rows[-1] - 140
                assert below > 0
                assert np.ptp(rows) / below > 2.1  # other poles may hide a part of it
    assert found > 10


def test_a_sample_with_a_donor_is_the_same_for_its_seed_and_teaches_more_poles(tmp_path: Path) -> None:
    picture = donor()
    cv2.imwrite(str(tmp_path / "a.png"), picture.image[..., ::-1])
    cv2.imwrite(str(tmp_path / "a.ids.png"), picture.ids())
    cv2.imwrite(str(tmp_path / "none.ids.png"), np.zeros((240, 160), np.uint8))
    source, without = (
        IdsImage(tmp_path / "a.png", tmp_path / "a.ids.png"),
        IdsImage(tmp_path / "a.png", tmp_path / "none.ids.png"),
    )
    covered = 0.0
    for seed in range(6):
        one, two = (make_sample(without, (160, 224), np.random.default_rng(seed), source) for _ in range(2))
        assert all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))
        covered += float(one.cover.sum())
        assert not make_sample(without, (160, 224), np.random.default_rng(seed)).cover.any()
    assert covered > 0
