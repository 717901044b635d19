"""How good PoleNet is on labelled images, and the calibration of its score.

Two questions are kept apart. Is it a light pole, and that one (*detection*)? And does its mask overlap the true one
by half (precision and recall as elsewhere)? A mask that is one pixel too wide on either side of a pole of two pixels
fails the second and not the first; the score is the probability of the first.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from scipy import ndimage

from scpf.models.grouping import Candidate, ScoreCalibration, group
from scpf.models.labelled_images import IGNORED_ID, Ids, LabelledImage
from scpf.models.logistic import logistic
from scpf.models.polenet import NOT_CALIBRATED, PoleNet, WeightsInfo
from scpf.models.polenet_inference import for_inference, maps
from scpf.models.segmentation import frame

LEAST_OVERLAP = 0.5  # intersection over union of the masks that counts as found
WIDENING_PX = 2  # a detection lies mostly on the true mask when that is so much wider on either side,
LEAST_ON_POLE = 0.6  # with this share of its pixels,
LEAST_HEIGHT_OVERLAP = 0.5  # and their heights overlap so much (intersection over union)
SMALL_HEIGHT_PX, SMALL_AREA_PX = 48, 120  # smaller ones may be missed or found, neither counts
THRESHOLDS = (0.5, 0.7, 0.9)
FITTED, REST = np.s_[0::2], np.s_[1::2]
"""The images that a score is fitted to, and those that it is judged by."""


class Verdict(NamedTuple):
    """A candidate and what it turned out to be.

    ``detected``: it shows a light pole; ``overlap``: of the masks, 0 where nothing is; ``counts``: not a small one.
    """

    candidate: Candidate
    detected: bool
    overlap: float
    counts: bool
    thickness_error_px: float


@dataclass(frozen=True)
class JudgedImage:
    """Verdicts of one image, the number of poles in it that count, and the pixels of all its poles."""

    verdicts: list[Verdict]
    poles: int
    shared_px: int
    either_px: int


class Judgement(NamedTuple):
    """All images of a validation."""

    images: list[JudgedImage]

    def verdicts(self, part: slice = slice(None)) -> list[Verdict]:
        """Those of a part of the images, in their order."""
        return [verdict for image in self.images[part] for verdict in image.verdicts]

    def fit_calibration(self, part: slice = slice(None)) -> ScoreCalibration:
        """Logistic regression of "is a light pole" on the evidence."""
        evidence, right = self._evidence(part)
        return ScoreCalibration.of(logistic(evidence, right)) if len(right) else NOT_CALIBRATED

    def calibration(self, weighed: Judgement, part: slice = slice(None)) -> ScoreCalibration:
        """Fitted to a part of the images; its evidence weighed on others, where there are any."""
        if weighed.images:
            return self.fit_scale(weighed.fit_calibration(), part)
        return self.fit_calibration(part)

    def fit_scale(self, weighed: ScoreCalibration, part: slice = slice(None)) -> ScoreCalibration:
        """The evidence ``weighed`` as it is, with slope and constant fitted, so that the order of the scores stays."""
        evidence, right = self._evidence(part)
        if not len(right):
            return weighed
        constant = evidence[:, -1]
        slope, offset = logistic(np.stack([evidence @ weighed.weights, constant], axis=1), right)
        weights = weighed.weights * slope
        weights[-1] += offset
        return ScoreCalibration.of(weights)

    def _evidence(self, part: slice) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Of every candidate (N, 6), and whether it is right (N,), 0 or 1."""
        verdicts = self.verdicts(part)
        evidence = np.array([v.candidate.evidence for v in verdicts])
        return evidence, np.array([v.detected for v in verdicts], dtype=np.float64)

    def figures(self, calibration: ScoreCalibration, part: slice = slice(None)) -> dict[str, float]:
        """Pixel IoU, mask AP50; detection, precision, recall and mask IoU at each of `THRESHOLDS` of the score."""
        images = self.images[part]
        found = {"pixel_iou": sum(i.shared_px for i in images) / max(1, sum(i.either_px for i in images))}
        poles = sum(image.poles for image in images)
        verdicts = self.verdicts(part)
        scores = np.array([calibration.probability(v.candidate) for v in verdicts])
        overlaps = np.array([v.overlap for v in verdicts])
        detected = np.array([v.detected for v in verdicts], dtype=bool)
        counting = np.array([v.counts for v in verdicts], dtype=bool)
        errors = np.array([v.thickness_error_px for v in verdicts])
        found["mask_ap50"] = average_precision(scores[counting], (overlaps >= LEAST_OVERLAP)[counting], poles)
        for threshold in THRESHOLDS:
            shown = counting & (scores >= threshold)
            right = shown & (overlaps >= LEAST_OVERLAP)
            found[f"detection_precision_{threshold}"] = (shown & detected).sum() / max(1, shown.sum())
            found[f"detection_recall_{threshold}"] = (shown & detected).sum() / max(1, poles)
            found[f"precision_{threshold}"] = right.sum() / max(1, shown.sum())
            found[f"recall_{threshold}"] = right.sum() / max(1, poles)
            if right.any():
                found[f"mask_iou_{threshold}"] = float(overlaps[right].mean())
                found[f"thickness_error_px_{threshold}"] = float(np.nanmedian(np.abs(errors[right])))
        return {name: round(float(value), 4) for name, value in found.items()}


