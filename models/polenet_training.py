"""Training of PoleNet on folders of labelled images, on a CPU.

Losses: class-weighted cross-entropy and Dice (Milletari et al. 2016) for the mask, the penalty-reduced focal loss of
CenterNet (Zhou et al. 2019, eq. 1) for the centres, L1 for the offsets.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from scpf.models import polenet, polenet_validation
from scpf.models.polenet_samples import LabelledImage, Sample, labelled_images, make_sample

Losses = dict[str, float]
Report = Callable[[str], None]


@dataclass(frozen=True)
class TrainingSettings:
    """``sizes_px``: (width, height) of the crops, one of them for each batch. ``limit_s``: the schedule is squeezed
    into this many seconds where ``steps`` would take longer (the result then depends on the machine's speed)."""

    steps: int = 1500
    batch: int = 8
    sizes_px: tuple[tuple[int, int], ...] = ((640, 480), (768, 384))
    learning_rate: float = 3e-3
    warm_up_steps: int = 60
    weight_decay: float = 1e-2
    gradient_norm: float = 5.0
    validate_every: int = 300
    limit_s: float = float("inf")
    start: Path | None = None  # weights to go on from


def train(
    train_dirs: Sequence[Path],
    validation_dirs: Sequence[Path],
    output: Path,
    settings: TrainingSettings,
    seed: int,
    report: Report = print,
    trained_on: str = "",
) -> polenet.WeightsInfo:
    """Trains, calibrates the score, writes ``output`` and returns what it says about itself.

    Every training folder is drawn equally often, whatever its size. The calibration is fitted on every other
    validation image, the figures are of the rest.
    """
    torch.manual_seed(seed)
    net = polenet.load(settings.start)[0] if settings.start else polenet.PoleNet()
    net = polenet.channels_last(net).train()
    folders = [labelled_images(folder) for folder in train_dirs]
    held_out = [labelled_images(folder) for folder in validation_dirs]
    few = [source for images in held_out for source in images[:: max(1, len(images) // 12)]]
    optimizer = torch.optim.AdamW(
        net.parameters(), settings.learning_rate, weight_decay=settings.weight_decay
    )
    began = time.monotonic()
    for step, batch in enumerate(_batches(folders, settings, seed)):
        elapsed = time.monotonic() - began
        progress = max(step / settings.steps, elapsed / settings.limit_s)
        if progress >= 1:
            break
        warm = min(1.0, (step + 1) / settings.warm_up_steps)
        rate = settings.learning_rate * warm * 0.5 * (1 + np.cos(np.pi * progress)) + 1e-5
        for parameters in optimizer.param_groups:
            parameters["lr"] = rate
        losses = training_step(net, optimizer, batch, settings.gradient_norm)
        if step % 25 == 0:
            shown = " ".join(f"{name} {value:.3f}" for name, value in losses.items())
            report(f"step {step} {progress:.0%} {elapsed:.0f} s rate {rate:.5f} {shown}")
        if step and step % settings.validate_every == 0:  # an interrupted training leaves these weights
            _finish(net, few, output, trained_on, report)
    return _finish(net, [source for images in held_out for source in images], output, trained_on, report)


def _finish(
    net: polenet.PoleNet, held_out: Sequence[LabelledImage], output: Path, trained_on: str, report: Report
) -> polenet.WeightsInfo:
    """Judges, calibrates and writes the network as it is."""
    judged = polenet_validation.judge(polenet.for_inference(net), held_out)
    calibration = judged.fit_calibration(np.s_[0::2])
    figures = judged.figures(calibration, np.s_[1::2])
    report(f"{len(held_out)} held out: " + " ".join(f"{name} {value:.3f}" for name, value in figures.items()))
    info = polenet.WeightsInfo(trained_on, calibration, figures=figures)
    polenet.save(output, net, info)
    return info


def training_step(
    net: polenet.PoleNet, optimizer: torch.optim.Optimizer, batch: Sequence[Sample], gradient_norm: float
) -> Losses:
    """One step of the optimizer; the losses before it."""
    inputs = polenet.to_input(np.stack([sample.image for sample in batch]))
    truth = [torch.from_numpy(np.stack(maps)) for maps in list(zip(*batch, strict=True))[1:]]
    with torch.autocast("cpu", dtype=torch.bfloat16, enabled=polenet.has_fast_bfloat16()):
        outputs = net(inputs)
    total, losses = loss(outputs, truth)
    optimizer.zero_grad()
    total.backward()  # type: ignore[no-untyped-call]
    torch.nn.utils.clip_grad_norm_(net.parameters(), gradient_norm)
    optimizer.step()
    return losses


def loss(outputs: tuple[Tensor, Tensor, Tensor], truth: Sequence[Tensor]) -> tuple[Tensor, Losses]:
    """The sum to be minimised and its parts; ``truth``: the maps of `Sample` after the image, batched."""
    cover, valid, centre, centre_valid, offsets, offsets_valid = truth
    mask_logit, centre_logit, aim = outputs[0][:, 0].float(), outputs[1][:, 0].float(), outputs[2].float()
    weight = (1 + 4 * cover) * valid  # poles cover a hundredth of a picture
    cross_entropy = F.binary_cross_entropy_with_logits(mask_logit, cover, weight)
    p = mask_logit.sigmoid() * valid
    overlap = (2 * (p * cover).sum((1, 2)) + 1) / ((p * p).sum((1, 2)) + (cover * cover).sum((1, 2)) + 1)
    dice = (1 - overlap).mean()
    q = centre_logit.sigmoid().clamp(1e-4, 1 - 1e-4)
    peak = centre.eq(1).float()
    hit = peak * (1 - q) ** 2 * q.log()
    miss = (1 - peak) * centre_valid * (1 - centre) ** 4 * q**2 * (1 - q).log()
    focal = -(hit + miss).sum() / peak.sum().clamp(min=1)
    shift = ((aim - offsets).abs().sum(1) * offsets_valid).sum() / offsets_valid.sum().clamp(min=1)
    total = 2 * cross_entropy + dice + focal + 0.5 * shift
    parts = {"cross_entropy": cross_entropy, "dice": dice, "centre": focal, "offsets": shift}
    return total, {name: float(part.detach()) for name, part in parts.items()}


def _batches(
    folders: Sequence[Sequence[LabelledImage]], settings: TrainingSettings, seed: int
) -> Iterator[list[Sample]]:
    """Batches for ever, made one ahead in another thread; the same for the same seed."""

    def make(step: int) -> list[Sample]:
        rng = np.random.default_rng([seed, step])
        size = settings.sizes_px[int(rng.integers(len(settings.sizes_px)))]
        drawn = [folders[int(rng.integers(len(folders)))] for _ in range(settings.batch)]
        return [make_sample(images[int(rng.integers(len(images)))], size, rng) for images in drawn]

    with ThreadPoolExecutor(1) as pool:
        step = 0
        coming: Future[list[Sample]] = pool.submit(make, step)
        while True:
            batch = coming.result()
            step += 1
            coming = pool.submit(make, step)
            yield batch
