"""Whose Mask R-CNN the tensors of a weights file are, told by their names, and the same under this project's names.

This project's names are Detectron2's. What can be read from names and shapes is: the convention, the number of
classes, and how deep the ResNet is. Colour order and the place of the stride cannot, except where the mean of the
pixels lies beside the weights: `CheckpointSettings` has them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

from torch import Tensor

from scpf.models.errors import InputError
from scpf.models.maskrcnn_conventions import DETECTRON2, TORCHVISION, Convention

MOST_CLASSES: Final = 10_000
MOST_BLOCKS: Final = 100
DEPTH: Final = re.compile(r"backbone\.bottom_up\.res([2-5])\.(\d{1,3})\.conv1\.weight")
CLASS_SCORES: Final = "roi_heads.box_predictor.cls_score"
CLASS_BOXES: Final = "roi_heads.box_predictor.bbox_pred"
CLASS_MASKS: Final = "roi_heads.mask_head.predictor"

_TORCHVISION_NAMES: Final = tuple(
    (re.compile(pattern), replacement)
    for pattern, replacement in (
        (r"backbone\.body\.conv1\.", "backbone.bottom_up.stem.conv1."),
        (r"backbone\.body\.bn1\.", "backbone.bottom_up.stem.conv1.norm."),
        (r"backbone\.body\.layer(\d)\.(\d+)\.conv(\d)\.", r"backbone.bottom_up.res{+1}.\2.conv\3."),
        (r"backbone\.body\.layer(\d)\.(\d+)\.bn(\d)\.", r"backbone.bottom_up.res{+1}.\2.conv\3.norm."),
        (r"backbone\.body\.layer(\d)\.(\d+)\.downsample\.0\.", r"backbone.bottom_up.res{+1}.\2.shortcut."),
        (
            r"backbone\.body\.layer(\d)\.(\d+)\.downsample\.1\.",
            r"backbone.bottom_up.res{+1}.\2.shortcut.norm.",
        ),
        (r"backbone\.fpn\.inner_blocks\.(\d)\.(?:0\.)?(?=weight|bias)", r"backbone.fpn_lateral{+2}."),
        (r"backbone\.fpn\.layer_blocks\.(\d)\.(?:0\.)?(?=weight|bias)", r"backbone.fpn_output{+2}."),
        (r"rpn\.head\.conv\.(?:0\.0\.)?(?=weight|bias)", "proposal_generator.rpn_head.conv."),
        (r"rpn\.head\.cls_logits\.", "proposal_generator.rpn_head.objectness_logits."),
        (r"rpn\.head\.bbox_pred\.", "proposal_generator.rpn_head.anchor_deltas."),
        (r"roi_heads\.box_head\.fc6\.", "roi_heads.box_head.fc1."),
        (r"roi_heads\.box_head\.fc7\.", "roi_heads.box_head.fc2."),
        (r"roi_heads\.box_predictor\.", "roi_heads.box_predictor."),
        (r"roi_heads\.mask_head\.mask_fcn(\d)\.", r"roi_heads.mask_head.mask_fcn\1."),
        (r"roi_heads\.mask_head\.(\d)\.0\.(?=weight|bias)", r"roi_heads.mask_head.mask_fcn{+1}."),
        (r"roi_heads\.mask_predictor\.conv5_mask\.", "roi_heads.mask_head.deconv."),
        (r"roi_heads\.mask_predictor\.mask_fcn_logits\.", "roi_heads.mask_head.predictor."),
    )
)  # {+N}: the first number of the name, plus N


@dataclass(frozen=True)
class Recognised:
    """A file's tensors under this project's names, the background last, and what was read from them.

    ``classes``: their number without the background. ``blocks``: bottlenecks of the four stages. ``trained_norms``:
    the file counts batches, so that its batch norms were trained. ``pixels_known``: colour and mean stood in it.
    """

    convention: Convention
    tensors: dict[str, Tensor]
    classes: int
    blocks: tuple[int, ...]
    trained_norms: bool
    pixels_known: bool = False


def recognise(tensors: Mapping[str, Tensor], file: str) -> Recognised:
    """Reads names and shapes; raises InputError, naming ``file``, where they are not Mask R-CNN's."""
    named = _without_prefix(tensors)
    trained_norms = any(name.endswith("num_batches_tracked") for name in named)
    named = {name: value for name, value in named.items() if not name.endswith("num_batches_tracked")}
    if any(name.startswith("backbone.bottom_up.") for name in named):
        convention, pixels_known = _with_pixels(DETECTRON2, named, file)
        named = {name: value for name, value in named.items() if not _is_constant(name)}
        background_first = False
    elif any(name.startswith("backbone.body.") for name in named):
        convention, pixels_known = TORCHVISION, False
        named = {_renamed(name, file): value for name, value in named.items()}
        background_first = True
    else:
        raise InputError(f"{file}: {_what_else(named)}", _HINT)
    if CLASS_MASKS + ".weight" not in named:
        raise InputError(f"{file}: has no mask head (a Faster R-CNN?)", _HINT)
    scores = named.get(CLASS_SCORES + ".weight")
    classes = 0 if scores is None or scores.ndim != 2 else len(scores) - 1
    if not 1 <= classes <= MOST_CLASSES:
        raise InputError(f"{file}: predicts {classes} classes", f"1 to {MOST_CLASSES} and the background")
    if background_first:
        named = _background_last(named)
    return Recognised(convention, named, classes, _blocks(named, file), trained_norms, pixels_known)


