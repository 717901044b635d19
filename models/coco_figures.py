"""COCO's average precision of masks and boxes, by faster-coco-eval (the figures of pycocotools; scpf[train])."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from scpf.models.errors import MissingError
from scpf.models.instances import BoolMask, Instance

FIGURES = ("ap", "ap50", "ap75")  # over overlaps of 0.50 to 0.95, at 0.50, at 0.75


class JudgedPicture(NamedTuple):
    """Detections and labelled instances of a picture of ``size_px`` (width, height); ``ignored``: of each labelled."""

    size_px: tuple[int, int]
    detections: Sequence[Instance]
    labelled: Sequence[Instance]
    ignored: Sequence[bool]


class CocoFigures:
    """Gathers pictures one by one, their masks packed, and gives the figures of all."""

    def __init__(self) -> None:
        """Raises MissingError where the library is not installed."""
        try:
            from faster_coco_eval import COCO, COCOeval_faster
            from faster_coco_eval.core import mask
        except ImportError as error:
            raise MissingError(
                "COCO's average precision needs faster-coco-eval", "pip install 'scpf[train]'"
            ) from error
        self._coco, self._evaluate, self._pack = COCO, COCOeval_faster, mask.encode
        self._images: list[dict[str, Any]] = []
        self._labelled: list[dict[str, Any]] = []
        self._detected: list[dict[str, Any]] = []

    def add(self, picture: JudgedPicture) -> None:
        """Adds a picture."""
        number = len(self._images) + 1
        width, height = picture.size_px
        self._images.append({"id": number, "width": width, "height": height})
        for instance, ignored in zip(picture.labelled, picture.ignored, strict=True):
            entry = self._entry(instance, number, picture.size_px)
            self._labelled.append({**entry, "id": len(self._labelled) + 1, "iscrowd": int(ignored)})
        for instance in picture.detections:
            entry = self._entry(instance, number, picture.size_px)
            self._detected.append({**entry, "score": instance.score})

    def figures(self) -> dict[str, float]:
        """``mask_ap``, ``mask_ap50``, ``mask_ap75``, and likewise ``box_``; NaN where nothing is labelled."""
        truth = self._coco(
            {
                "images": self._images,
                "annotations": self._labelled,
                "categories": [{"id": 1, "name": "light_pole"}],
            }
        )
        found = truth.loadRes(self._detected)
        figures: dict[str, float] = {}
        for name, kind in (("mask", "segm"), ("box", "bbox")):
            evaluation = self._evaluate(truth, found, kind)
            evaluation.evaluate()
            evaluation.accumulate()
            evaluation.summarize()
            for figure, value in zip(FIGURES, evaluation.stats[:3], strict=True):
                figures[f"{name}_{figure}"] = float(value) if value >= 0 else float("nan")
        return figures

    def _entry(self, instance: Instance, image: int, size_px: tuple[int, int]) -> dict[str, Any]:
        x1, y1, x2, y2 = instance.box_px
        return {
            "image_id": image,
            "category_id": 1,
            "bbox": [x1, y1, x2 - x1, y2 - y1],
            "area": float(instance.mask.sum()),
            "segmentation": self._pack(np.asfortranarray(_whole(instance, size_px).astype(np.uint8))),
        }


def _whole(instance: Instance, size_px: tuple[int, int]) -> BoolMask:
    (x, y), (width, height) = instance.offset_px, size_px
    whole = np.zeros((height, width), dtype=np.bool_)
    rows, columns = instance.mask.shape
    whole[y : y + rows, x : x + columns] = instance.mask[: height - y, : width - x]
    return whole
