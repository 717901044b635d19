"""Where torch computes, by name: cpu, cuda, mps, or the fastest that is there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from scpf.models.errors import MissingError

if TYPE_CHECKING:
    import torch

DeviceName = Literal["auto", "cpu", "cuda", "mps"]


def choose(name: DeviceName = "auto") -> torch.device:
    """The device of a name; ``auto`` is CUDA, else Apple's MPS, else the CPU. MissingError where it is not there."""
    import torch

    there = {"cuda": torch.cuda.is_available(), "mps": torch.backends.mps.is_available(), "cpu": True}
    if name == "auto":
        return torch.device(next(each for each, found in there.items() if found))
    if not there[name]:
        raise MissingError(
            f"torch finds no {name} device here", "use --device auto, or another build of torch"
        )
    return torch.device(name)
