"""Training of PoleNet on labelled images: the schedule, the best weights, and going on after an interruption.

Each step draws its crops from seed and step alone, so that a training that goes on takes the steps that it would have
taken. The losses are in `polenet_losses`.
"""

from __future__ import annotations

import math
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from scpf.models import polenet, polenet_inference
from scpf.models.labelled_images import LabelledImage
from scpf.models.pole_tiles_fit import fit_tile_gate, gate_pictures
from scpf.models.polenet_losses import loss
from scpf.models.polenet_samples import Sample, make_sample
from scpf.models.polenet_validation import REST, judged_weights
from scpf.models.training_settings import BEST, FINAL, LAST, STATE, TrainingSettings
from scpf.models.training_state import TrainingState

Losses = dict[str, float]
Report = Callable[[str], None]
Curves = Callable[[str, int, Mapping[str, float]], None]  # "loss" or "validation", step, values by name

JUDGED_BY = "mask_ap50"


def train(
    training: Sequence[Sequence[LabelledImage]],
    held_out: Sequence[LabelledImage],
    run_folder: Path,
    settings: TrainingSettings,
    seed: int,
    about: polenet.WeightsInfo,
    *,
    resume: bool = False,
    report: Report = lambda line: None,
    curves: Curves = lambda kind, step, values: None,
    weighing: Sequence[LabelledImage] = (),
) -> polenet.WeightsInfo:
    """Trains and calibrates; leaves weights as `FINAL`, the best as `BEST`, those of the last validation as `LAST`.

    Every set of ``training`` is drawn equally often, whatever its size. The best are those with the highest mask AP on
    a validation. In the end `TrainingSettings.kept` are mixed with the start's weights, where that is wanted, and their
    calibration is fitted on every other held-out image, or there only its scale, where ``weighing`` holds images to
    weigh the evidence on; and the gate of the finest levels is fitted (`pole_tiles_fit`). Returns what `FINAL` says of
    itself; the figures are of the other held-out images.
    ``about``: what the weights shall say of their training. ``resume``: go on from the `STATE` in the folder.
    """
    torch.manual_seed(seed)
    state = begin(settings)
    if resume:
        state.restore(run_folder / STATE, torch.device(settings.device))
        report(f"going on from step {state.step}")
    few = held_out[:: max(1, len(held_out) // settings.validation_images)]
    run = _Run(state, few, run_folder, about, report, curves)
    began = time.monotonic() - state.elapsed_s
    sums: Losses = defaultdict(float)
    summed = 0
    try:
        for batch in _batches(training, settings, seed, state.step):
            state.elapsed_s = time.monotonic() - began
            progress = max(state.step / settings.steps, state.elapsed_s / settings.limit_s)
            if progress >= 1:
                break
            rate = _set_learning_rate(state, settings, progress)
            losses = training_step(state, batch, settings.gradient_norm)
            state.stepped()
            summed += 1
            for name, value in losses.items():
                sums[name] += value
            if state.step % settings.report_every == 0:
                means = {name: value / summed for name, value in sums.items()}
                run.tell(progress, {**means, "learning_rate": rate})
                sums.clear()
                summed = 0
            if state.step % settings.validate_every == 0:
                run.validate()
                waited = (state.step - state.best_step) // settings.validate_every
                if settings.patience and waited >= settings.patience:
                    report(f"no better {JUDGED_BY} since step {state.best_step}: stopped")
                    break
    except KeyboardInterrupt:
        state.save(run_folder / STATE)
        raise
    if state.step % settings.validate_every:
        run.validate()
    if settings.patience:
        report(f"step {state.best_step} is the best")
    report(f"judging by {len(held_out)} pictures{f' and {len(weighing)} to weigh on' if weighing else ''}")
    net, _ = polenet.load(run_folder / settings.kept)
    if settings.start and settings.keep_start:
        net = polenet.mixed(net, polenet.load(settings.start)[0], settings.keep_start)
    net = net.to(settings.device)
    info = judged_weights(net, held_out, about, REST, weighing)
    gate, passing = fit_tile_gate(polenet_inference.for_inference(net), gate_pictures(held_out, weighing))
    report(f"{passing:.1%} of the cells pass the tile gate" if gate else "too few poles for a tile gate")
    info = replace(info, tile_gate=gate)
    report(_line(info.figures))
    polenet.save(run_folder / FINAL, net, info)
    return info


def begin(settings: TrainingSettings) -> TrainingState:
    """A network with random weights, or those to start from, before its first step."""
    device = torch.device(settings.device)
    net = polenet.load(settings.start)[0] if settings.start else polenet.PoleNet()
    net = polenet_inference.channels_last(net).to(device).train()
    rate, decay = settings.learning_rate, settings.weight_decay
    optimizer = torch.optim.AdamW(net.parameters(), rate, weight_decay=decay)
    # Half floats of 16 bits overflow without a scale; bfloat16 needs none.
    scaler = torch.amp.GradScaler(device.type, enabled=amp_type(device) == torch.float16)
    return TrainingState(net, optimizer, scaler)


def amp_type(device: torch.device) -> torch.dtype | None:
    """The type of automatic mixed precision that a device computes fast; None for single precision throughout."""
    if device.type == "cuda":
        return torch.bfloat16 if torch.cuda.is_bf16_supported(including_emulation=False) else torch.float16
    return torch.bfloat16 if device.type == "cpu" and polenet_inference.has_fast_bfloat16() else None


@dataclass(frozen=True)
class _Run:
    """Where a training reports to, and where it leaves its weights."""

    state: TrainingState
    few: Sequence[LabelledImage]
    folder: Path
    about: polenet.WeightsInfo
    report: Report
    curves: Curves

    def tell(self, progress: float, means: Losses) -> None:
        """The losses since the last call."""
        self.curves("loss", self.state.step, means)
        shown = " ".join(f"{name} {value:.3g}" for name, value in means.items())
        self.report(f"step {self.state.step} {progress:.0%} {self.state.elapsed_s:.0f} s {shown}")

    def validate(self) -> None:
        """Judges and keeps the mean of the weights, once more where it is the best so far, and the state."""
        info = judged_weights(self.state.mean, self.few, self.about, np.s_[:])  # too few to divide
        self.curves("validation", self.state.step, info.figures)
        self.report(f"step {self.state.step}: {_line(info.figures)}")
        polenet.save(self.folder / LAST, self.state.mean, info)
        if self.state.best_step == 0 or info.figures[JUDGED_BY] > self.state.best:
            self.state.best, self.state.best_step = info.figures[JUDGED_BY], self.state.step
            polenet.save(self.folder / BEST, self.state.mean, info)
        self.state.save(self.folder / STATE)


def _line(figures: Mapping[str, float]) -> str:
    return " ".join(f"{name} {value:.3f}" for name, value in figures.items())


def _set_learning_rate(state: TrainingState, settings: TrainingSettings, progress: float) -> float:
    """Up in a straight line, then down along half a cosine (Loshchilov and Hutter 2017)."""
    warm = min(1.0, (state.step + 1) / settings.warm_up_steps)
    rate = settings.learning_rate * warm * 0.5 * (1 + math.cos(math.pi * progress)) + 1e-5
    for parameters in state.optimizer.param_groups:
        parameters["lr"] = rate
    return rate


def training_step(state: TrainingState, batch: Sequence[Sample], gradient_norm: float) -> Losses:
    """One step of the optimizer; the losses before it."""
    device = next(state.net.parameters()).device
    inputs = polenet_inference.to_input(np.stack([sample.image for sample in batch]), device)
    truth = [torch.from_numpy(np.stack(maps)).to(device) for maps in list(zip(*batch, strict=True))[1:]]
    kind = amp_type(device)
    with torch.autocast(device.type, dtype=kind or torch.float32, enabled=kind is not None):
        outputs = state.net(inputs)
    total, losses = loss(outputs, truth)
    state.optimizer.zero_grad()
    state.scaler.scale(total).backward()  # type: ignore[no-untyped-call]
    state.scaler.unscale_(state.optimizer)
    torch.nn.utils.clip_grad_norm_(state.net.parameters(), gradient_norm)
    state.scaler.step(state.optimizer)
    state.scaler.update()
    return {name: float(value) for name, value in losses.items()}


def _batches(
    sets: Sequence[Sequence[LabelledImage]], settings: TrainingSettings, seed: int, first: int
) -> Iterator[list[Sample]]:
    """Batches for ever from step ``first`` on, made ahead in other threads; the same for the same seed."""

    def make(step: int) -> list[Sample]:
        rng = np.random.default_rng([seed, step])
        sizes = settings.crop_sizes_px(step)
        size = sizes[int(rng.integers(len(sizes)))]
        pasted = rng.random(settings.batch) < settings.pasted
        return [make_sample(draw(rng), size, rng, draw(rng) if paste else None) for paste in pasted]

    def draw(rng: np.random.Generator) -> LabelledImage:
        images = sets[int(rng.integers(len(sets)))]
        return images[int(rng.integers(len(images)))]

    with ThreadPoolExecutor(settings.workers) as pool:
        coming: list[Future[list[Sample]]] = [
            pool.submit(make, first + ahead) for ahead in range(settings.workers)
        ]
        step = first + len(coming)
        while True:
            batch = coming.pop(0).result()
            coming.append(pool.submit(make, step))
            step += 1
            yield batch
