"""Segmenters by name, and PoleNet's. Importing this module imports neither torch nor OpenCV: `load` does."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from scpf.models.errors import MissingError
from scpf.models.instances import Image, Instance, Segmenter

if TYPE_CHECKING:
    from scpf.models.grouping import Candidate
    from scpf.models.polenet import PoleNet, WeightsInfo

DEFAULT_THRESHOLD = 0.9
LONGEST_SIDE_PX = 1280
STRIDE_PX = 32  # the sides of the network's input are multiples of it
PADDING_GREY = 115  # the mean of PoleNet's input: 0 after normalisation
MASK_THRESHOLD = 0.5

SEGMENTERS = {"polenet": "scpf.models.segmentation:load_polenet"}


def load(
    name_or_path: str | Path,
    *,
    threads: int | None = None,
    threshold: float = DEFAULT_THRESHOLD,
    bfloat16: bool = False,
) -> Segmenter:
    """The segmenter of a name of `SEGMENTERS`, or of a path to PoleNet weights (``.safetensors``).

    ``threads``: CPU threads for the network, for the whole process; by default as torch sets it.
    ``threshold``: instances of a lower score are left out. ``bfloat16``: half the time on a CPU that computes it
    itself, at results that differ a little between machines. Raises MissingError and InputError.
    """
    if str(name_or_path).endswith(".safetensors"):
        return load_polenet(Path(name_or_path), threads=threads, threshold=threshold, bfloat16=bfloat16)
    if str(name_or_path) not in SEGMENTERS:
        known = ", ".join(SEGMENTERS)
        raise MissingError(
            f"no segmenter {str(name_or_path)!r}", f"one of {known}, or a path to .safetensors weights"
        )
    module, _, function = SEGMENTERS[str(name_or_path)].partition(":")
    return cast(Callable[..., Segmenter], getattr(import_module(module), function))(
        threads=threads, threshold=threshold, bfloat16=bfloat16
    )


def load_polenet(
    path: Path | None = None,
    *,
    threads: int | None = None,
    threshold: float = DEFAULT_THRESHOLD,
    bfloat16: bool = False,
) -> PoleNetSegmenter:
    """PoleNet with the weights of ``path``, by default those that come with scpf."""
    import torch

    from scpf.models import polenet

    if threads is not None:
        torch.set_num_threads(threads)
    net, info = polenet.load(path or Path(__file__).with_name("polenet.safetensors"))
    return PoleNetSegmenter(net, info, threshold, bfloat16)


class PoleNetSegmenter:
    """Finds light poles in an image (H, W, 3), uint8, RGB; best score first."""

    def __init__(
        self,
        net: PoleNet,
        info: WeightsInfo,
        threshold: float = DEFAULT_THRESHOLD,
        bfloat16: bool = False,
    ) -> None:
        from scpf.models import polenet

        self.info = info
        self.threshold = threshold
        self._net = polenet.for_inference(net, bfloat16=bfloat16)

    def __call__(self, image: Image) -> list[Instance]:
        """Instances with a calibrated score of at least the threshold, masks at the resolution of ``image``."""
        from scpf.models.grouping import group

        framed, shown_px = frame(image)
        mask, centre, offsets = maps(self._net, framed)
        scale = (image.shape[1] / shown_px[0], image.shape[0] / shown_px[1])
        found = []
        for candidate in group(mask[: shown_px[1], : shown_px[0]], centre, offsets):
            score = self.info.calibration.probability(
                candidate.centre, candidate.mask_mean, candidate.height_px
            )
            instance = at_full_resolution(candidate, scale, score) if score >= self.threshold else None
            if instance is not None:
                found.append(instance)
        return sorted(found, key=lambda instance: -instance.score)


def frame(image: Image) -> tuple[Image, tuple[int, int]]:
    """The network's input (h, w, 3) and the (width, height) of it that the picture fills, from the upper left.

    The image is shrunk by the least whole factor that brings its long side to `LONGEST_SIDE_PX` (2048×1536 becomes
    1024×768; 1226×370 stays), then padded to multiples of `STRIDE_PX`.
    """
    import cv2

    height, width = image.shape[:2]
    factor = -(-max(height, width) // LONGEST_SIDE_PX)
    shown = (max(1, round(width / factor)), max(1, round(height / factor)))
    small = image if factor == 1 else cv2.resize(image, shown, interpolation=cv2.INTER_AREA)
    right, below = -shown[0] % STRIDE_PX, -shown[1] % STRIDE_PX
    if right or below:
        grey = (PADDING_GREY,) * 3
        small = cv2.copyMakeBorder(small, 0, below, 0, right, cv2.BORDER_CONSTANT, value=grey)
    return np.ascontiguousarray(small), shown


def maps(net: PoleNet, framed: Image) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Probabilities of mask (h, w) and centre (h/8, w/8), offsets (2, h/4, w/4) of one framed image."""
    import torch

    from scpf.models.polenet import to_input

    with torch.inference_mode():
        x = to_input(framed[None]).to(next(net.parameters()))  # its device and precision
        mask, centre, offsets = net(x)
        mask, centre = mask[0, 0].float().sigmoid(), centre[0, 0].float().sigmoid()
        return mask.cpu().numpy(), centre.cpu().numpy(), offsets[0].float().cpu().numpy()


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
