"""Weights and a picture that follow from a rule, so that a Mask R-CNN to compare with needs no weights file.

The script that asked the originals (golden/make_maskrcnn_goldens.py) and the tests make the same numbers: every value
comes from the raw words of a PCG64, whose stream numpy keeps for good, seeded by the CRC-32 of the tensor's name.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float32]
HEIGHT_PX, WIDTH_PX = 121, 203  # whose scale is not a whole number, and limited by the long side
SHORT_SIDE_PX, LONG_SIDE_PX = 192, 320
CLASSES = {"torchvision": 3, "detectron2": 5}  # without the background


def uniform(seed: str, count: int) -> FloatArray:
    """``count`` values between -1 and 1, of 16 bits each."""
    words = np.random.PCG64(zlib.crc32(seed.encode())).random_raw(-(-count // 4))
    sixteen_bits = np.asarray(words, "<u8").view("<u2")[:count].astype(np.float32)
    values: FloatArray = sixteen_bits / np.float32(32768) - np.float32(1)
    return values


def weights(name: str, shape: Sequence[int]) -> FloatArray:
    """The tensor of a name of a Mask R-CNN of either kind, scaled so that signals neither die nor explode."""
    values = uniform(name, math.prod(shape)).reshape(shape)
    kind = name.rsplit(".", 1)[1]
    if ".norm." in name or ".bn" in name or ".downsample.1." in name:
        ends_block = ".conv3." in name or ".bn3." in name
        middle, spread = {
            "weight": (0.3, 0.1) if ends_block else (1.0, 0.3),
            "bias": (0.0, 0.2),
            "running_mean": (0.0, 0.2),
            "running_var": (1.0, 0.5),
        }[kind]
        return middle + spread * values
    if kind == "bias":
        return np.float32(0.05) * values
    fan_in = math.prod(shape[1:])
    gain = next((gain for part, gain in GAINS.items() if part in name), 1.0)
    if (
        shape[0] <= MOST_OUTPUTS
    ):  # half against half: what all inputs share cancels, and places differ the more
        values[:, shape[1] // 2 :] = -values[:, : shape[1] // 2]
    return np.float32(gain * math.sqrt(6 / fan_in)) * values


MOST_OUTPUTS = 16  # of the layers that end in a prediction
GAINS = {  # of some layers, by a part of their names in either convention
    "stem.conv1": 1 / 58,  # Detectron2's pixels are not divided by their deviation
    "fpn_lateral": 0.2,
    "fpn.inner_blocks": 0.2,
    "fpn_output": 0.6,
    "fpn.layer_blocks": 0.6,
    "objectness_logits": 1.5,
    "rpn.head.cls_logits": 1.5,
    "anchor_deltas": 0.3,
    "rpn.head.bbox_pred": 0.3,
    "cls_score": 1.2,
    "box_predictor.bbox_pred": 1.0,
    "mask_head.predictor": 2.5,
    "mask_fcn_logits": 2.5,
}


def picture() -> NDArray[np.uint8]:
    """(HEIGHT_PX, WIDTH_PX, 3), uint8 RGB: patches of several sizes."""
    total = np.zeros((HEIGHT_PX, WIDTH_PX, 3), np.float32)
    for side, amplitude in ((40, 60), (12, 40), (3, 20)):
        rows, columns = -(-HEIGHT_PX // side), -(-WIDTH_PX // side)
        patches = uniform(f"picture {side}", rows * columns * 3).reshape(rows, columns, 3)
        large = patches.repeat(side, 0).repeat(side, 1)[:HEIGHT_PX, :WIDTH_PX]
        total += amplitude * large
    return np.clip(np.floor(total) + 128, 0, 255).astype(np.uint8)


def pictures() -> NDArray[np.uint8]:
    """Two of them (2, HEIGHT_PX, WIDTH_PX, 3), to train on: the picture and its mirror image."""
    return np.stack([picture(), picture()[:, ::-1]])


def target_boxes() -> list[FloatArray]:
    """What is to be found in each of `pictures`: (n, 4) in px, one of them a pole, one alone in its class."""
    return [
        np.array([[20, 5, 34, 115], [90, 30, 150, 80], [160, 2, 166, 60]], np.float32),
        np.array([[40, 40, 110, 100]], np.float32),
    ]


TARGET_CLASSES = ((0, 1, 0), (1,))  # from 0, the background not counted


def target_masks() -> list[NDArray[np.bool_]]:
    """Masks (n, HEIGHT_PX, WIDTH_PX) in those boxes: the middle half of the columns, and the upper quarter."""
    masks = []
    for boxes in target_boxes():
        mask = np.zeros((len(boxes), HEIGHT_PX, WIDTH_PX), bool)
        for each, box in zip(mask, boxes.astype(int).tolist(), strict=True):
            x1, y1, x2, y2 = box
            each[y1:y2, x1 + (x2 - x1) // 4 : x2 - (x2 - x1) // 4] = True
            each[y1 : y1 + (y2 - y1) // 4, x1:x2] = True
        masks.append(mask)
    return masks
