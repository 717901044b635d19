"""Cross-fitted distances: an honest replay of the very drive that the distance model was trained on.

A short drive has no second one to be replayed on. Beside the model of all samples, this holds, for every sample, what
a model predicts that was trained without any sample of its pole. A replay that meets the same box in the same frame
gets that prediction; an instance that was no sample (a false detection, a doubtful label) gets the model of all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.camera import Camera
from scpf.models.distance import DistanceModel, Predictions, TrainedOn
from scpf.models.errors import InputError
from scpf.models.instances import Instance
from scpf.models.observation import Distance

Array = NDArray[np.float64]

SAME_BOX_PX: Final = 0.01


@dataclass(frozen=True, eq=False)
class CrossFittedDistance:
    """The model of all N samples, and each sample's held-out prediction.

    ``stamps_ns`` (N,): UTC ns of the sample's frame; ``boxes_px`` (N, 4): its box x1, x2, y1, y2;
    ``held_out``: the N predictions by models that never saw the sample's pole.
    """

    model: DistanceModel
    stamps_ns: NDArray[np.int64]
    boxes_px: Array
    held_out: Predictions

    def __post_init__(self) -> None:
        n = len(self.stamps_ns)
        if self.boxes_px.shape != (n, 4) or len(self.held_out.mean_m) != n:
            raise InputError(f"cross-fitted distances of {n} stamps, {len(self.boxes_px)} boxes")

    @property
    def trained_on(self) -> TrainedOn:
        """What the model was trained for."""
        return self.model.trained_on

    @property
    def metadata(self) -> dict[str, str]:
        """What the model was trained on, for the record of a result."""
        return {**self.model.metadata, "cross_fitted": "each sample by a model that never saw its pole"}

    @property
    def landmark_classes(self) -> frozenset[str]:
        """The classes whose distance it knows."""
        return self.model.landmark_classes

    def for_frame(self, stamp_ns: int) -> HeldOutDistances:
        """The predictor of the frame at ``stamp_ns`` (UTC ns)."""
        return HeldOutDistances(self, np.flatnonzero(self.stamps_ns == stamp_ns))

    def check_camera(self, camera: Camera) -> None:
        """InputError where ``camera`` is another one than the model was trained for."""
        self.model.check_camera(camera)

    def save(self, path: Path) -> None:
        """Write model and held-out predictions to one .npz file."""
        from scpf.models import distance_file

        distance_file.save(self, path)


@dataclass(frozen=True, eq=False)
class HeldOutDistances:
    """Predicts the instances of one frame; ``rows``: the frame's samples in ``of``."""

    of: CrossFittedDistance
    rows: NDArray[np.intp]

    def predict(
        self, instances: Sequence[Instance], image_width_px: int, image_height_px: int
    ) -> list[Distance | None]:
        """As ``DistanceModel.predict``, with the held-out prediction of every instance that was a sample."""
        predicted = self.of.model.predict(instances, image_width_px, image_height_px)
        boxes = self.of.boxes_px[self.rows]
        for k, instance in enumerate(instances):
            x1, y1, x2, y2 = instance.box_px
            same = np.flatnonzero((np.abs(boxes - (x1, x2, y1, y2)) < SAME_BOX_PX).all(axis=1))
            if len(same):
                predicted[k] = self._distance(int(self.rows[same[0]]))
        return predicted

    def _distance(self, row: int) -> Distance:
        found = self.of.held_out
        expert = self.of.model.names[int(found.expert[row])]
        return Distance(
            float(found.mean_m[row]),
            float(found.variance_m2[row]),
            float(found.function_variance_m2[row]),
            expert,
            bool(found.in_range[row]),
        )
