"""How PoleNet is trained, and what a training leaves in its run folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from scpf.models.segmentation import STRIDE_PX

BEST = "best.safetensors"
LAST = "last.safetensors"
FINAL = "final.safetensors"
STATE = "last.pt"
SMALL = 0.6  # a step of such crops takes half the time: they must be made, too


@dataclass(frozen=True)
class TrainingSettings:
    """``sizes_px``: (width, height) of the crops, one of them for each batch. ``limit_s``: the schedule is squeezed
    into this many seconds where ``steps`` would take longer (the result then depends on the machine's speed).
    ``patience``: stop after so many validations without a better AP, 0 never; with 0 the last weights are kept, not
    those that few pictures found best. ``pasted``: the share of the crops into which poles of other pictures are
    pasted. ``small_crops``: the share of the steps, the first ones, that see crops of `SMALL` times the width and
    height (progressive learning: Tan and Le, EfficientNetV2, ICML 2021, section 4.2). ``device``: cpu, cuda or mps.
    ``workers``: threads that make crops. ``validation_images``: the most that a validation on the way looks at."""

    steps: int = 1500
    batch: int = 8
    sizes_px: tuple[tuple[int, int], ...] = ((640, 480), (768, 384), (480, 768))
    learning_rate: float = 3e-3
    warm_up_steps: int = 60
    weight_decay: float = 1e-2
    gradient_norm: float = 5.0
    validate_every: int = 300
    validation_images: int = 40
    patience: int = 0
    report_every: int = 25
    limit_s: float = float("inf")
    start: Path | None = None  # weights to go on from,
    keep_start: float = 0.0  # and their share in those that the training ends with
    pasted: float = 0.0
    small_crops: float = 0.0
    device: str = "cpu"
    workers: int = 1

    def crop_sizes_px(self, step: int) -> tuple[tuple[int, int], ...]:
        """Those that a step draws from, (width, height) each."""
        if step >= self.small_crops * self.steps:
            return self.sizes_px
        return tuple((_small_px(width), _small_px(height)) for width, height in self.sizes_px)

    @property
    def kept(self) -> str:
        """The file in the run folder that becomes `FINAL`."""
        return BEST if self.patience else LAST


def _small_px(side_px: int) -> int:
    return max(1, round(SMALL * side_px / STRIDE_PX)) * STRIDE_PX
