"""PoleNet's finest levels, computed only where poles may be: the same there, and nothing elsewhere."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from painted_scenes import write_painted_scenes
from torch import Tensor

from scpf.models import pole_tiles, polenet
from scpf.models.labelled_images import IdsImage, ids_images
from scpf.models.pole_tiles_fit import LEAST_PASSING, fit_tile_gate, gate_pictures
from scpf.models.polenet_inference import batch_maps, for_inference, maps, to_input
from scpf.models.segmentation import MASK_THRESHOLD, frame

pytestmark = pytest.mark.usefixtures("one_thread")

HEIGHT_PX, WIDTH_PX = 128, 192
ROWS, COLUMNS = HEIGHT_PX // 32, WIDTH_PX // 32
CORNERS_AND_MIDDLE = [(0, 0, 0), (0, 0, 5), (1, 3, 0), (1, 3, 5), (0, 1, 2), (0, 1, 3), (1, 0, 4)]
NOTHING = (*[0.0] * 32, -1.0)


@pytest.fixture(scope="module")
def net() -> polenet.PoleNet:
    torch.manual_seed(0)
    net = polenet.PoleNet().eval()
    for layer in net.modules():  # what a training leaves is not 0 and 1
        if isinstance(layer, torch.nn.BatchNorm2d):
            torch.nn.init.normal_(layer.bias, 0.3, 0.3)
    return net


@pytest.fixture
def framed() -> np.ndarray:
    return np.random.default_rng(0).integers(0, 256, (2, HEIGHT_PX, WIDTH_PX, 3)).astype(np.uint8)


def tiles_of(whole: Tensor) -> Tensor:
    """(B, rows, columns, C, s, s) of a map (B, C, H, W)."""
    side = whole.shape[2] // ROWS
    return whole.unfold(2, side, side).unfold(3, side, side).permute(0, 2, 3, 1, 4, 5)


@pytest.mark.parametrize(("kind", "tolerance"), [(torch.float32, 1e-5), (torch.bfloat16, 0.1)])
@pytest.mark.parametrize(
    "where", [CORNERS_AND_MIDDLE, CORNERS_AND_MIDDLE[:1], [*np.ndindex(2, ROWS, COLUMNS)]]
)
def test_some_tiles_are_as_in_the_whole(
    net: polenet.PoleNet,
    framed: np.ndarray,
    where: list[tuple[int, ...]],
    kind: torch.dtype,
    tolerance: float,
) -> None:
    ready = for_inference(net, bfloat16=kind == torch.bfloat16)
    with torch.inference_mode():
        levels = ready.levels(to_input(framed).to(kind))
        whole = ready.finest(levels)
        parts = pole_tiles.finest_at(ready, levels, torch.tensor(where))
    for part, every in zip(parts, whole, strict=True):
        assert every.std() > 0.01
        wanted = torch.stack([tiles_of(every)[index] for index in where])
        torch.testing.assert_close(part, wanted, atol=tolerance, rtol=tolerance)


def test_no_tile(net: polenet.PoleNet, framed: np.ndarray) -> None:
    mask, centre, offsets = maps(for_inference(net), framed[0], NOTHING)
    assert (mask.shape, centre.shape, offsets.shape) == ((128, 192), (16, 24), (2, 32, 48))
    assert centre.all() and not mask.any() and not offsets.any()


def test_parts_go_back_to_their_places() -> None:
    where = torch.tensor([(0, 0, 1), (1, 2, 0)])
    parts = torch.arange(2 * 3 * 4 * 4).view(2, 3, 4, 4) + 1.0
    whole = pole_tiles.spread(parts, where, (2, 3, 2))
    assert whole.shape == (2, 3, 12, 8)
    assert torch.equal(whole[0, :, :4, 4:], parts[0])
    assert torch.equal(whole[1, :, 8:, :4], parts[1])
    assert whole.count_nonzero() == parts.numel()


@pytest.mark.parametrize(
    ("cell", "passing"),
    [((1, 1), {(0, 0)}), ((3, 5), {(0, 1), (1, 1)}), ((4, 8), {(0, 1), (0, 2), (1, 1), (1, 2)})],
)
def test_a_cell_passes_its_tile_and_those_that_it_touches(
    cell: tuple[int, int], passing: set[tuple[int, int]]
) -> None:
    eighth = torch.zeros(1, 32, 8, 12)
    eighth[0, 7, cell[0], cell[1]] = 2.0
    gate = (*np.eye(32)[7].tolist(), -1.5)
    found = pole_tiles.passing_tiles(polenet.Levels(eighth, eighth, eighth), gate)
    assert {(row, column) for _, row, column in np.argwhere(found).tolist()} == passing


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> list[IdsImage]:
    return ids_images(write_painted_scenes(tmp_path_factory.mktemp("scenes"), (512, 384), 6))


def test_the_gate_that_ships_leaves_all_poles(scenes: list[IdsImage]) -> None:
    net, info = polenet.load(polenet.weights_path("polenet"))
    assert info.tile_gate is not None
    pictures = np.stack([frame(image.read().image)[0] for image in scenes])
    ready = for_inference(net)
    whole, gated = batch_maps(ready, pictures), batch_maps(ready, pictures, info.tile_gate)
    assert np.mean([mask != 0 for mask, _, _ in gated]) < 0.5
    for (mask, centre, offsets), (some_mask, same_centre, some_offsets) in zip(whole, gated, strict=True):
        on_pole = mask >= MASK_THRESHOLD
        assert on_pole.any() and some_mask[on_pole] == pytest.approx(mask[on_pole], abs=1e-5)
        assert np.array_equal(centre, same_centre)
        cells = on_pole.reshape(offsets.shape[1], 4, offsets.shape[2], 4).any((1, 3))
        assert some_offsets[:, cells] == pytest.approx(offsets[:, cells], abs=1e-4)


def test_a_gate_is_fitted_to_what_the_network_finds(scenes: list[IdsImage]) -> None:
    ready = for_inference(polenet.load(polenet.weights_path("polenet"))[0])
    gate, passing = fit_tile_gate(ready, scenes)
    assert gate is not None and 0.001 < passing < 0.2
    pictures = np.stack([frame(image.read().image)[0] for image in scenes])
    for (mask, _, _), (some, _, _) in zip(
        batch_maps(ready, pictures), batch_maps(ready, pictures, gate), strict=True
    ):
        assert np.mean(some[mask >= MASK_THRESHOLD] > 0) > LEAST_PASSING


def test_there_is_no_gate_without_poles_to_fit_it_to(net: polenet.PoleNet, scenes: list[IdsImage]) -> None:
    assert fit_tile_gate(for_inference(net), scenes) == (None, 1.0)  # the mask of random weights
    assert fit_tile_gate(for_inference(net), []) == (None, 1.0)


def test_a_gate_is_fitted_to_some_of_many_pictures() -> None:
    many, few = [IdsImage(Path(str(i)), Path("x")) for i in range(400)], [IdsImage(Path("a"), Path("b"))]
    taken = gate_pictures(many, few, [])
    assert taken == [*many[::3], *few]
