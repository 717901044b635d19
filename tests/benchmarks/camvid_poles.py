"""How much of CamVid's class "column or pole" a segmenter outlines, and pictures of where it fails.

    python tests/benchmarks/camvid_poles.py CamVid/val CamVid/valannot -o failures --segmenter polenet

Run by hand: the images (480×360, SegNet's division of Brostow et al. 2009) are not ours to ship. The class holds the
posts of traffic lights and signs, too, which are no light poles: full recall is not to be had. In the pictures, found
pixels are green, missed ones red, and those that are no pole blue; twice as large, the image beside it.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from scpf.models.instances import Image, Instance
from scpf.models.segmentation import load

POLE, UNLABELLED = 2, 11
THRESHOLDS = (0.9, 0.7, 0.5, 0.3)
DRAWN_FROM = 0.5
PICTURES = 12
NEAR_PX = 2  # on either side: at this size a pole is two or three pixels wide

Mask = NDArray[np.bool_]


def painted(detections: list[Instance], threshold: float, shape: tuple[int, int]) -> Mask:
    """All detections of at least the threshold as one mask (H, W)."""
    whole = np.zeros(shape, bool)
    for each in detections:
        if each.score >= threshold:
            (x, y), (height, width) = each.offset_px, each.mask.shape
            whole[y : y + height, x : x + width] |= each.mask
    return whole


def near(mask: Mask) -> Mask:
    """The mask, `NEAR_PX` wider on either side."""
    return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((1, 2 * NEAR_PX + 1), np.uint8)) > 0)


def failures(image: Image, shown: Mask, truth: Mask) -> Image:
    """The image beside itself with what was found, missed and made up."""
    overlay = image // 2
    for mask, colour in (
        (truth & ~shown, (255, 0, 0)),
        (shown & ~truth, (0, 90, 255)),
        (shown & truth, (0, 255, 0)),
    ):
        overlay[mask] = colour
    both = np.hstack([image, overlay])
    return np.asarray(cv2.resize(both, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST), np.uint8)


def main(images: Path, labels: Path, output: Path, segmenter: str) -> None:
    segment = load(segmenter, threshold=min(THRESHOLDS))
    sums = {threshold: np.zeros(5, np.int64) for threshold in THRESHOLDS}
    drawn: list[tuple[int, str, Image]] = []
    for path in sorted(images.glob("*.png")):
        image = np.ascontiguousarray(cv2.imread(str(path))[:, :, ::-1])
        classes = cv2.imread(str(labels / path.name), cv2.IMREAD_UNCHANGED)
        truth, known = classes == POLE, classes != UNLABELLED
        detections = segment(image)
        for threshold in THRESHOLDS:
            shown = painted(detections, threshold, truth.shape) & known
            parts = (shown & truth, shown, truth, shown & near(truth), near(shown) & truth)
            sums[threshold] += [int(part.sum()) for part in parts]
        shown = painted(detections, DRAWN_FROM, truth.shape) & known
        drawn.append(
            (
                int((shown & ~near(truth)).sum() + (truth & ~near(shown)).sum()),
                path.stem,
                failures(image, shown, truth),
            )
        )
    print("score  precision recall   within 2 px: precision recall")
    for threshold, (both, shown, truth, shown_near, truth_near) in sums.items():
        values = both / max(1, shown), both / truth, shown_near / max(1, shown), truth_near / truth
        print(f"{threshold:5.1f}  {values[0]:9.3f} {values[1]:6.3f} {values[2]:23.3f} {values[3]:6.3f}")
    output.mkdir(parents=True, exist_ok=True)
    for wrong, name, picture in sorted(drawn, key=lambda each: -each[0])[:PICTURES]:
        cv2.imwrite(str(output / f"{wrong:05d}_{name}.png"), picture[:, :, ::-1])
    print(f"the {PICTURES} worst pictures at {DRAWN_FROM}: {output}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("images", type=Path)
    parser.add_argument("labels", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--segmenter", default="polenet")
    given = parser.parse_args()
    main(given.images, given.labels, given.output, given.segmenter)
