"""A training that can be interrupted: its network and optimizer, how far it came, and the file that holds them.

What is judged and kept is not the network of the last step but the running mean of its weights (Polyak and Juditsky
1992), which swings less from step to step, on pictures unlike the training's most of all.
"""

from __future__ import annotations

import copy
import pickle
from dataclasses import dataclass, field
from pathlib import Path

import torch

from scpf.models.errors import DamagedError, MissingError
from scpf.models.polenet import PoleNet
from scpf.models.whole_files import whole

MEAN_OVER_STEPS = 500  # with which the weights' running mean forgets; at the first steps it forgets faster


@dataclass
class TrainingState:
    """``mean``: with the running mean of the weights of ``net`` and of its batch norms' statistics.

    ``step``: of the optimizer, taken so far; ``best``: the best validation's figure, of ``best_step`` (0: none).
    """

    net: PoleNet
    optimizer: torch.optim.Optimizer
    scaler: torch.amp.GradScaler
    mean: PoleNet = field(init=False)
    step: int = 0
    best: float = 0.0
    best_step: int = 0
    elapsed_s: float = 0.0

    def __post_init__(self) -> None:
        self.mean = copy.deepcopy(self.net)

    @torch.no_grad()
    def stepped(self) -> None:
        """Counts a step of the optimizer, and takes its weights into the mean."""
        self.step += 1
        share = max(1 / MEAN_OVER_STEPS, 9 / (10 + self.step))
        weights = self.net.state_dict()
        for name, mean in self.mean.state_dict().items():
            if mean.is_floating_point():
                mean.lerp_(weights[name], share)

    def save(self, path: Path) -> None:
        """Writes the file, whole or not at all."""
        content = {
            "net": self.net.state_dict(),
            "mean": self.mean.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "scaler": self.scaler.state_dict(),
            "progress": [self.step, self.best, self.best_step, self.elapsed_s],
        }
        with whole(path) as partial:
            torch.save(content, partial)

    def restore(self, path: Path, device: torch.device) -> None:
        """Takes up what a file holds; raises MissingError and DamagedError. Code in it is not run."""
        if not path.is_file():
            raise MissingError(f"{path}: no state to go on from", "train without --resume")
        try:
            content = torch.load(path, map_location=device, weights_only=True)
            self.net.load_state_dict(content["net"])
            self.mean.load_state_dict(content["mean"])
            self.optimizer.load_state_dict(content["optimizer"])
            self.scaler.load_state_dict(content["scaler"])
            step, best, best_step, elapsed_s = content["progress"]
            self.step, self.best, self.best_step = int(step), float(best), int(best_step)
            self.elapsed_s = float(elapsed_s)
        except (RuntimeError, pickle.UnpicklingError, EOFError, KeyError, TypeError, ValueError) as error:
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise DamagedError(f"{path}: not the state of such a training ({reason})") from error
