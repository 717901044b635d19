"""PoleNet's finest levels, computed only where a picture may show a pole.

A third of the network's time goes into its levels of 1/4 and 1/2, though nine in ten of their cells show no pole. A
gate on the level of 1/8 says which may, and the levels are computed in tiles there, the same as in the whole picture:
from coarse to fine, as in PointRend (Kirillov et al., CVPR 2020), in tiles where that has points. Everywhere else the
mask's probability is 0. The gate is fitted to what the network itself finds (`pole_tiles_fit`).
"""

from __future__ import annotations

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor, nn

from scpf.models.polenet import Levels, PoleNet

TILE_CELLS = 4  # of the level of 1/8: 32 px
MOST_TILES = 0.5  # share of all tiles, above which the whole picture is faster
ROUNDED_TO = 16  # tiles: for each number of them oneDNN makes its convolutions anew

_NEIGHBOURS = np.ones((3, 3), np.uint8)

TileGate = tuple[float, ...]
"""A weight for each channel of the level of 1/8, and a constant: a cell passes where they sum up to 0 or more."""


def passing_tiles(levels: Levels, gate: TileGate) -> NDArray[np.bool_]:
    """The tiles (B, H/32, W/32) that may show a pole: those with a passing cell, or with one just beside them."""
    weights = torch.tensor(gate)
    sums = F.conv2d(levels.eighth.float(), weights[None, :-1, None, None], weights[-1:])
    passing = (sums[:, 0] >= 0).numpy().astype(np.uint8)
    nearby = np.stack([cv2.dilate(each, _NEIGHBOURS) for each in passing])
    images, rows, columns = nearby.shape
    parts = nearby.reshape(images, rows // TILE_CELLS, TILE_CELLS, columns // TILE_CELLS, TILE_CELLS)
    found: NDArray[np.bool_] = parts.max((2, 4)) > 0
    return found


def spread(parts: Tensor, where: Tensor, tiles: tuple[int, ...]) -> Tensor:
    """The maps (B, C, H, W) of their parts (N, C, s, s) at ``where`` (N, 3) of ``tiles`` (B, H/s, W/s); 0 elsewhere."""
    _, channels, side, _ = parts.shape
    images, rows, columns = tiles
    batch, row, column = where.unbind(1)
    whole = parts.new_zeros(images, channels, rows, side, columns, side)
    whole[batch, :, row, :, column] = parts
    return whole.flatten(4).flatten(2, 3)


class _Windows:
    """Square parts of a level: tiles of ``tile`` cells and ``beside`` more on each side."""

    def __init__(self, where: Tensor, tile: int, beside: int) -> None:
        self._batch, row, column = where.unbind(1)
        steps = torch.arange(-beside, tile + beside, device=row.device)
        self._y, self._x = row[:, None] * tile + steps, column[:, None] * tile + steps  # (N, s)

    def of(self, level: Tensor) -> Tensor:
        """The parts (N, C, s, s) of a level (B, C, h, w); outside it, its edge goes on."""
        height, width = level.shape[2:]
        y, x = self._y.clamp(0, height - 1), self._x.clamp(0, width - 1)
        index = (self._batch[:, None, None] * height + y[:, :, None]) * width + x[:, None, :]
        cells = level.permute(0, 2, 3, 1).flatten(0, 2).index_select(0, index.flatten())
        return cells.view(*index.shape, -1).permute(0, 3, 1, 2)  # which is channels_last

    def inside(self, level: Tensor) -> Tensor:
        """1 in the picture and 0 outside, (N, 1, s, s)."""
        height, width = level.shape[2:]
        rows, columns = (self._y >= 0) & (self._y < height), (self._x >= 0) & (self._x < width)
        return (rows[:, None, :, None] & columns[:, None, None, :]).to(level.dtype)


def finest_at(net: PoleNet, levels: Levels, where: Tensor) -> tuple[Tensor, Tensor]:
    """`PoleNet.finest` of the tiles at ``where`` (N, 3), batch, row and column each.

    The mask's logits are (N, 4, 16, 16), four pixels each, the offsets (N, 2, 8, 8). ``net`` has its batch norm folded.
    """
    count = len(where)
    if not count:
        none = levels.half.new_zeros
        return none(0, 4, 16, 16), none(0, 2, 8, 8)
    where = torch.cat([where, where[-1:].expand(-count % ROUNDED_TO, 3)])
    _, row, column = where.unbind(1)
    height, width = (cells // TILE_CELLS for cells in levels.eighth.shape[2:])
    # A tile is 8 cells of 1/4 wide. Two convolutions need two beside it, one of which the first leaves.
    quarter, half = _Windows(where, 8, 2), _Windows(where, 16, 1)
    above = F.interpolate(_Windows(where, 4, 1).of(levels.eighth), scale_factor=2.0)
    inside = quarter.inside(levels.quarter)
    x = net.lateral[0](quarter.of(levels.quarter)).add_(above).mul_(inside)
    pyramid = _without_padding(net.smooth[0], x)
    offsets = F.conv2d(pyramid * inside[:, :, 1:-1, 1:-1], net.offsets.weight, net.offsets.bias)
    # The whole level is enlarged as if its edge went on.
    pyramid[row == 0, :, 0] = pyramid[row == 0, :, 1]
    pyramid[row == height - 1, :, -1] = pyramid[row == height - 1, :, -2]
    pyramid[column == 0, :, :, 0] = pyramid[column == 0, :, :, 1]
    pyramid[column == width - 1, :, :, -1] = pyramid[column == width - 1, :, :, -2]
    up = F.interpolate(net.fine_up(pyramid), scale_factor=2.0, mode="bilinear", align_corners=False)
    fine = F.relu(net.fine_low(half.of(levels.half)).add_(up[:, :, 1:-1, 1:-1]), inplace=True)
    mask = net.mask(_without_padding(net.fine, fine.mul_(half.inside(levels.half))))
    return mask[:count], offsets[:count]


def _without_padding(block: nn.Module, x: Tensor) -> Tensor:
    """A block of a convolution and what follows it, of what has all neighbours in ``x`` (N, C, h, w) alone."""
    assert isinstance(block, nn.Sequential) and isinstance(block[0], nn.Conv2d)
    return block[1:](F.conv2d(x, block[0].weight, block[0].bias))  # type: ignore[no-any-return]
