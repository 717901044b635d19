"""The gate of `pole_tiles`, fitted to what the network itself finds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray

from scpf.models.instances import Image
from scpf.models.labelled_images import LabelledImage
from scpf.models.logistic import logistic
from scpf.models.pole_tiles import TileGate
from scpf.models.polenet import PoleNet
from scpf.models.polenet_inference import to_input
from scpf.models.segmentation import MASK_THRESHOLD, frame

MAY_SHOW = 0.3  # a pixel with this mask probability makes a cell of 8 px one that shall pass
OTHERS_EVERY = 16  # of the other cells, which are a hundred times as many, so many are enough
LEAST_PASSING = 0.995  # of the cells with a pixel of `MASK_THRESHOLD` or more; the rest may pass beside them
LEAST_CELLS = 500  # such cells, without which there is no tile gate
MOST_PICTURES = 150


class TileGateFit(NamedTuple):
    """A gate, None where the pictures show too little for one, and which share of their cells it lets pass."""

    gate: TileGate | None
    passing: float


def fit_tile_gate(net: PoleNet, images: Iterable[LabelledImage]) -> TileGateFit:
    """Logistic regression of "the mask is `MAY_SHOW` here" on the level of 1/8, its constant so that enough pass.

    ``net`` is ready for inference. The labels of the images are not looked at.
    """
    seen = [_cells(net, image.read().image) for image in images]
    if not seen:
        return TileGateFit(None, 1.0)
    features, mask = zip(*seen, strict=True)
    return _fitted(np.concatenate(features), np.concatenate(mask))


def _fitted(features: NDArray[np.float64], mask: NDArray[np.float32]) -> TileGateFit:
    on_pole, may_show = mask >= MASK_THRESHOLD, mask >= MAY_SHOW
    if np.count_nonzero(on_pole) < LEAST_CELLS:
        return TileGateFit(None, 1.0)
    evidence = np.append(features, np.ones((len(features), 1)), axis=1)
    weights = logistic(evidence, may_show.astype(np.float64))
    weights[-1] -= np.quantile(evidence[on_pole] @ weights, 1 - LEAST_PASSING)
    passing = evidence @ weights >= 0
    stands_for = np.where(may_show, 1, OTHERS_EVERY)
    return TileGateFit(tuple(weights.tolist()), float(np.average(passing, weights=stands_for)))


def gate_pictures(*sets: Sequence[LabelledImage]) -> list[LabelledImage]:
    """At most `MOST_PICTURES` of each of several sets, evenly drawn."""
    return [image for images in sets for image in images[:: max(1, math.ceil(len(images) / MOST_PICTURES))]]


class _Cells(NamedTuple):
    """Of a picture all cells that may show a pole, and some of the others."""

    features: NDArray[np.float64]  # (N, channels)
    mask: NDArray[np.float32]  # (N,) the highest probability in each


def _cells(net: PoleNet, image: Image) -> _Cells:
    with torch.inference_mode():
        levels = net.levels(to_input(frame(image)[0][None], next(net.parameters()).device))
        logits = net.finest(levels)[0].amax(1, keepdim=True)
        highest = F.max_pool2d(logits, logits.shape[2] // levels.eighth.shape[2])
        mask = highest.sigmoid().flatten().cpu().numpy()
        features = levels.eighth[0].flatten(1).T.cpu().numpy()
    taken = mask >= MAY_SHOW
    taken[::OTHERS_EVERY] = True
    return _Cells(features[taken].astype(np.float64), mask[taken])
