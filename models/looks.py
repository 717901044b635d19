"""Several looks at one picture: PoleNet at three sizes of it, whose scores become one.

Test-time augmentation. A lamp post is one at any size, while what looks like it by chance often does so at one size
alone; and what is thin shows where the picture is larger. It takes three and a half times the time of a single look.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from scpf.models.detection_matching import shared_px
from scpf.models.grouping import expit, logit
from scpf.models.instances import Image, Instance
from scpf.models.segmentation import DEFAULT_THRESHOLD, PoleNetSegmenter, load_polenet

if TYPE_CHECKING:
    from scpf.models.polenet import WeightsInfo

ZOOMS: Final = (1.0, 0.9, 1.25)  # chosen on painted scenes: docs/MODELS.md
LEAST_SCORE: Final = 0.02  # of a look; what is less sure tells nothing
UNSEEN: Final = 0.01  # the score of a look that has not found what another has
LEAST_SHARED: Final = 0.4  # of the smaller mask: two looks have found the same


class ThoroughSegmenter:
    """Finds light poles in an image (H, W, 3), uint8, RGB; best score first.

    An instance's mask is that of the first look, in the order of `ZOOMS`, that has found it.
    """

    def __init__(self, look: PoleNetSegmenter, threshold: float = DEFAULT_THRESHOLD) -> None:
        """``look``: with a threshold of `LEAST_SCORE`."""
        self.info: WeightsInfo = look.info
        self.threshold = threshold
        self._look = look

    def __call__(self, image: Image) -> list[Instance]:
        """Instances with a score of at least the threshold, masks at the resolution of ``image``."""
        found = together([self._look.batch([image], zoom)[0] for zoom in ZOOMS])
        return [each for each in found if each.score >= self.threshold]


def together(looks: Sequence[Sequence[Instance]]) -> list[Instance]:
    """The instances of all looks, best score first; the log-odds of a score are the mean of those of the looks."""
    found: list[Instance] = []
    for first, look in enumerate(looks):
        for each in look:
            others = [_same_as(each, other) for k, other in enumerate(looks) if k != first]
            if any(earlier is not None for earlier in others[:first]):
                continue
            scores = [each.score, *(UNSEEN if other is None else other.score for other in others)]
            found.append(replace(each, score=expit(float(np.mean([logit(score) for score in scores])))))
    return sorted(found, key=lambda each: -each.score)


def _same_as(instance: Instance, look: Sequence[Instance]) -> Instance | None:
    """What a look has found there."""
    size = int(instance.mask.sum())
    shares = [shared_px(instance, each) / max(1, min(size, int(each.mask.sum()))) for each in look]
    if not shares or max(shares) < LEAST_SHARED:
        return None
    return look[shares.index(max(shares))]


def load(
    path: Path | None = None, *, threshold: float = DEFAULT_THRESHOLD, **options: Any
) -> ThoroughSegmenter:
    """With the options of `segmentation.load_polenet`."""
    return ThoroughSegmenter(load_polenet(path, threshold=LEAST_SCORE, **options), threshold)
