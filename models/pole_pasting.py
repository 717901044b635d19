"""Poles cut out of labelled pictures and pasted into others, so that a pole is learnt apart from what stands round it.

Copy-paste augmentation (Ghiasi et al., CVPR 2021): a network that saw poles in simulated streets alone takes the
street for part of the pole, and overlooks one before a scaffold. Signs come beside them, drawn and not labelled: else
each post that does not fit its background would be a pole.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from scpf.models.instances import BoolMask, Image, Instance
from scpf.models.labelled_images import MOST_IDS, Ids, Picture
from scpf.models.pasted_scaffold import Rectangle, draw_scaffold
from scpf.models.pasted_signs import draw_sign

LEAST_CUT_PX = (60, 3)  # height and mean width of a pole worth cutting out
WHOLE = 0.93  # share of the rows that show it: leaves before a pole would come along as gaps
BELOW_HORIZON = (0.03, 0.6)  # how far below it a pole stands, as a share of the picture's height
HEIGHT_RATIOS = (2.5, 6.5)  # of a pole to the camera's height, 1.4 to 2.4 m: signs have up to 2.4
LEAST_SHOWN = 0.12  # of the picture's height
LEAST_SCALE, MOST_SCALE = 0.2, 3.0  # a pole cut out is not shrunk or enlarged by more
MOST_PASTED = 3
WITH_SCAFFOLD, WITH_SIGNS = 0.45, 0.5
MOST_SIGNS = 2
LEAST_CONTRAST = 14.0  # of 255, mean over the pole: what cannot be seen cannot be learnt
EDGE_PX = 2  # around the mask, where it fades out

Floats = NDArray[np.floating[Any]]


class _Cutting(NamedTuple):
    """``colours`` (h, w, 3), 0 to 255, and ``alpha`` (h, w), 0 to 1."""

    colours: Floats
    alpha: Floats


def paste_poles(image: Image, ids: Ids, donor: Picture, horizon_px: float, rng: np.random.Generator) -> None:
    """Pastes one to three poles of ``donor`` into ``image`` (H, W, 3) and its ``ids`` (H, W), both in place.

    ``horizon_px``: its row, inside the image or not. The poles stand on level ground and are higher than signs are:
    a network that learns of poles of any size anywhere takes each post for one.
    """
    donors = [each.instance for each in donor.objects if not each.ignored and _worth_it(each.instance.mask)]
    if not donors:
        return
    before = draw_scaffold(image, ids, rng) if rng.random() < WITH_SCAFFOLD else None
    if rng.random() < WITH_SIGNS:
        for _ in range(rng.integers(1, MOST_SIGNS + 1)):
            foot = horizon_px + _below_px(image.shape[0], rng)
            draw_sign(image, ids, _across_px(image.shape[1], 0, before, rng), foot, horizon_px, rng)
    for _ in range(rng.integers(1, MOST_PASTED + 1)):
        free = np.flatnonzero(np.bincount(ids.ravel(), minlength=MOST_IDS)[1:MOST_IDS] == 0)
        if not len(free):
            return
        instance = donors[rng.integers(len(donors))]
        top, high = _stand(image.shape[0], horizon_px, rng)
        if instance.offset_px[1] == 0:  # without its top it would be any post
            high = max(high, top + high)
            top = min(top, 0.0) - 0.03 * high
        if LEAST_SCALE < high / instance.mask.shape[0] < MOST_SCALE:
            cutting = _resized(_cut(donor.image, instance), high, rng)
            _paste(image, ids, cutting, 1 + int(free[0]), round(top), before, rng)


def _worth_it(mask: BoolMask) -> bool:
    height = mask.shape[0]
    whole = mask.any(1).mean() > WHOLE
    return bool(whole) and height >= LEAST_CUT_PX[0] and float(mask.sum()) / height >= LEAST_CUT_PX[1]


def _stand(height_px: int, horizon_px: float, rng: np.random.Generator) -> tuple[float, float]:
    """The first row of a pole and its height, both in px."""
    top = high = 0.0
    for _ in range(20):
        below = _below_px(height_px, rng)
        high = below * float(np.exp(rng.uniform(*np.log(HEIGHT_RATIOS))))
        top = horizon_px + below - high
        if min(height_px, top + high) - max(0.0, top) > LEAST_SHOWN * height_px:
            break
    return top, high


def _below_px(height_px: int, rng: np.random.Generator) -> float:
    """How far below the horizon a foot is: near ones as often as far ones."""
    return float(np.exp(rng.uniform(*np.log(BELOW_HORIZON)))) * height_px


def _across_px(width_px: int, columns: int, before: Rectangle | None, rng: np.random.Generator) -> int:
    """The first column of what is ``columns`` wide: mostly before the scaffold, where there is one."""
    if before is not None and rng.random() < 0.75:
        return int(np.clip(rng.uniform(before[0], before[2]) - columns / 2, 0, max(0, width_px - columns)))
    return int(rng.integers(0, max(1, width_px - columns)))


def _cut(image: Image, instance: Instance) -> _Cutting:
    """The pole's pixels, `EDGE_PX` wider than its mask on each side."""
    mask, (x, y), e = instance.mask, instance.offset_px, EDGE_PX
    padded = np.pad(mask.astype(np.float32), e)
    part = image[y : y + mask.shape[0], x : x + mask.shape[1]]
    around = np.asarray(cv2.copyMakeBorder(part, e, e, e, e, cv2.BORDER_REPLICATE), np.float32)
    # The pole's own colours reach under its fading edge, so that nothing of the old background comes along.
    weight = np.asarray(cv2.blur(padded, (5, 3))) + 1e-6
    spread = np.asarray(cv2.blur(around * padded[..., None], (5, 3))) / weight[..., None]
    colours = np.where(padded[..., None] > 0, around, spread)
    return _Cutting(colours, np.asarray(cv2.GaussianBlur(padded, (0, 0), 0.6)))


