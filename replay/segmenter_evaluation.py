"""``scpf train segmenter --evaluate``: how good weights are on labelled pictures, as a table, JSON and pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from scpf.ingest.labelled_folders import labelled_images
from scpf.models.coco_figures import CocoFigures
from scpf.models.detection_matching import Match
from scpf.models.errors import InputError, UsageError
from scpf.models.labelled_images import LabelledImage, Picture
from scpf.models.polygons import outlines
from scpf.models.segmentation import THOROUGH_WITH, load
from scpf.models.segmentation_evaluation import EvaluationSettings, Judged, evaluate
from scpf.replay.segmenter_data import told

LEAST_SCORE = 0.05
"""The average precision asks for doubtful detections, too."""

FALSE_COLOUR, TRUE_COLOUR = (255, 60, 40), (60, 220, 90)  # RGB
_MARGIN_PX = 80


def evaluate_segmenter(
    segmenter: str,
    data: Sequence[Path],
    classes: Sequence[str],
    settings: EvaluationSettings,
    pictures: Path | None,
    say: Callable[[str], None],
) -> dict[str, Any]:
    """Every figure of ``segmenter`` on the labelled pictures of ``data``; false positives drawn into ``pictures``.

    Raises UsageError where there is nothing to judge by, InputError where the folder holds files already, and what
    loading and reading raise.
    """
    if not data:
        raise UsageError("nothing to evaluate on", "name folders of labelled pictures, or COCO files")
    if pictures is not None and pictures.exists() and any(pictures.iterdir()):
        raise InputError(f"{pictures}: is not empty", "name a new folder for the pictures")
    CocoFigures()  # before the long work, not after it
    images: list[LabelledImage] = [image for path in data for image in labelled_images(path, classes)]
    segment = load(segmenter, threshold=LEAST_SCORE)

    def draw(done: int, judged: Judged, picture: Picture) -> None:
        if pictures is not None:
            _draw(pictures, done, judged, picture, settings.threshold)

    document = evaluate(segment, told(images, say), settings, draw).document()
    prefix = THOROUGH_WITH if segmenter.startswith(THOROUGH_WITH) else ""
    return {"segmenter": prefix + Path(segmenter).name, "data": [str(path) for path in data], **document}


def _draw(folder: Path, number: int, judged: Judged, picture: Picture, threshold: float) -> None:
    """A crop around each false positive: it in red, what is labelled in green."""
    for k, each in enumerate(judged.matches):
        if not each.counts or each.shows is not None or each.detection.score < threshold:
            continue
        folder.mkdir(parents=True, exist_ok=True)
        drawn = picture.image.copy()
        for labelled in judged.objects:
            _outline(drawn, labelled.instance.mask, labelled.instance.offset_px, TRUE_COLOUR)
        _outline(drawn, each.detection.mask, each.detection.offset_px, FALSE_COLOUR)
        name = f"{number:05d}_{judged.path.stem}_{k}_{each.detection.score:.2f}.jpg"
        cv2.imwrite(str(folder / name), _around(drawn, each)[:, :, ::-1])


def _outline(
    image: np.ndarray[Any, np.dtype[np.uint8]],
    mask: np.ndarray[Any, np.dtype[np.bool_]],
    offset_px: tuple[int, int],
    colour: tuple[int, int, int],
) -> None:
    lines = [np.round(points - 0.5).astype(np.int32) for points in outlines(mask, offset_px)]
    cv2.polylines(image, lines, True, colour, 1)


def _around(image: np.ndarray[Any, np.dtype[np.uint8]], each: Match) -> np.ndarray[Any, np.dtype[np.uint8]]:
    x1, y1, x2, y2 = (int(value) for value in each.detection.box_px)
    top, left = max(0, y1 - _MARGIN_PX), max(0, x1 - _MARGIN_PX)
    return image[top : y2 + _MARGIN_PX, left : x2 + _MARGIN_PX]


def table(document: Mapping[str, Any]) -> str:
    """The figures as text."""
    settings, figures = document["settings"], document["figures"]
    lines = [
        f"{document['segmenter']} on {document['pictures']} pictures with {document['poles']} poles to be found "
        f"(up to {settings['max_distance_m']:g} m, {settings['least_visible']:.0%} visible); "
        f"{document['detections']} detections at {settings['threshold']:g}",
        "",
    ]
    lines += [f"{name:<28} {_text(value):>8}" for name, value in figures.items()]
    for key, title in (("by_distance_m", "distance (m)"), ("by_visible_fraction", "visible share")):
        if document[key]:
            lines += [
                "",
                f"{title:<16} {'poles':>6} {'recall':>8} {'outlined':>9} {'thickness error (px)':>21}",
            ]
        for row in document[key]:
            span = f"{row['from']:g} to {min(row['to'], 1.0) if key != 'by_distance_m' else row['to']:g}"
            error = _text(row["thickness_error_median_px"])
            lines.append(
                f"{span:<16} {row['poles']:>6} {row['recall']:>8.3f} {row['outlined_recall']:>9.3f} {error:>21}"
            )
    if document["score_means"]:
        lines += ["", f"{'score':<16} {'number':>6} {'mean':>8} {'right':>9}"]
    for row in document["score_means"]:
        span = f"{row['from']:g} to {row['to']:g}"
        lines.append(
            f"{span:<16} {row['detections']:>6} {row['mean_score']:>8.3f} {row['share_right']:>9.3f}"
        )
    lines += ["", f"{len(document['missed'])} missed, {len(document['false_positives'])} false:"]
    for each in document["false_positives"]:
        lines.append(f"  {each['score']:.3f} {each['picture']} {each['box_px']}")
    return "\n".join(lines)


def _text(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
