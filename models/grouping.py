"""From PoleNet's maps to instances: centre peaks, pixels to their centres, calibrated scores.

Panoptic-DeepLab's grouping (Cheng et al., CVPR 2020, section 3.3) with an elongated distance, since poles stand side
by side rather than one above the other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from scpf.models import pole_parts
from scpf.models.instances import BoolMask
from scpf.models.segmentation import MASK_THRESHOLD

Floats = NDArray[np.floating[Any]]

CENTRE_CELL_PX = 8
OFFSET_CELL_PX = 4
OFFSET_SCALE_PX = (32.0, 64.0)  # x, y: unit of the offsets
CENTRE_DEVIATION_PX = (8.0, 32.0)  # x, y: a pixel may miss its centre by so much and belong to it
MOST_DEVIATIONS = 4.0
PEAK_CELLS = (7, 3)  # rows, columns: of several peaks so close only the highest stays
LEAST_CENTRE = 0.1  # a peak below is no candidate
LEAST_PIXELS = 12
MOST_CANDIDATES = 64
LEAST_PART = 0.08  # smaller parts of an instance, as a share of its largest, are somebody else's pixels
HEAD_PARTS = 8  # the head of a lamp post is looked for in the first of so many parts of its height
PROBABILITY_RANGE = (1e-4, 1 - 1e-4)


def logit(probability: float) -> float:
    """Log-odds, of a probability kept away from 0 and 1."""
    p = min(max(probability, PROBABILITY_RANGE[0]), PROBABILITY_RANGE[1])
    return math.log(p / (1 - p))


def expit(log_odds: float) -> float:
    """The probability of log-odds."""
    return float(1 / (1 + np.exp(-log_odds)))


class Form(NamedTuple):
    """Of a candidate's mask, in network pixels.

    ``height_px``: from its first to its last row; ``width_px``: the mean of its rows, those left out in which it is
    hidden; ``head``: how much wider than the whole its first eighth is, where a lamp post has its arm and its lamp.
    """

    height_px: int
    width_px: float
    head: float

    @classmethod
    def of(cls, mask: BoolMask) -> Form:
        """From a mask (h, w), which is not empty."""
        widths = np.count_nonzero(mask, axis=1)
        rows = np.flatnonzero(widths)
        height_px = int(rows[-1] - rows[0]) + 1
        width_px = float(widths.sum() / len(rows))
        first = widths[rows[rows < rows[0] + height_px / HEAD_PARTS]]
        return cls(height_px, width_px, float(first.sum() / len(first)) / width_px)


class Candidate(NamedTuple):
    """An instance in the pixels of the network's input, before its score.

    ``corner_px``: x1, y1 of the crop. ``soft``: (h, w) mask probabilities, 0 where the pixel is another's.
    """

    corner_px: tuple[int, int]
    soft: NDArray[np.float32]
    mask: BoolMask
    centre: float
    mask_mean: float

    @property
    def evidence(self) -> NDArray[np.float64]:
        """What the score is made of (6,): log-odds of centre and mask, logarithms of height, width (px) and head, 1."""
        form = (math.log(value) for value in Form.of(self.mask))
        return np.array([logit(self.centre), logit(self.mask_mean), *form, 1.0])


@dataclass(frozen=True)
class ScoreCalibration:
    """Logistic regression that turns the evidence of a candidate into the probability that it is a light pole.

    Platt (1999) with five regressors: the raw centre score of a rare peak is far below the share of such candidates
    that are right; of two as high the stouter one is more often a flag or the post of a sign, and so is one without a
    head. ``log_width`` and ``log_head`` are 0 in weights from before they were looked at.
    """

    centre_logit: float
    mask_logit: float
    log_height: float
    constant: float
    log_width: float = 0.0
    log_head: float = 0.0

    @classmethod
    def of(cls, weights: NDArray[np.float64]) -> ScoreCalibration:
        """From the weights (6,) of the evidence, in the order of `Candidate.evidence`."""
        centre, mask, height, width, head, constant = weights.tolist()
        return cls(centre, mask, height, constant, width, head)

    @property
    def weights(self) -> NDArray[np.float64]:
        """Of the evidence (6,), in its order."""
        form = (self.log_height, self.log_width, self.log_head)
        return np.array([self.centre_logit, self.mask_logit, *form, self.constant])

    def probability(self, candidate: Candidate) -> float:
        """That the candidate is a light pole."""
        return expit(float(candidate.evidence @ self.weights))


def group(mask: Floats, centre: Floats, offsets: Floats) -> list[Candidate]:
    """Candidates of probabilities ``mask`` (H, W), ``centre`` (H/8, W/8) and ``offsets`` (2, H/4, W/4).

    Pixels above `MASK_THRESHOLD` point at a centre by their offset and go to the nearest peak.
    """
    peaks = _peaks(centre)
    on_pole = mask > MASK_THRESHOLD
    y, x = np.divmod(np.flatnonzero(on_pole), mask.shape[1])  # ten times as fast as the nonzero of two axes
    if not len(peaks) or not len(y):
        return []
    peak_px = (peaks[:, ::-1] + 0.5) * CENTRE_CELL_PX
    cell = y // OFFSET_CELL_PX, x // OFFSET_CELL_PX
    aim_x = x + 0.5 + offsets[0][cell] * OFFSET_SCALE_PX[0]
    aim_y = y + 0.5 + offsets[1][cell] * OFFSET_SCALE_PX[1]
    nearest = np.full(len(y), np.float32(MOST_DEVIATIONS**2), np.float32)
    owner = np.full(len(y), -1, np.int16)
    for i, (px, py) in enumerate(
        peak_px.astype(np.float32)
    ):  # a loop over few peaks needs no (pixels, peaks) array
        distance = ((aim_x - px) / CENTRE_DEVIATION_PX[0]) ** 2 + ((aim_y - py) / CENTRE_DEVIATION_PX[1]) ** 2
        nearer = distance < nearest
        nearest[nearer], owner[nearer] = distance[nearer], i
    owner = pole_parts.join(on_pole, peak_px, y, x, owner)
    found = []
    for i, (row, column) in enumerate(peaks):
        own = owner == i
        if np.count_nonzero(own) >= LEAST_PIXELS:
            found.append(_candidate(mask, y[own], x[own], float(centre[row, column])))
    return found


def _peaks(centre: Floats) -> NDArray[np.int64]:
    """Rows and columns (N, 2) of the local maxima, highest first."""
    highest = cv2.dilate(centre.astype(np.float32), np.ones(PEAK_CELLS, np.uint8))
    rows, columns = np.nonzero((centre >= highest) & (centre > LEAST_CENTRE))
    order = np.argsort(-centre[rows, columns], kind="stable")[:MOST_CANDIDATES]
    return np.stack([rows[order], columns[order]], axis=1)


def _candidate(mask: Floats, y: NDArray[np.int64], x: NDArray[np.int64], centre: float) -> Candidate:
    """The candidate of its pixels; its soft mask reaches two pixels beyond them, where the edge fades out."""
    left, top = int(x.min()), int(y.min())
    own = np.zeros((int(y.max()) + 1 - top, int(x.max()) + 1 - left), np.uint8)
    own[y - top, x - left] = 1
    y, x = np.nonzero(_without_scraps(own))
    y, x = y + top, x + left
    height, width = mask.shape
    x1, y1 = max(int(x.min()) - 2, 0), max(int(y.min()) - 2, 0)
    x2, y2 = min(int(x.max()) + 3, width), min(int(y.max()) + 3, height)
    own = np.zeros((y2 - y1, x2 - x1), np.uint8)
    own[y - y1, x - x1] = 1
    around = cv2.dilate(own, np.ones((3, 5), np.uint8))
    soft = (mask[y1:y2, x1:x2] * around).astype(np.float32)
    # Neighbours' pixels lie above the threshold but are not our own: they must not come back when upsampled.
    soft[(own == 0) & (soft > 0.5)] = 0
    return Candidate((x1, y1), soft, own.astype(bool), centre, float(mask[y, x].mean()))


def _without_scraps(own: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Pixels (h, w) without the small parts that lie apart; a pole behind a tree may well be of several large ones."""
    bridged = cv2.dilate(own, np.ones((5, 5), np.uint8))  # thin arms break up
    _, labels = cv2.connectedComponents(bridged)
    sizes = np.bincount(labels.ravel(), weights=own.ravel())
    kept = sizes >= LEAST_PART * sizes[1:].max()
    kept[0] = False
    return np.asarray(own * kept[labels], np.uint8)
