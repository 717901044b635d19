"""How good a segmenter is on labelled pictures: what it finds and how well it outlines, by distance and visibility."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from scpf.models.coco_figures import CocoFigures, JudgedPicture
from scpf.models.detection_matching import WIDENING_SHARE, Match, match
from scpf.models.instances import Segmenter
from scpf.models.labelled_images import LabelledImage, LabelledObject, Picture
from scpf.models.mask_features import thickness_px

DISTANCE_EDGES_M = (0.0, 12.0, 24.0, 36.0, 48.0, 60.0, 1000.0)
VISIBLE_EDGES = (0.0, 0.25, 0.5, 0.75, 0.9, 1.01)
SCORE_EDGES = (0.1, 0.3, 0.5, 0.7, 0.9, 1.01)


@dataclass(frozen=True)
class EvaluationSettings:
    """What is asked. A pole that is further away, hidden more, or lower than this (a share of the picture's height)
    need not be found: whether it is does not count."""

    threshold: float = 0.9
    max_distance_m: float = 48.0
    least_visible: float = 0.25
    least_height_share: float = 0.03

    def judges(self, labelled: LabelledObject, height_px: int) -> bool:
        """Whether the object has to be found; what the labels do not say is no reason against it."""
        return (
            not labelled.ignored
            and (labelled.distance_m is None or labelled.distance_m <= self.max_distance_m)
            and (labelled.visible_fraction is None or labelled.visible_fraction >= self.least_visible)
            and labelled.instance.height_px >= self.least_height_share * height_px
        )


class Judged(NamedTuple):
    """A picture's matches and its objects, with whether each has to be found."""

    path: Path
    matches: list[Match]
    objects: list[LabelledObject]
    judged: list[bool]


@dataclass(frozen=True)
class Evaluation:
    """``pictures`` in their order; ``coco``: the figures of `CocoFigures`."""

    settings: EvaluationSettings
    pictures: list[Judged]
    coco: dict[str, float]

    def document(self) -> dict[str, Any]:
        """Every figure, as JSON holds it: None for one that nothing was there for."""
        shown = [
            (picture, each)
            for picture in self.pictures
            for each in picture.matches
            if each.counts and each.detection.score >= self.settings.threshold
        ]
        wanted = sum(sum(picture.judged) for picture in self.pictures)
        found = [(picture, each) for picture, each in shown if each.shows is not None]
        outlined = [pair for pair in found if pair[1].outlined]
        errors = np.array([_thickness_error_px(*pair) for pair in found], dtype=np.float64)
        errors = errors[np.isfinite(errors)]
        figures = {
            **self.coco,
            "precision": _share(len(found), len(shown)),
            "recall": _share(len(found), wanted),
            "outlined_precision": _share(len(outlined), len(shown)),
            "outlined_recall": _share(len(outlined), wanted),
            "mask_iou_median": float(np.median([each.overlap for _, each in found])) if found else np.nan,
            "thickness_error_median_px": float(np.median(np.abs(errors))) if len(errors) else np.nan,
            "thickness_bias_px": float(np.median(errors)) if len(errors) else np.nan,
        }
        return {
            "settings": asdict(self.settings),
            "pictures": len(self.pictures),
            "poles": wanted,
            "detections": len(shown),
            "figures": {name: _finite(value) for name, value in figures.items()},
            "by_distance_m": self._by("distance_m", DISTANCE_EDGES_M, found),
            "by_visible_fraction": self._by("visible_fraction", VISIBLE_EDGES, found),
            "score_means": self._reliability(),
            "false_positives": [_named(picture, each) for picture, each in shown if each.shows is None],
            "missed": [_missed(picture, k) for picture in self.pictures for k in self._missed(picture)],
        }

    def _missed(self, picture: Judged) -> list[int]:
        found = {m.shows for m in picture.matches if m.detection.score >= self.settings.threshold}
        return [k for k, judged in enumerate(picture.judged) if judged and k not in found]

    def _by(
        self, what: str, edges: Sequence[float], found: Sequence[tuple[Judged, Match]]
    ) -> list[dict[str, Any]]:
        """Recall and thickness error of the poles whose labels say ``what``, between edges."""
        rows = []
        for low, high in pairwise(edges):

            def within(labelled: LabelledObject, low: float = low, high: float = high) -> bool:
                value = getattr(labelled, what)
                return value is not None and low <= value < high

            wanted = sum(
                judged and within(labelled)
                for picture in self.pictures
                for labelled, judged in zip(picture.objects, picture.judged, strict=True)
            )
            if not wanted:
                continue
            pairs = [(p, m) for p, m in found if m.shows is not None and within(p.objects[m.shows])]
            errors = np.array([_thickness_error_px(*pair) for pair in pairs], dtype=np.float64)
            errors = np.abs(errors[np.isfinite(errors)])
            rows.append(
                {
                    "from": low,
                    "to": high,
                    "poles": wanted,
                    "recall": len(pairs) / wanted,
                    "outlined_recall": sum(m.outlined for _, m in pairs) / wanted,
                    "thickness_error_median_px": float(np.median(errors)) if len(errors) else None,
                }
            )
        return rows

    def _reliability(self) -> list[dict[str, Any]]:
        """For detections of about one score: how many, their mean score, and the share that shows a pole."""
        counting = [each for picture in self.pictures for each in picture.matches if each.counts]
        rows = []
        for low, high in pairwise(SCORE_EDGES):
            here = [each for each in counting if low <= each.detection.score < high]
            if here:
                mean = float(np.mean([each.detection.score for each in here]))
                right = sum(each.shows is not None for each in here) / len(here)
                rows.append({"from": low, "to": min(high, 1.0), "detections": len(here), "mean_score": mean,
                             "share_right": right})  # fmt: skip
        return rows


def evaluate(
    segment: Segmenter,
    images: Iterable[LabelledImage],
    settings: EvaluationSettings,
    progress: Callable[[int, Judged, Picture], None] = lambda done, judged, picture: None,
) -> Evaluation:
    """Runs ``segment`` over pictures and compares; it should give low scores, too, for the average precision.

    ``progress`` is called after each picture. Raises MissingError where faster-coco-eval is not installed, and what
    reading the pictures raises.
    """
    coco = CocoFigures()
    pictures = []
    for done, source in enumerate(images, 1):
        picture = source.read()
        height, width = picture.image.shape[:2]
        detections = segment(picture.image)
        judged = [settings.judges(labelled, height) for labelled in picture.objects]
        widening = max(1, round(WIDENING_SHARE * max(height, width)))
        matches = match(detections, picture.objects, judged, widening)
        instances = [labelled.instance for labelled in picture.objects]
        coco.add(JudgedPicture((width, height), detections, instances, [not each for each in judged]))
        pictures.append(Judged(source.path, matches, picture.objects, judged))
        progress(done, pictures[-1], picture)
    return Evaluation(settings, pictures, coco.figures())


def _thickness_error_px(picture: Judged, found: Match) -> float:
    assert found.shows is not None
    return thickness_px(found.detection) - thickness_px(picture.objects[found.shows].instance)


def _share(part: int, whole: int) -> float:
    return part / whole if whole else float("nan")


def _finite(value: float) -> float | None:
    return float(value) if isfinite(value) else None


def _named(picture: Judged, each: Match) -> dict[str, Any]:
    box = [round(value, 1) for value in each.detection.box_px]
    return {"picture": str(picture.path), "box_px": box, "score": round(each.detection.score, 4)}


def _missed(picture: Judged, index: int) -> dict[str, Any]:
    labelled = picture.objects[index]
    return {
        "picture": str(picture.path),
        "box_px": list(labelled.instance.box_px),
        "distance_m": labelled.distance_m,
        "visible_fraction": labelled.visible_fraction,
    }
