"""Figures of a distance model: files that are pictures, the same each time, and a remedy without matplotlib."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scpf.models.errors import MissingError
from scpf.replay.distance_evaluation import Residuals
from scpf.replay.distance_figures import check_matplotlib, draw, drawn, figure_paths

PAIR = {"pair": ["box", "box + mask"], "difference_m": 0.3, "low_m": 0.2, "high_m": 0.4, "p": 0.001}
COMPARISONS = {
    "random": {"close": {"repetitions": 9, "mae_m": {"box": 0.7, "box + mask": 0.4}, "pairs": [PAIR]}},
    "by_pole": {"close": None},
}


def held_out(scale: float = 1.0) -> Residuals:
    rng = np.random.default_rng(0)
    distance = rng.uniform(5.0, 55.0, 200)
    expert = (distance > 20.0).astype(np.intp)
    return Residuals(scale * rng.normal(size=200), np.full(200, 1.0), np.full(200, 0.5), distance, expert)


def test_four_pictures_that_depend_on_the_figures(tmp_path: Path) -> None:
    first = draw(tmp_path / "a", "light pole", ("close", "far"), held_out(), COMPARISONS, "about")
    again = draw(tmp_path / "b", "light pole", ("close", "far"), held_out(), COMPARISONS, "about")
    other = draw(
        tmp_path / "c", "light pole", ("close", "far"), held_out(2.0), {"random": {}, "by_pole": {}}, "about"
    )
    assert first == figure_paths(tmp_path / "a", "light pole")
    assert sorted((tmp_path / "a").iterdir()) == sorted(first) == drawn(tmp_path / "a")
    for one, same, different in zip(first, again, other, strict=True):
        assert one.read_bytes() == same.read_bytes()
        assert one.read_bytes() != different.read_bytes()
        with Image.open(one) as picture:
            assert picture.format == "PNG"
            assert len(np.unique(np.asarray(picture.convert("L")))) > 20


def test_a_single_pole_leaves_nothing_to_draw(tmp_path: Path) -> None:
    none = np.zeros(0)
    empty = Residuals(none, none, none, none, np.zeros(0, dtype=np.intp))
    assert len(draw(tmp_path, "sign", ("single",), empty, {"random": {}, "by_pole": {}}, "about")) == 4


def test_without_matplotlib_the_remedy_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingError, match="matplotlib") as caught:
        check_matplotlib()
    assert "pip install 'scpf[figures]'" in caught.value.hint
    with pytest.raises(MissingError):
        draw(tmp_path / "none", "light pole", ("close", "far"), held_out(), COMPARISONS, "about")
    assert not (tmp_path / "none").exists()
