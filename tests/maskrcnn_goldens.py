"""What the originals gave (golden/maskrcnn.npz), and their state dictionaries, filled by the rule."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import maskrcnn_rule as rule
import numpy as np
import torch

Golden = dict[str, Any]


def golden_of(name: str) -> Golden:
    """The arrays of ``torchvision`` or ``detectron2``, as golden/make_maskrcnn_goldens.py describes them."""
    with np.load(Path(__file__).with_name("golden") / "maskrcnn.npz") as file:
        return {key.removeprefix(f"{name}."): file[key] for key in file.files if key.startswith(name)}


def shapes_of(name: str) -> dict[str, list[int]]:
    """Names and shapes of the original's state dictionary."""
    shapes: dict[str, list[int]] = json.loads(golden_of(name)["tensors"].tobytes())
    return shapes


def tensors_of(name: str) -> dict[str, torch.Tensor]:
    """The original's state dictionary with the weights of the rule."""
    return {
        key: torch.tensor(0)
        if key.endswith("num_batches_tracked")
        else torch.from_numpy(rule.weights(key, shape))
        for key, shape in shapes_of(name).items()
    }
