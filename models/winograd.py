"""Residual blocks of 3×3 convolutions by minimal filtering, with a quarter of the multiplications.

Winograd's F(4×4, 3×3) as in Lavin and Gray, "Fast Algorithms for Convolutional Neural Networks" (CVPR 2016): each tile
of 6×6 pixels is brought to a form in which a convolution is a product of 36 matrices, one for each place in the tile,
and 4×4 pixels come out. In single precision the result is the convolution's to some 1e-5. On a CPU without AVX-512 the
blocks of PoleNet, most of its cost, take half the time that oneDNN's direct convolutions do.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from scpf.models.compiled import Array32, f4, inlined, kernel

STEP: Final = 4  # px from tile to tile, of which two overlap
SIDE: Final = 6
TILES_AT_ONCE: Final = 64  # about; of so many the forms and products stay in a core's cache

_FILTER: Final = np.array(
    [
        [1 / 4, 0, 0],
        [-1 / 6, -1 / 6, -1 / 6],
        [-1 / 6, 1 / 6, -1 / 6],
        [1 / 24, 1 / 12, 1 / 6],
        [1 / 24, -1 / 12, 1 / 6],
        [0, 0, 1],
    ]
)  # G of F(4, 3), the other two matrices of which are `_of_input` and `_of_products`
_NOTHING: Final = np.empty((0, 0, 0), np.float32)


def filters(weight: NDArray[Any]) -> Array32:
    """The 36 matrices (36, inputs, outputs) of a convolution's ``weight`` (outputs, inputs, 3, 3)."""
    transformed = np.einsum("ap,bq,oipq->abio", _FILTER, _FILTER, weight.astype(np.float64))
    return np.ascontiguousarray(transformed.reshape(SIDE * SIDE, weight.shape[1], -1), np.float32)


@inlined
def _of_input(d0: Any, d1: Any, d2: Any, d3: Any, d4: Any, d5: Any) -> Any:
    """Six pixels in a line as the products want them: Bᵀ d."""
    even, odd = d4 - f4(4.0) * d2, d3 - f4(4.0) * d1
    outer, inner = d4 - d2, f4(2.0) * (d3 - d1)
    first, last = f4(4.0) * (d0 - d2) + outer, f4(4.0) * (d1 - d3) + d5 - d3
    return first, even + odd, even - odd, outer + inner, outer - inner, last


@inlined
def _of_products(m0: Any, m1: Any, m2: Any, m3: Any, m4: Any, m5: Any) -> Any:
    """Four pixels in a line out of six products: Aᵀ m."""
    near, across = m1 + m2, m1 - m2
    far, beyond = m3 + m4, m3 - m4
    return m0 + near + far, across + f4(2.0) * beyond, near + f4(4.0) * far, across + f4(8.0) * beyond + m5


@inlined
def _at(level: Any, y: Any, x: Any, outside: Any) -> Any:
    """The channels at a pixel; ``outside`` the picture those given."""
    inside = y >= 0 and y < level.shape[0] and x >= 0 and x < level.shape[1]
    return level[y, x] if inside else outside


@kernel
def to_tiles(level: Array32, first: int, end: int, tiles: Array32) -> None:
    """The tiles (36, rows·columns, C) of the rows from ``first`` to before ``end`` of a ``level`` (H, W, C).

    The first pixel of a row of tiles is 4·row - 1, and around the level all is 0.
    """
    _, width, channels = level.shape
    half = np.empty((SIDE, SIDE, channels), np.float32)
    outside = np.zeros(channels, np.float32)
    tile = 0
    for row in range(first, end):
        top = row * STEP - 1
        for left in range(-1, width - 1, STEP):
            for j in range(SIDE):
                d0, d1 = _at(level, top, left + j, outside), _at(level, top + 1, left + j, outside)
                d2, d3 = _at(level, top + 2, left + j, outside), _at(level, top + 3, left + j, outside)
                d4, d5 = _at(level, top + 4, left + j, outside), _at(level, top + 5, left + j, outside)
                for c in range(channels):
                    v0, v1, v2, v3, v4, v5 = _of_input(d0[c], d1[c], d2[c], d3[c], d4[c], d5[c])
                    half[0, j, c], half[1, j, c], half[2, j, c] = v0, v1, v2
                    half[3, j, c], half[4, j, c], half[5, j, c] = v3, v4, v5
            for i in range(SIDE):
                o0, o1, o2 = tiles[6 * i, tile], tiles[6 * i + 1, tile], tiles[6 * i + 2, tile]
                o3, o4, o5 = tiles[6 * i + 3, tile], tiles[6 * i + 4, tile], tiles[6 * i + 5, tile]
                for c in range(channels):
                    v0, v1, v2, v3, v4, v5 = _of_input(
                        half[i, 0, c], half[i, 1, c], half[i, 2, c],
                        half[i, 3, c], half[i, 4, c], half[i, 5, c],
                    )  # fmt: skip
                    o0[c], o1[c], o2[c], o3[c], o4[c], o5[c] = v0, v1, v2, v3, v4, v5
            tile += 1


