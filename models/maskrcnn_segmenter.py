"""Mask R-CNN as a segmenter: weights of torchvision, Detectron2 or this project in, instances of an image out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import torch

from scpf.models import box_ops, maskrcnn_images
from scpf.models.checkpoint_keys import Recognised, recognise
from scpf.models.checkpoints import read_tensors
from scpf.models.devices import DeviceName, choose
from scpf.models.errors import InputError, MissingError, UsageError
from scpf.models.instances import Image, Instance
from scpf.models.maskrcnn import MaskRCNN, for_inference
from scpf.models.maskrcnn_conventions import CheckpointSettings, decided
from scpf.models.maskrcnn_heads import Detections

DEFAULT_THRESHOLD = 0.9


class MaskRCNNSegmenter:
    """Finds the instances of a Mask R-CNN's classes in an image (H, W, 3), uint8, RGB; best score first.

    ``classes``: their names; instances of a class without a name are left out. ``assumed``: what the weights file
    left open, in a few words each.
    """

    def __init__(
        self,
        net: MaskRCNN,
        classes: Sequence[str],
        settings: CheckpointSettings,
        threshold: float = DEFAULT_THRESHOLD,
        assumed: Sequence[str] = (),
    ) -> None:
        self.net = net
        self.classes = tuple(classes)
        self.settings = settings
        self.threshold = threshold
        self.assumed = tuple(assumed)

    @property
    def description(self) -> str:
        """What the network is and what was assumed about it, in one line."""
        count = len(self.classes)
        kinds = f"{count} classes" if count > 1 else f"class {self.classes[0]}"
        known = f"Mask R-CNN in {self.net.convention.name}'s convention, {kinds}"
        return (
            f"{known}; assumed, as the file does not say: {', '.join(self.assumed)}"
            if self.assumed
            else known
        )

    def __call__(self, image: Image) -> list[Instance]:
        """Instances with a score of at least the threshold, masks at the resolution of ``image``."""
        return self.batch([image])[0]

    def batch(self, images: Sequence[Image]) -> list[list[Instance]]:
        """The instances of each of several images of one size, in one pass of the network."""
        if len({image.shape for image in images}) > 1:
            raise UsageError("images of different sizes in one batch")
        found = self.detect(images)
        return [self._instances(each, image.shape[:2]) for each, image in zip(found, images, strict=True)]

    def detect(self, images: Sequence[Image]) -> list[Detections]:
        """What the network gives for images of one size, on the CPU, with boxes in px of the images themselves."""
        short, long = self.settings.short_side_px, self.settings.long_side_px
        scaled = [maskrcnn_images.network_image(image, short, long, self.net.convention) for image in images]
        inputs = self.net.normalise(torch.stack(scaled).to(self.net.device))
        height, width = images[0].shape[:2]
        found = []
        for each in self.net.detect(inputs, self.threshold):
            sides = torch.tensor([width / inputs.shape[-1], height / inputs.shape[-2]])
            boxes = each.boxes.cpu() * sides.repeat(2)
            whole = box_ops.larger_than(boxes, 0.0)
            fields = (boxes, each.scores.cpu(), each.classes.cpu(), each.masks.cpu())
            found.append(Detections(*(field[whole] for field in fields)))
        return found

    def _instances(self, found: Detections, size_px: tuple[int, ...]) -> list[Instance]:
        instances = []
        for box, score, number, mask in zip(
            found.boxes.tolist(), found.scores.tolist(), found.classes.tolist(), found.masks, strict=True
        ):
            if not self.classes[number]:
                continue
            crop = maskrcnn_images.paste(mask, box, size_px, self.net.convention)
            if crop is not None:
                instances.append(Instance(tuple(box), *crop, score, self.classes[number]))
        return instances


def load(
    path: Path | None = None,
    *,
    threads: int | None = None,
    threshold: float = DEFAULT_THRESHOLD,
    bfloat16: bool = False,
    device: DeviceName = "auto",
    checkpoint: CheckpointSettings | None = None,
) -> MaskRCNNSegmenter:
    """The Mask R-CNN of a weights file, recognised by the names of its tensors.

    ``checkpoint``: what a person knows and the file does not say. Raises MissingError where there is no file, and
    InputError where it holds code, is damaged, or is not a Mask R-CNN.
    """
    if path is None:
        raise MissingError(
            "the segmenter maskrcnn needs a weights file; none ships with scpf",
            "train torchvision's maskrcnn_resnet50_fpn or Detectron2's mask_rcnn_R_50_FPN_3x on your pictures, and "
            "name the file: --segmenter FILE.pth",
        )
    settings = checkpoint or CheckpointSettings()
    if threads is not None:
        torch.set_num_threads(threads)
    found = recognise(read_tensors(path), str(path))
    net, assumed = build(found, settings, str(path))
    names = class_names(found.classes, settings.classes, str(path))
    dtype = torch.bfloat16 if bfloat16 else torch.float32
    return MaskRCNNSegmenter(for_inference(net, choose(device), dtype), names, settings, threshold, assumed)


def build(found: Recognised, settings: CheckpointSettings, file: str) -> tuple[MaskRCNN, tuple[str, ...]]:
    """The network with the tensors of a file in it, in single precision, and what was assumed about it."""
    convention, assumed = decided(
        found.convention, settings, trained_norms=found.trained_norms, pixels_known=found.pixels_known
    )
    with torch.device("meta"):  # names and shapes alone: the weights are not drawn in vain
        net = MaskRCNN(found.classes, convention, found.blocks)
    expected = net.state_dict()
    missing = sorted(expected.keys() - found.tensors.keys())
    unknown = sorted(found.tensors.keys() - expected.keys())
    if missing:
        raise InputError(f"{file}: lacks {missing[0]} and {len(missing) - 1} more tensors of a Mask R-CNN")
    if unknown:
        raise InputError(
            f"{file}: holds {unknown[0]}, which a Mask R-CNN has not, and {len(unknown) - 1} more"
        )
    for name, tensor in found.tensors.items():
        if tensor.shape != expected[name].shape:
            shapes = f"{tuple(tensor.shape)}, not {tuple(expected[name].shape)}"
            raise InputError(f"{file}: {name} is {shapes}", "heads that no class has for itself do not fit")
        if not tensor.is_floating_point() or not bool(torch.isfinite(tensor).all()):
            raise InputError(f"{file}: {name} holds values that are not finite numbers")
    net.load_state_dict({name: value.float() for name, value in found.tensors.items()}, assign=True)
    return net.eval(), assumed


def class_names(count: int, given: Sequence[str], file: str) -> tuple[str, ...]:
    """The names of ``count`` classes; InputError where a person gave another number of them."""
    if given and len(given) != count:
        raise InputError(
            f"{file}: predicts {count} classes, {len(given)} names were given",
            "name them all, in the file's order, without the background",
        )
    if given:
        return tuple(given)
    return ("light_pole",) if count == 1 else tuple(f"class_{k}" for k in range(count))
