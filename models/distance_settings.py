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

    ``experts``: how many share the distances, at most; 1 for a single one. ``far``: features of the expert for
    the farthest; ``close``: those of all others, and of a single one (names in ``features.FEATURES``).
    ``restarts``: further starts of the hyperparameter search. ``max_samples``: an expert with more keeps a
    random choice of that many, since cost and file grow with their square; the hyperparameters are sought on
    at most ``max_search_samples`` of them. ``warped``: an expert learns the power of the distance that is
    likeliest (`warp`), so that its bands grow with the distance as errors do.
    """

    close: tuple[str, ...] = (*BOX, "thickness")
    far: tuple[str, ...] = BOX
    experts: int = 2
    restarts: int = 2
    max_samples: int = 500
    max_search_samples: int = 300
    warped: bool = False

    def inputs(self, experts: int) -> tuple[tuple[str, ...], ...]:
        """Names of the features of each of so many experts, from the closest to the farthest."""
        return (self.close,) if experts == 1 else (*(self.close,) * (experts - 1), self.far)

    @property
    def features(self) -> tuple[str, ...]:
        """Names of the features that the gate and the experts look at."""
        gate = GATE_FEATURES if self.experts > 1 else ()
        experts = self.inputs(self.experts)
        return tuple(dict.fromkeys(name for names in (gate, *experts) for name in names))


AXIS: Final = ("mean_width", "base_row", "axis_length")

PRESETS: Final[Mapping[str, DistanceSettings]] = MappingProxyType(
    {
        "paper": DistanceSettings(),
        # The best that was measured (docs/DISTANCES.md): the width over the whole pole says more than that in its
        # middle, where it ends says how far it stands, and for a thick one the taper helps to tell that apart.
        "default": DistanceSettings(
            close=(*BOX, *AXIS, "width_35", "width_85"),
            far=(*BOX, *AXIS),
            warped=True,
        ),
    }
)
