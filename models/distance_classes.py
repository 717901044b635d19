"""Distances of several landmark classes: each class has its own model, since a sign is no pole."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from scpf.models.camera import Camera
from scpf.models.cross_fitted import CrossFittedDistance
from scpf.models.distance import DistanceModel
from scpf.models.errors import InputError
from scpf.models.instances import Instance
from scpf.models.observation import Distance


class Predictor(Protocol):
    """What predicts the distances of an image's instances."""

    def predict(
        self, instances: Sequence[Instance], image_width_px: int, image_height_px: int
    ) -> list[Distance | None]:
        """A distance for each, or None."""
        ...


@dataclass(frozen=True, eq=False)
class ClassPredictors:
    """A predictor for each landmark class."""

    predictors: Mapping[str, Predictor]

    def predict(
        self, instances: Sequence[Instance], image_width_px: int, image_height_px: int
    ) -> list[Distance | None]:
        """As ``DistanceModel.predict``, each instance by its class' predictor; None for a class without one."""
        found: list[Distance | None] = [None] * len(instances)
        for name, predictor in self.predictors.items():
            mine = [k for k, instance in enumerate(instances) if instance.landmark_class == name]
            chosen = predictor.predict([instances[k] for k in mine], image_width_px, image_height_px)
            for k, distance in zip(mine, chosen, strict=True):
                found[k] = distance
        return found


@dataclass(frozen=True, eq=False)
class DistanceByClass:
    """Models by landmark class, at least one, each trained for the class that it is listed under."""

    models: Mapping[str, DistanceModel | CrossFittedDistance]

    def __post_init__(self) -> None:
        wrong = [name for name, each in self.models.items() if each.trained_on.landmark_class != name]
        if wrong or not self.models:
            raise InputError(f"distance models by class: none, or one of another class under {wrong}")

    @property
    def metadata(self) -> dict[str, str]:
        """What each model was trained on, its class before each key."""
        return {
            f"{name}: {key}": value
            for name, model in self.models.items()
            for key, value in model.metadata.items()
        }

    def predict(
        self, instances: Sequence[Instance], image_width_px: int, image_height_px: int
    ) -> list[Distance | None]:
        """As ``ClassPredictors.predict``, by models that know every sample."""
        known = {
            name: model.model if isinstance(model, CrossFittedDistance) else model
            for name, model in self.models.items()
        }
        return ClassPredictors(known).predict(instances, image_width_px, image_height_px)

    @property
    def landmark_classes(self) -> frozenset[str]:
        """The classes whose distance it knows."""
        return frozenset(self.models)

    def for_frame(self, stamp_ns: int) -> ClassPredictors:
        """The predictors of the frame at ``stamp_ns`` (UTC ns)."""
        return ClassPredictors({name: each.for_frame(stamp_ns) for name, each in self.models.items()})

    def check_camera(self, camera: Camera) -> None:
        """InputError where ``camera`` is another one than a model was trained for."""
        for model in self.models.values():
            model.check_camera(camera)

    def save(self, path: Path) -> None:
        """Write all models to one .npz file."""
        from scpf.models import distance_file

        distance_file.save(self, path)