def _resized(cutting: _Cutting, height_px: float, rng: np.random.Generator) -> _Cutting:
    """So high, a little stouter or slimmer, and flipped half of the time."""
    rows, columns = cutting.alpha.shape
    scale = height_px / rows
    size = (max(3, round(columns * scale * rng.uniform(0.85, 1.2))), max(8, round(height_px)))
    method = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    colours = np.asarray(cv2.resize(cutting.colours, size, interpolation=method), np.float32)
    alpha = np.asarray(cv2.resize(cutting.alpha, size, interpolation=method), np.float32)
    return _Cutting(colours[:, ::-1], alpha[:, ::-1]) if rng.random() < 0.5 else _Cutting(colours, alpha)


def _paste(
    image: Image,
    ids: Ids,
    cutting: _Cutting,
    number: int,
    top_px: int,
    before: Rectangle | None,
    rng: np.random.Generator,
) -> None:
    (height, width), (rows, columns) = ids.shape, cutting.alpha.shape
    x1 = _across_px(width, columns, before, rng)
    y1, x2, y2 = max(top_px, 0), min(x1 + columns, width), min(top_px + rows, height)
    if x2 - x1 < 3 or y2 - y1 < 8:
        return
    shown = np.s_[y1 - top_px : y2 - top_px, : x2 - x1]
    alpha, there = cutting.alpha[shown], image[y1:y2, x1:x2]
    pole = _toned(cutting.colours[shown], alpha, there, rng)
    contrast = (np.abs(pole.clip(0, 255) - there).mean(2) * alpha).sum() / max(float(alpha.sum()), 1e-3)
    if contrast < LEAST_CONTRAST:
        return
    there[:] = np.clip(there * (1 - alpha[..., None]) + pole * alpha[..., None], 0, 255).astype(np.uint8)
    ids[y1:y2, x1:x2][alpha >= 0.5] = number
    if rng.random() < 0.5:
        _hang(image, ids, (x1, y1, x2, y2), rng)
    if rng.random() < 0.2:
        _rails(image, ids, (x1, y1, x2, y2), rng)


def _toned(colours: Floats, alpha: Floats, there: Image, rng: np.random.Generator) -> Floats:
    """The pole's colours in another light; half of the time nearly as bright as what it stands before."""
    if rng.random() < 0.5:
        return np.asarray(colours * rng.uniform(0.6, 1.5) + rng.uniform(-20, 20))
    own = (colours * alpha[..., None]).sum((0, 1)) / max(float(alpha.sum()), 1e-3)
    wanted = there.reshape(-1, 3).mean(0) * rng.choice([rng.uniform(0.5, 0.88), rng.uniform(1.12, 1.5)])
    return np.asarray((colours - own) * rng.uniform(0.5, 1.2) + wanted)


def _hang(image: Image, ids: Ids, box: Rectangle, rng: np.random.Generator) -> None:
    """Boards on the lower two thirds of a pole, or something before its foot."""
    x1, y1, x2, y2 = box
    high = y2 - y1
    for _ in range(rng.integers(1, 3)):
        tall, wide = rng.uniform(0.04, 0.2) * high, rng.uniform(0.03, 0.18) * high
        if rng.random() < 0.3:  # before the foot
            tall, wide = rng.uniform(0.08, 0.35) * high, rng.uniform(0.15, 0.8) * high
            top: float = y2 - tall
        else:
            top = y1 + rng.uniform(0.3, 0.9) * high
        left = (x1 + x2) / 2 - wide * rng.uniform(0.1, 0.9)
        a, b = (int(left), int(top)), (int(left + wide), int(top + tall))
        colour = rng.uniform(15, 250) + rng.uniform(-25, 25, 3)
        cv2.rectangle(image, a, b, np.clip(colour, 0, 255).tolist(), -1)
        cv2.rectangle(ids, a, b, 0, -1)
        if rng.random() < 0.5:
            cv2.rectangle(image, a, b, np.clip(colour * rng.uniform(0.3, 1.6), 0, 255).tolist(), 1)


def _rails(image: Image, ids: Ids, box: Rectangle, rng: np.random.Generator) -> None:
    """Rails of a fence across the lower half of a pole."""
    x1, y1, x2, y2 = box
    reach, slope = rng.uniform(0.2, 1.0) * (y2 - y1), rng.normal(0, 0.08)
    colour = np.clip(rng.uniform(30, 240) + rng.uniform(-15, 15, 3), 0, 255).tolist()
    thick = int(rng.integers(1, 3))
    for y in y2 - (y2 - y1) * rng.uniform(0.0, 0.5, rng.integers(1, 5)):
        ends = (int(x1 - reach), int(y)), (int(x2 + reach), int(y + slope * (2 * reach + x2 - x1)))
        cv2.line(image, *ends, colour, thick, cv2.LINE_AA)
        if thick > 1:
            cv2.line(ids, *ends, 0, thick)
