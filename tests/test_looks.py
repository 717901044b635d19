"""Three looks at a picture: what they agree on is surer, what one alone has seen is doubted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scpf.models import looks, polenet, segmentation
from scpf.models.errors import InputError, MissingError
from scpf.models.grouping import logit
from scpf.models.instances import Instance
from scpf.sample_logs.street_scenes import scene

THRESHOLD = 0.5


def pole(x: int, score: float, height: int = 40) -> Instance:
    """A pole of 4 px at column ``x``."""
    return Instance((x, 10.0, x + 4.0, 10.0 + height), np.ones((height, 4), bool), (x, 10), score)


def mean_score(*scores: float) -> float:
    return float(1 / (1 + np.exp(-np.mean([logit(score) for score in scores]))))


def test_what_all_have_seen_has_the_mean_of_their_log_odds() -> None:
    found = looks.together([[pole(20, 0.9)], [pole(21, 0.6)], [pole(19, 0.7)]])
    assert [each.offset_px for each in found] == [(20, 10)]
    assert found[0].score == pytest.approx(mean_score(0.9, 0.6, 0.7))


def test_the_same_three_times_is_the_same() -> None:
    look = [pole(20, 0.9), pole(60, 0.3)]
    together = looks.together([look] * 3)
    assert [(each.offset_px, each.box_px) for each in together] == [(e.offset_px, e.box_px) for e in look]
    assert [each.score for each in together] == pytest.approx([0.9, 0.3])


def test_what_one_alone_has_seen_is_doubted_but_there() -> None:
    found = looks.together([[pole(20, 0.9)], [pole(60, 0.95), pole(20, 0.9)], [pole(20, 0.9)]])
    assert [each.offset_px[0] for each in found] == [20, 60]
    assert (
        found[1].score == pytest.approx(mean_score(0.95, looks.UNSEEN, looks.UNSEEN)) and found[1].score < 0.2
    )


def test_of_two_poles_in_one_place_the_one_that_shares_more_counts() -> None:
    found = looks.together([[pole(20, 0.9)], [pole(22, 0.2), pole(20, 0.8)]])
    assert found[0].score == pytest.approx(mean_score(0.9, 0.8))


def test_no_look_has_found_anything() -> None:
    assert looks.together([[], [], []]) == []


@pytest.mark.parametrize(
    ("size_px", "zoom", "shown_px"),
    [
        ((2048, 1536), 0.9, (922, 691)),
        ((1024, 768), 1.25, (1280, 960)),
        ((1000, 750), 1.25, (1250, 938)),
        ((37, 21), 1.25, (74, 42)),  # no picture is enlarged more than twice
        ((4_000_000, 1), 1.25, (4096, 1)),
    ],
)
def test_a_zoom_stays_within_the_limits_of_any_picture(
    size_px: tuple[int, int], zoom: float, shown_px: tuple[int, int]
) -> None:
    framed, shown = segmentation.frame(np.zeros((size_px[1], size_px[0], 3), np.uint8), zoom)
    assert shown == shown_px
    assert all(side % segmentation.STRIDE_PX == 0 for side in framed.shape[:2])


def test_the_shipped_network_looks_thrice() -> None:
    once = segmentation.load("polenet", threads=1, threshold=THRESHOLD)
    thrice = segmentation.load("thorough", threads=1, threshold=THRESHOLD)
    assert isinstance(thrice, looks.ThoroughSegmenter) and thrice.info.classes == ("light_pole",)
    image = np.ascontiguousarray(scene(900_009)[0][:, :, ::-1])
    found, single = thrice(image), once(image)
    assert found and all(each.score >= THRESHOLD for each in found)
    assert [each.score for each in found] == sorted((each.score for each in found), reverse=True)
    masks = {each.offset_px: each.mask for each in single}
    shared = [each for each in found if each.offset_px in masks]
    assert shared, "the first look is the usual one"
    assert all(np.array_equal(each.mask, masks[each.offset_px]) for each in shared)


def test_weights_of_one_s_own_look_thrice(tmp_path: Path) -> None:
    own = tmp_path / "own.safetensors"
    own.write_bytes(polenet.weights_path("polenet").read_bytes())
    assert isinstance(segmentation.load(f"thorough:{own}", threads=1), looks.ThoroughSegmenter)
    with pytest.raises(MissingError, match="no such weights"):
        segmentation.load(f"thorough:{tmp_path / 'none.safetensors'}")
    own.write_bytes(b"no weights")
    with pytest.raises(InputError, match="not a whole safetensors file"):
        segmentation.load(f"thorough:{own}")
