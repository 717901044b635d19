"""Segmenters by name, and PoleNet's. Importing this module imports neither torch nor OpenCV: `load` does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import MissingError, UsageError
from scpf.models.instances import Image, Instance, Segmenter

if TYPE_CHECKING:
    from scpf.models.devices import DeviceName
    from scpf.models.grouping import Candidate, ScoreCalibration
    from scpf.models.maskrcnn_conventions import CheckpointSettings
    from scpf.models.polenet import PoleNet, WeightsInfo

DEFAULT_THRESHOLD = 0.9
PIXELS = 1024 * 768  # every picture is brought to so many: each costs the same, and thin poles want pixels
MOST_ENLARGED = 2.0
LONGEST_SIDE_PX = 4096  # a log may claim a picture one pixel high, which padding would make vast
KEPT = (0.9, 1.1)  # no resampling for less
STRIDE_PX = 32  # the sides of the network's input are multiples of it
PADDING_GREY = 115  # the mean of PoleNet's input: 0 after normalisation
MASK_THRESHOLD = 0.5  # pixels of a lower probability are no pole's

SEGMENTERS = {
    "polenet": "scpf.models.segmentation:load_polenet",
    "thorough": "scpf.models.looks:load",
    "maskrcnn": "scpf.models.maskrcnn_segmenter:load",
    "onnx": "scpf.models.onnx_segmenter:load",
}
THOROUGH_WITH = "thorough:"  # before a file of PoleNet's weights
WEIGHTS_SUFFIXES = (".safetensors", ".pth", ".pt", ".pkl", ".onnx")


def load(
    name_or_path: str | Path,
    *,
    threads: int | None = None,
    threshold: float = DEFAULT_THRESHOLD,
    bfloat16: bool = False,
    device: DeviceName = "cpu",
    checkpoint: CheckpointSettings | None = None,
) -> Segmenter:
    """The segmenter of a name of `SEGMENTERS`, or of a weights file (`WEIGHTS_SUFFIXES`), which tells whose it is.

    ``thorough:FILE``: three looks by the PoleNet of a file.

    ``threads``: CPU threads for the network, for the whole process; by default as torch sets it.
    ``threshold``: instances of a lower score are left out. ``bfloat16``: less time on a CPU that computes it
    itself, at results that differ a little between machines. ``checkpoint``: what a Mask R-CNN's weights do not say
    of themselves. Raises MissingError and InputError.
    """
    options: dict[str, Any] = {
        "threads": threads, "threshold": threshold, "bfloat16": bfloat16, "device": device,
    }  # fmt: skip
    name = str(name_or_path)
    if name.startswith(THOROUGH_WITH):
        options["path"] = Path(name.removeprefix(THOROUGH_WITH))
        name = "thorough"
    elif name.endswith(WEIGHTS_SUFFIXES):
        options["path"] = Path(name_or_path)
        name = network_of(options["path"])
    if name not in SEGMENTERS:
        known = f"one of {', '.join(SEGMENTERS)}, or weights ({', '.join(WEIGHTS_SUFFIXES)})"
        raise MissingError(f"no segmenter {name!r}", known)
    if name == "maskrcnn":
        options["checkpoint"] = checkpoint
    module, _, function = SEGMENTERS[name].partition(":")
    return cast(Callable[..., Segmenter], getattr(import_module(module), function))(**options)


def network_of(path: Path) -> str:
    """The name in `SEGMENTERS` of the network that a weights file is for."""
    if path.suffix != ".safetensors":
        return "onnx" if path.suffix == ".onnx" else "maskrcnn"
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="numpy") as file:
            return "maskrcnn" if any(name.startswith("backbone.") for name in file.keys()) else "polenet"  # noqa: SIM118
    except (SafetensorError, OSError):
        return "polenet"  # whose loader says what is wrong with the file


def load_polenet(
    path: Path | None = None,
    *,
    threads: int | None = None,
    threshold: float = DEFAULT_THRESHOLD,
    bfloat16: bool = False,
    device: DeviceName = "cpu",
) -> PoleNetSegmenter:
    """PoleNet with the weights of ``path``, by default those that come with scpf."""
    import torch

    from scpf.models import devices, polenet
    from scpf.models.memory import keep_freed_memory

    keep_freed_memory()
    if threads is not None:
        torch.set_num_threads(threads)
    net, info = polenet.load(path or polenet.weights_path(polenet.SHIPPED))
    return PoleNetSegmenter(net.to(devices.choose(device)), info, threshold, bfloat16)


class PoleNetSegmenter:
    """Finds light poles in an image (H, W, 3), uint8, RGB; best score first."""

    def __init__(
        self,
        net: PoleNet,
        info: WeightsInfo,
        threshold: float = DEFAULT_THRESHOLD,
        bfloat16: bool = False,
    ) -> None:
        from scpf.models.polenet_inference import for_inference

        self.info = info
        self.threshold = threshold
        self._net = for_inference(net, bfloat16=bfloat16)

    def __call__(self, image: Image) -> list[Instance]:
        """Instances with a calibrated score of at least the threshold, masks at the resolution of ``image``."""
        return self.batch([image])[0]

    def batch(self, images: Sequence[Image], zoom: float = 1.0) -> list[list[Instance]]:
        """The instances of each of several images of one size, in one pass of the network.

        ``zoom``: the pictures' size, relative to that at which `frame` shows them by default.
        """
        from scpf.models.polenet_inference import batch_maps

        if len({image.shape for image in images}) > 1:
            raise UsageError("images of different sizes in one batch")
        framed = [frame(image, zoom) for image in images]
        if not framed:
            return []
        found = batch_maps(self._net, np.stack([each for each, _ in framed]), self.info.tile_gate)
        return [
            instances(*each, image.shape[:2], shown_px, self.info.calibration, self.threshold)
            for each, image, (_, shown_px) in zip(found, images, framed, strict=True)
        ]


def instances(
    mask: NDArray[Any],
    centre: NDArray[Any],
    offsets: NDArray[Any],
    size: tuple[int, ...],
    shown_px: tuple[int, int],
    calibration: ScoreCalibration,
    threshold: float,
) -> list[Instance]:
    """Instances of PoleNet's maps in an image of ``size`` (height, width), best score first.

    The maps are as `polenet_inference.maps` gives them. ``shown_px``: (width, height) of them that the
    image fills, as `frame` gives it.
    """
    from scpf.models.grouping import group

    scale = (size[1] / shown_px[0], size[0] / shown_px[1])
    found = []
    for candidate in group(mask[: shown_px[1], : shown_px[0]], centre, offsets):
        score = calibration.probability(candidate)
        instance = at_full_resolution(candidate, scale, score) if score >= threshold else None
        if instance is not None:
            found.append(instance)
    return sorted(found, key=lambda instance: -instance.score)


def frame(image: Image, zoom: float = 1.0) -> tuple[Image, tuple[int, int]]:
    """The network's input (h, w, 3) and the (width, height) of it that the picture fills, from the upper left.

    The image is brought to about `PIXELS` (2048×1536 becomes 1024×768, 1226×370 becomes 1614×487), then padded to
    multiples of `STRIDE_PX`. ``zoom`` makes it larger than that, or smaller, within the limits of any picture.
    """
    import cv2

    height, width = image.shape[:2]
    longest = LONGEST_SIDE_PX / max(height, width)
    scale = min((PIXELS / (height * width)) ** 0.5, MOST_ENLARGED, longest)
    scale = 1.0 if KEPT[0] < scale < KEPT[1] else scale
    if zoom != 1.0:
        scale = min(zoom * scale, MOST_ENLARGED, longest)
    shown = (max(1, round(width * scale)), max(1, round(height * scale)))
    whole = max(1, int(1 / scale + 1e-6))  # the mean of whole pixels first, as that of parts is slow
    small: NDArray[Any] = image
    if whole > 1:
        parts = (max(1, width // whole), max(1, height // whole))
        small = cv2.resize(image, parts, interpolation=cv2.INTER_AREA)
    if small.shape[1::-1] != shown:
        method = cv2.INTER_LINEAR if scale < 1.0 else cv2.INTER_CUBIC
        small = cv2.resize(small, shown, interpolation=method)
    right, below = -shown[0] % STRIDE_PX, -shown[1] % STRIDE_PX
    if right or below:
        grey = (PADDING_GREY,) * 3
        small = cv2.copyMakeBorder(small, 0, below, 0, right, cv2.BORDER_CONSTANT, value=grey)
    return np.ascontiguousarray(small), shown


def at_full_resolution(candidate: Candidate, scale: tuple[float, float], score: float) -> Instance | None:
    """The instance of a candidate, its soft mask enlarged by ``scale`` (x, y) before it is cut; None where empty."""
    import cv2

    height, width = candidate.soft.shape
    x1, y1 = (round(corner * s) for corner, s in zip(candidate.corner_px, scale, strict=True))
    soft = candidate.soft
    if scale != (1.0, 1.0):
        size = (max(1, round(width * scale[0])), max(1, round(height * scale[1])))
        soft = np.asarray(cv2.resize(soft, size, interpolation=cv2.INTER_LINEAR), np.float32)
    mask = soft > MASK_THRESHOLD
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    if not len(rows):
        return None
    mask = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].copy()
    left, top = x1 + int(columns[0]), y1 + int(rows[0])
    box = (float(left), float(top), float(left + mask.shape[1]), float(top + mask.shape[0]))
    return Instance(box, mask, (left, top), score)
