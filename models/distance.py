"""Distance of a segmented landmark: a mixture of Gaussian process experts behind a gate, as in the paper.

A close pole has lost its lamp at the image's upper edge and its mask is wide; a far one shows the lamp and
is a few pixels thick. The gate, a Gaussian mixture on (box width / height, thickness), says which expert
answers: the one with the highest posterior. There may be more experts than two, or a single one. Distances
are horizontal, from the body's origin to the landmark's mapped foot.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scpf.models.camera import Camera
from scpf.models.distance_gate import GATE_FEATURES, Gate, expert_names
from scpf.models.errors import InputError
from scpf.models.features import UNSCALED, Features, measure
from scpf.models.gaussian_process import GaussianProcess
from scpf.models.instances import Instance
from scpf.models.observation import Distance

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class TrainedOn:
    """What a model was trained for: landmark class, image size (px), camera matrix (3, 3), and ``notes``."""

    landmark_class: str
    image_width_px: int
    image_height_px: int
    camera_matrix: Array
    notes: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Predictions:
    """Predicted distances of N instances: ``mean_m``, both variances (m²), index of the expert,
    ``in_range``: (N,).

    NaN where an instance is too small.
    """

    mean_m: Array
    variance_m2: Array
    function_variance_m2: Array
    expert: Indices
    in_range: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class DistanceModel:
    """A trained mixture of experts. ``gate`` is None where one expert, "single", answers for all.

    ``inputs``: names of the features of each expert; it runs in parallel with ``experts``.
    """

    gate: Gate | None
    experts: tuple[GaussianProcess, ...]
    inputs: tuple[tuple[str, ...], ...]
    trained_on: TrainedOn

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the experts."""
        return expert_names(len(self.experts))

    @cached_property
    def features(self) -> tuple[str, ...]:
        """Names of the features that gate and experts look at."""
        gate = GATE_FEATURES if self.gate is not None else ()
        return tuple(dict.fromkeys(name for names in (gate, *self.inputs) for name in names))

    def predict(
        self, instances: Sequence[Instance], image_width_px: int, image_height_px: int
    ) -> list[Distance | None]:
        """The distance of each instance in an image of this size; None for one too small, or of another class.

        An image of another size but the same shape counts as a scaled one. Raises InputError for another
        shape.
        """
        if not instances:
            return []
        measured = measure(instances, image_width_px, image_height_px, self.features)
        found = self.predict_features(self._scaled(measured, image_width_px, image_height_px))
        names, known = self.names, self.trained_on.landmark_class
        columns = (found.mean_m, found.variance_m2, found.function_variance_m2, found.expert, found.in_range)
        rows = zip(*(each.tolist() for each in columns), strict=True)
        return [
            None
            if small or instance.landmark_class != known
            else Distance(mean, variance, function, names[expert], inside)
            for instance, small, (mean, variance, function, expert, inside) in zip(
                instances, measured.too_small.tolist(), rows, strict=True
            )
        ]

    def predict_features(self, features: Features) -> Predictions:
        """Predictions for features that were measured in images of the training size."""
        found = np.full((4, len(features)), np.nan)
        found[3] = 0.0
        experts = self.choose(features)
        chosen = np.where(features.too_small, -1, experts)
        for k, (expert, names) in enumerate(zip(self.experts, self.inputs, strict=True)):
            mine = (chosen == k).nonzero()[0]
            if len(mine):
                found[:, mine] = expert.answer(features.columns(names)[mine])
        mean, variance, function, inside = found
        return Predictions(mean, variance, function, experts, inside > 0.0)

    def choose(self, features: Features) -> Indices:
        """Index (N,) of the expert that answers for each row of features."""
        return np.zeros(len(features), dtype=np.intp) if self.gate is None else self.gate.experts(features)

    @property
    def metadata(self) -> dict[str, str]:
        """What the model was trained on, for the record of a result."""
        about = self.trained_on
        size = f"{about.image_width_px}×{about.image_height_px}"
        experts = {
            f"{name} expert": " ".join(used) for name, used in zip(self.names, self.inputs, strict=True)
        }
        powers = {
            f"{name} learns": f"distance^{expert.warp.power:g}"
            for name, expert in zip(self.names, self.experts, strict=True)
            if expert.warp is not None
        }
        return {"landmark_class": about.landmark_class, "image_px": size, **experts, **powers, **about.notes}

    @property
    def landmark_classes(self) -> frozenset[str]:
        """The classes whose distance it knows."""
        return frozenset({self.trained_on.landmark_class})

    def for_frame(self, stamp_ns: int) -> DistanceModel:
        """The model that answers at a time (UTC ns): itself; ``CrossFittedDistance`` holds several."""
        return self

    def check_camera(self, camera: Camera) -> None:
        """InputError where ``camera`` is another one than the model was trained for: distances would be
        wrong.
        """
        scale = self._scale(camera.width_px, camera.height_px)
        mine, its = self.trained_on.camera_matrix, camera.matrix * scale
        off = np.abs((mine - its)[[0, 1, 0, 1], [0, 1, 2, 2]])
        if (off > 0.02 * mine[0, 0]).any():
            raise InputError(
                f"the distance model knows a focal length of {mine[0, 0]:.0f} px and a centre of "
                f"({mine[0, 2]:.0f}, {mine[1, 2]:.0f}); this camera has {its[0, 0]:.0f} and "
                f"({its[0, 2]:.0f}, {its[1, 2]:.0f})",
                "train a distance model on a log of this camera",
            )

    def save(self, path: Path) -> None:
        """Write the model to one .npz file."""
        from scpf.models import distance_file

        distance_file.save(self, path)

    @classmethod
    def load(cls, path: Path) -> DistanceModel:
        """Read a model back; its predictions are bit-equal. Errors: ``distance_file.load``."""
        from scpf.models import distance_file

        model = distance_file.load(path)
        if not isinstance(model, cls):
            raise InputError(
                f"{path}: holds cross-fitted models, or several classes", "read it with distance_file.load"
            )
        return model

    def _scale(self, width_px: int, height_px: int) -> float:
        wide = self.trained_on.image_width_px / width_px
        high = self.trained_on.image_height_px / height_px
        if abs(wide / high - 1.0) > 0.01:
            raise InputError(
                f"the distance model was trained on images of {self.trained_on.image_width_px}×"
                f"{self.trained_on.image_height_px} px; these have {width_px}×{height_px}",
                "train a distance model on a log of this camera",
            )
        return wide

    def _scaled(self, features: Features, width_px: int, height_px: int) -> Features:
        scale = self._scale(width_px, height_px)
        if scale == 1.0:
            return features
        factors = np.array([1.0 if name in UNSCALED else scale for name in features.names])
        return replace(features, values=features.values * factors)
