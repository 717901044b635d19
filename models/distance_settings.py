"""How a distance model is trained: settings and presets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from scpf.models.distance_gate import GATE_FEATURES
from scpf.models.features import BOX


@dataclass(frozen=True)
class DistanceSettings:
    """How a distance model is trained.

    ``close``, ``far``: features of each expert (names in ``features.FEATURES``). ``restarts``: further
    starts of the hyperparameter search. ``max_samples``: an expert with more keeps a random choice of that
    many, since cost and file grow with their square; the hyperparameters are sought on at most
    ``max_search_samples`` of them.
    """

    close: tuple[str, ...] = (*BOX, "thickness")
    far: tuple[str, ...] = BOX
    restarts: int = 2
    max_samples: int = 500
    max_search_samples: int = 300

    @property
    def features(self) -> tuple[str, ...]:
        """Names of the features that the gate and the experts look at."""
        return tuple(dict.fromkeys((*GATE_FEATURES, *self.close, *self.far)))


PRESETS: Final[Mapping[str, DistanceSettings]] = MappingProxyType(
    {
        "paper": DistanceSettings(),
        # The far expert sees the thickness, too: better on simulated features, no better on rendered drives.
        "thickness": DistanceSettings(far=(*BOX, "thickness")),
    }
)