_HINT: Final = (
    "a Mask R-CNN with ResNet and FPN, of torchvision (maskrcnn_resnet50_fpn) or Detectron2 (R_50_FPN)"
)


def _without_prefix(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Without the prefix that wrappers for several GPUs or for training put before every name."""
    named = dict(tensors)
    for prefix in ("module.", "model."):
        if named and all(name.startswith(prefix) for name in named):
            named = {name[len(prefix) :]: value for name, value in named.items()}
    return named


def _is_constant(name: str) -> bool:
    """Whether the tensor is no weight: what older Detectron2 files say of pixels and anchors."""
    return name in ("pixel_mean", "pixel_std") or ".anchor_generator." in name


def _with_pixels(convention: Convention, named: Mapping[str, Tensor], file: str) -> tuple[Convention, bool]:
    """The convention with the mean and deviation that the file gives, which tell the order of the colours."""
    mean, deviation = named.get("pixel_mean"), named.get("pixel_std")
    if mean is None or deviation is None:
        return convention, False
    if mean.numel() != 3 or deviation.numel() != 3 or not bool((deviation > 0).all()):
        raise InputError(f"{file}: pixel_mean and pixel_std are not those of three colours")
    first, second, third = (float(value) for value in mean.flatten())
    d_first, d_second, d_third = (float(value) for value in deviation.flatten())
    return replace(
        convention,
        colour="bgr" if first <= third else "rgb",  # pictures of the world are reddish on average
        pixel_mean=(first, second, third),
        pixel_deviation=(d_first, d_second, d_third),
    ), True


def _renamed(name: str, file: str) -> str:
    for pattern, replacement in _TORCHVISION_NAMES:
        match = pattern.match(name)
        if match:
            for add in (1, 2):
                if f"{{+{add}}}" in replacement:
                    replacement = replacement.replace(f"{{+{add}}}", str(int(match[1]) + add))
            return match.expand(replacement) + name[match.end() :]
    version = (
        " (maskrcnn_resnet50_fpn_v2 is another network)" if "fpn." in name or "mask_head" in name else ""
    )
    raise InputError(f"{file}: {name} is no tensor of torchvision's maskrcnn_resnet50_fpn{version}", _HINT)


def _background_last(named: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """torchvision counts the background as class 0, and gives it a box and a mask, which nobody reads."""
    moved = dict(named)
    for kind in ("weight", "bias"):
        for name, background in ((CLASS_SCORES, 0), (CLASS_BOXES, 4), (CLASS_MASKS, 1)):
            value = moved.get(f"{name}.{kind}")
            if value is not None and value.ndim:
                moved[f"{name}.{kind}"] = value[background:] if background else value.roll(-1, 0)
    return moved


def _blocks(named: Mapping[str, Tensor], file: str) -> tuple[int, ...]:
    """How many bottlenecks each stage has."""
    counts = [0, 0, 0, 0]
    for name in named:
        match = DEPTH.fullmatch(name)
        if match:
            stage = int(match[1]) - 2
            counts[stage] = max(counts[stage], int(match[2]) + 1)
    if not 1 <= min(counts) <= max(counts) <= MOST_BLOCKS:
        raise InputError(f"{file}: stages of {counts} blocks are not a ResNet's", _HINT)
    return tuple(counts)


def _what_else(named: Mapping[str, Tensor]) -> str:
    """What a file that is no Mask R-CNN with a pyramid most likely is."""
    names = set(named)
    if {"stem.conv1.weight", "conv1.weight", "conv1_w"} & names:
        return "holds a ResNet alone, the backbone that a training starts from"
    if any(name.startswith("backbone.res") for name in names):
        return "a Detectron2 model without a feature pyramid"
    if any(name.endswith("_w") for name in names):
        return "weights of Detectron 1 or Caffe2"
    return f"not a Mask R-CNN: its tensors are called {', '.join(sorted(names)[:2])[:120]} ..."
