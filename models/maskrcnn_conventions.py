"""How torchvision's Mask R-CNN and Detectron2's differ, and what a weights file leaves open.

Both call the same network by the same name. Images, strides, anchors, ROIAlign and the order of the classes differ
all the same, and weights of one give nonsense under the other's conventions. The values are those of torchvision
0.29 (`maskrcnn_resnet50_fpn`) and of Detectron2 0.5 (`mask_rcnn_R_50_FPN_3x.yaml`). Importing this imports no torch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal

from scpf.models.errors import UsageError

Colour = Literal["rgb", "bgr"]
Stride = Literal["1x1", "3x3"]
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Convention:
    """What the network expects and how it reads its own outputs.

    ``pixel_mean``, ``pixel_deviation``: in the order of ``colour``, after the pixel was multiplied by ``pixel_scale``.
    ``stride``: the convolution of a bottleneck that halves the resolution. ``antialias``: images are shrunk by
    Pillow, to rounded sizes; else by linear interpolation of floats, to sizes rounded down. ``roi_samples``: along
    an axis of a bin, 0: one a cell. ``grid_strides``: anchors stand apart by image size / grid size, which need not be
    the nominal stride. ``least_proposal_px``, ``least_box_px``: what is not larger is dropped. ``level_epsilon``,
    ``epsilon_in_log``: keep a box of exactly 224 px from falling a level lower. ``pasted_whole``: masks are pasted on
    whole pixels. The last three matter to training alone.
    """

    name: Literal["detectron2", "torchvision"]
    colour: Colour
    pixel_scale: float
    pixel_mean: Triple
    pixel_deviation: Triple
    stride: Stride
    batch_norm_epsilon: float
    antialias: bool
    rounded_anchors: bool
    grid_strides: bool
    roi_samples: int
    roi_aligned: bool
    least_proposal_px: float
    least_box_px: float
    level_epsilon: float
    epsilon_in_log: bool
    rank_by_probability: bool
    pasted_whole: bool
    proposals_in_training: int
    smooth_l1_beta: float
    binary_mask_targets: bool


DETECTRON2: Final = Convention(
    name="detectron2",
    colour="bgr",
    pixel_scale=1.0,
    pixel_mean=(103.53, 116.28, 123.675),
    pixel_deviation=(1.0, 1.0, 1.0),
    stride="1x1",
    batch_norm_epsilon=1e-5,
    antialias=True,
    rounded_anchors=False,
    grid_strides=False,
    roi_samples=0,
    roi_aligned=True,
    least_proposal_px=0.0,
    least_box_px=-1.0,
    level_epsilon=1e-8,
    epsilon_in_log=True,
    rank_by_probability=False,
    pasted_whole=False,
    proposals_in_training=1000,
    smooth_l1_beta=0.0,
    binary_mask_targets=True,
)

TORCHVISION: Final = Convention(
    name="torchvision",
    colour="rgb",
    pixel_scale=1 / 255,
    pixel_mean=(0.485, 0.456, 0.406),
    pixel_deviation=(0.229, 0.224, 0.225),
    stride="3x3",
    batch_norm_epsilon=0.0,
    antialias=False,
    rounded_anchors=True,
    grid_strides=True,
    roi_samples=2,
    roi_aligned=False,
    least_proposal_px=1e-3,
    least_box_px=1e-2,
    level_epsilon=1e-6,
    epsilon_in_log=False,
    rank_by_probability=True,
    pasted_whole=True,
    proposals_in_training=2000,
    smooth_l1_beta=1 / 9,
    binary_mask_targets=False,
)

CONVENTIONS: Final = {convention.name: convention for convention in (DETECTRON2, TORCHVISION)}


@dataclass(frozen=True)
class CheckpointSettings:
    """What a person says about a Mask R-CNN's weights where the file does not; None: as its convention has it.

    ``colour``: order of the channels of the images it was trained on. ``stride``: the convolution of a bottleneck
    that halves the resolution. ``batch_norm_epsilon``: added to the variances. ``classes``: names, in the file's
    order without the background; empty for a class to be left out. One class is a light pole unless named.
    ``short_side_px``, ``long_side_px``: images are scaled to the first, and to less where their long side would
    exceed the second.
    """

    colour: Colour | None = None
    stride: Stride | None = None
    batch_norm_epsilon: float | None = None
    classes: tuple[str, ...] = ()
    short_side_px: int = 800
    long_side_px: int = 1333


def decided(
    convention: Convention, settings: CheckpointSettings, *, trained_norms: bool, pixels_known: bool
) -> tuple[Convention, tuple[str, ...]]:
    """The convention with the person's words in it, and a few words for each thing that nobody said.

    ``trained_norms``: the file counts batches, as batch norms that were trained with the rest do; torchvision then
    has its usual epsilon. ``pixels_known``: the file has its own mean of the pixels.
    """
    if settings.short_side_px < 32 or settings.long_side_px < settings.short_side_px:
        sizes = f"short_side_px = {settings.short_side_px}, long_side_px = {settings.long_side_px}"
        raise UsageError(
            f"checkpoint.{sizes}", "from 32 px, and the long side not shorter than the short one"
        )
    if settings.batch_norm_epsilon is not None and not 0 <= settings.batch_norm_epsilon <= 1:
        raise UsageError("checkpoint.batch_norm_epsilon lies between 0 and 1")
    assumed = []
    if settings.colour is None:
        why = " (by the mean that it has)" if pixels_known else ""
        assumed.append(f"colour order {convention.colour.upper()}{why}")
    elif pixels_known:  # the mean stands in the order in which the channels came
        convention = replace(convention, colour=settings.colour)
    elif settings.colour != convention.colour:
        convention = replace(
            convention,
            colour=settings.colour,
            pixel_mean=convention.pixel_mean[::-1],
            pixel_deviation=convention.pixel_deviation[::-1],
        )
    if settings.stride is None:
        assumed.append(f"stride in the {convention.stride} convolution")
    else:
        convention = replace(convention, stride=settings.stride)
    if settings.batch_norm_epsilon is not None:
        convention = replace(convention, batch_norm_epsilon=settings.batch_norm_epsilon)
    elif convention.name == "torchvision":
        if trained_norms:
            convention = replace(convention, batch_norm_epsilon=1e-5)
        # Training that began at torchvision's COCO weights keeps their 0; any other has 1e-5.
        assumed.append(f"batch norm epsilon {convention.batch_norm_epsilon:g}")
    return convention, tuple(assumed)