def average_precision(scores: NDArray[np.float64], right: NDArray[np.bool_], wanted: int) -> float:
    """COCO's average precision of detections (N,) of which some are ``right``, where ``wanted`` could be found.

    The mean over the recalls 0, 0.01 … 1 of the best precision at that recall or a higher one.
    """
    hits = np.cumsum(right[np.argsort(-scores, kind="stable")])
    precision = hits / np.arange(1, len(hits) + 1)
    best = np.maximum.accumulate(precision[::-1])[::-1]
    reached = np.searchsorted(hits / max(1, wanted), np.linspace(0, 1, 101) - 1e-9)
    return float(np.append(best, 0.0)[reached].mean())


def judge(net: PoleNet, sources: Iterable[LabelledImage]) -> Judgement:
    """Runs a folded ``net`` on images and compares its candidates with their ids, at the network's scale."""
    pictures = (source.read() for source in sources)
    return Judgement([_judge_image(net, picture.image, picture.ids()) for picture in pictures])


def judged_weights(
    net: PoleNet,
    held_out: Sequence[LabelledImage],
    about: WeightsInfo,
    part: slice,
    weighing: Sequence[LabelledImage] = (),
) -> WeightsInfo:
    """``about`` with a calibration fitted to every other image, and the figures of a part of them.

    ``weighing``: images to weigh the evidence on, where there are any.
    """
    folded = for_inference(net)
    judged = judge(folded, held_out)
    weighed = judge(folded, weighing)
    calibration = judged.calibration(weighed, FITTED)
    return replace(about, calibration=calibration, figures=judged.figures(calibration, part))


def _judge_image(net: PoleNet, image: NDArray[np.uint8], ids: Ids) -> JudgedImage:
    framed, shown_px = frame(image)
    with torch.inference_mode():
        mask, centre, offsets = maps(net, framed)
    mask = mask[: shown_px[1], : shown_px[0]]  # nothing is found in the padding
    truth = np.asarray(cv2.resize(ids, shown_px, interpolation=cv2.INTER_NEAREST), np.uint8)
    seen = mask > 0.5
    poles = (truth > 0) & (truth < IGNORED_ID)
    judged = truth != IGNORED_ID
    poles_there = {
        i: box for i, box in enumerate(ndimage.find_objects(truth), start=1) if box and i != IGNORED_ID
    }
    areas = np.bincount(truth.ravel(), minlength=256)
    big = {
        i
        for i, (rows, _) in poles_there.items()
        if rows.stop - rows.start >= SMALL_HEIGHT_PX and areas[i] >= SMALL_AREA_PX
    }
    taken: set[int] = set()
    verdicts = []
    for candidate in sorted(group(mask, centre, offsets), key=lambda c: -c.centre):
        best, overlap, share_ignored = match(candidate, truth, areas, taken)
        detected = bool(best) and is_detection(candidate, truth == best)
        if not detected and (share_ignored > 0.3 or (best and best not in big)):
            continue  # neither right nor wrong
        error = float("nan")
        if detected:
            taken.add(best)
            error = thickness_px(candidate.mask) - thickness_px(truth[poles_there[best]] == best)
        verdicts.append(Verdict(candidate, detected, overlap, not detected or best in big, error))
    shared, either = seen & poles & judged, (seen | poles) & judged
    return JudgedImage(verdicts, len(big), int(shared.sum()), int(either.sum()))


def match(
    candidate: Candidate, truth: Ids, areas: NDArray[np.int64], taken: set[int]
) -> tuple[int, float, float]:
    """The free pole with which a candidate shares most pixels (0: none), their overlap, the share ignored."""
    (x1, y1), (height, width) = candidate.corner_px, candidate.mask.shape
    crop = truth[y1 : y1 + height, x1 : x1 + width]
    own = candidate.mask[: crop.shape[0], : crop.shape[1]]
    size = max(1, int(own.sum()))
    around = cv2.dilate(
        crop, np.ones((1, 2 * WIDENING_PX + 1), np.uint8)
    )  # thin poles are easily missed by a pixel
    met = np.bincount(around[own], minlength=256)
    share_ignored = float(met[IGNORED_ID] / size)
    met[[0, IGNORED_ID, *taken]] = 0
    best = int(met.argmax()) if met.any() else 0
    shared = int((crop[own] == best).sum()) if best else 0
    return best, shared / (size + int(areas[best]) - shared) if best else 0.0, share_ignored


def is_detection(candidate: Candidate, pole: NDArray[np.bool_]) -> bool:
    """Whether the candidate lies mostly on the pole (H, W), a little widened, and is about as long."""
    (x1, y1), (height, width) = candidate.corner_px, candidate.mask.shape
    wider = cv2.dilate(pole.astype(np.uint8), np.ones((1, 2 * WIDENING_PX + 1), np.uint8)) > 0
    crop = wider[y1 : y1 + height, x1 : x1 + width]
    own = candidate.mask[: crop.shape[0], : crop.shape[1]]
    rows, true_rows = np.flatnonzero(own.any(1)) + y1, np.flatnonzero(pole.any(1))
    if not len(rows):
        return False
    shared = min(rows[-1], true_rows[-1]) - max(rows[0], true_rows[0]) + 1
    either = max(rows[-1], true_rows[-1]) - min(rows[0], true_rows[0]) + 1
    on_pole = crop[own].sum() >= LEAST_ON_POLE * own.sum()
    return bool(on_pole and shared >= LEAST_HEIGHT_OVERLAP * either)


def thickness_px(mask: NDArray[np.bool_]) -> float:
    """Median run of the rows in the central fifth of a mask (h, w)."""
    rows = np.flatnonzero(mask.any(1))
    low, high = np.quantile(rows, (0.4, 0.6))
    widths = mask[int(low) : int(high) + 1].sum(1)
    return float(np.median(widths[widths > 0])) if widths.any() else float("nan")
