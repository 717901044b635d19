"""Cross-fitted distances: an honest replay of the very drive that the distance model was trained on.

A short drive has no second one to be replayed on. It is cut into stretches of time; for each stretch there
is a model that was trained without any sample, of the whole drive, of the poles that are seen in it. A
replay that asks ``for_frame`` before it predicts never gets a distance from a model that knows the pole,
whether or not anyone has said which pole it is, and a false detection is treated like any other.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scpf.models.camera import Camera
from scpf.models.distance import DistanceModel, TrainedOn
from scpf.models.errors import InputError


@dataclass(frozen=True, eq=False)
class CrossFittedDistance:
    """One model a stretch. ``starts_ns`` (K,): where each stretch begins (UTC ns), increasing; the first
    begins, and the last ends, with no limit. ``held_out``: the poles that each model has not seen.
    """

    folds: tuple[DistanceModel, ...]
    starts_ns: NDArray[np.int64]
    held_out: tuple[frozenset[str], ...]

    def __post_init__(self) -> None:
        if not self.folds or not len(self.folds) == len(self.starts_ns) == len(self.held_out):
            raise InputError("cross-fitted distances need one model, start and set of poles for each stretch")
        if (np.diff(self.starts_ns) <= 0).any():
            raise InputError("the stretches of a cross-fitted model must follow each other")

    @property
    def trained_on(self) -> TrainedOn:
        """What the models were trained for: the first one's."""
        return self.folds[0].trained_on

    @property
    def metadata(self) -> dict[str, str]:
        """What the models were trained on, for the record of a result."""
        stretches = f"{len(self.folds)} stretches of time, by a model each that knows none of its poles"
        return {**self.folds[0].metadata, "cross_fitted": stretches}

    def for_frame(self, stamp_ns: int) -> DistanceModel:
        """The model that has seen none of the poles of the frame at ``stamp_ns`` (UTC ns)."""
        return self.folds[self.fold_at(stamp_ns)]

    def fold_at(self, stamp_ns: int) -> int:
        """Index of the stretch at ``stamp_ns`` (UTC ns)."""
        return max(int(np.searchsorted(self.starts_ns, stamp_ns, side="right")) - 1, 0)

    def check_camera(self, camera: Camera) -> None:
        """InputError where ``camera`` is another one than the models were trained for."""
        self.folds[0].check_camera(camera)

    def save(self, path: Path) -> None:
        """Write all models to one .npz file."""
        from scpf.models import distance_file

        distance_file.save(self, path)