@kernel
def from_tiles(
    products: Array32, first: int, end: int, bias: Array32, added: Array32, level: Array32
) -> None:
    """Those rows of ``level`` (H, W, C) of their ``products`` (36, rows·columns, C).

    With ``bias`` (C), ``added`` (H, W, C) unless that is empty, and nothing below 0.
    """
    height, width, channels = level.shape
    adds = added.size > 0
    half = np.empty((STEP, SIDE, channels), np.float32)
    whole = np.empty((STEP, channels), np.float32)
    nothing = np.zeros(channels, np.float32)
    tile = 0
    for row in range(first, end):
        top = row * STEP
        for left in range(0, width, STEP):
            for j in range(SIDE):
                m0, m1, m2 = products[j, tile], products[6 + j, tile], products[12 + j, tile]
                m3, m4, m5 = products[18 + j, tile], products[24 + j, tile], products[30 + j, tile]
                for c in range(channels):
                    v0, v1, v2, v3 = _of_products(m0[c], m1[c], m2[c], m3[c], m4[c], m5[c])
                    half[0, j, c], half[1, j, c], half[2, j, c], half[3, j, c] = v0, v1, v2, v3
            for i in range(min(STEP, height - top)):
                for c in range(channels):
                    v0, v1, v2, v3 = _of_products(
                        half[i, 0, c], half[i, 1, c], half[i, 2, c],
                        half[i, 3, c], half[i, 4, c], half[i, 5, c],
                    )  # fmt: skip
                    whole[0, c], whole[1, c] = v0 + bias[c], v1 + bias[c]
                    whole[2, c], whole[3, c] = v2 + bias[c], v3 + bias[c]
                for j in range(min(STEP, width - left)):
                    out = level[top + i, left + j]
                    more = added[top + i, left + j] if adds else nothing
                    for c in range(channels):
                        out[c] = max(whole[j, c] + more[c], f4(0.0))
            tile += 1


class WinogradResidual(nn.Module):
    """relu(second(relu(first(x))) + x) of two 3×3 convolutions with padding, on a CPU in single precision.

    Input and output (B, C, H, W) are laid out as channels_last. For inference alone.
    """

    def __init__(self, first: nn.Conv2d, second: nn.Conv2d) -> None:
        super().__init__()
        self._filters = [torch.from_numpy(filters(each.weight.detach().numpy())) for each in (first, second)]
        self._biases = [np.ascontiguousarray(_bias(each), np.float32) for each in (first, second)]
        self(torch.zeros(1, first.in_channels, 1, 1))  # compiles the kernels now, not at the first picture

    def forward(self, x: Tensor) -> Tensor:
        levels = x.detach().permute(0, 2, 3, 1).contiguous().numpy()
        result = np.empty_like(levels)
        for level, out in zip(levels, result, strict=True):
            hidden = np.empty_like(level)
            self._convolve(level, 0, _NOTHING, hidden)
            self._convolve(hidden, 1, level, out)
        return torch.from_numpy(result).permute(0, 3, 1, 2)

    def _convolve(self, level: Array32, layer: int, added: Array32, out: Array32) -> None:
        """``out`` (H, W, C) of ``level``, some rows of tiles after the other."""
        height, width, channels = level.shape
        rows, columns = -(-height // STEP), -(-width // STEP)
        at_once = max(1, min(rows, round(TILES_AT_ONCE / columns)))
        tiles, products = torch.empty(2, SIDE * SIDE, at_once * columns, channels)
        for first in range(0, rows, at_once):
            end = min(first + at_once, rows)
            # Too few rows at the end leave in ``tiles`` what was there: of it nothing comes into ``out``.
            to_tiles(level, first, end, tiles.numpy())
            torch.bmm(tiles, self._filters[layer], out=products)
            from_tiles(products.numpy(), first, end, self._biases[layer], added, out)


def _bias(convolution: nn.Conv2d) -> NDArray[Any]:
    assert convolution.bias is not None
    return convolution.bias.detach().numpy()
