"""Training sets on disk: labelme's JSON beside each picture, COCO's one JSON, or id images for `scpf train segmenter`.

labelme: polygons along the edges of the mask's pixels; the parts of a pole that something divides share a ``group_id``.
COCO: uncompressed run lengths (https://cocodataset.org/#format-data, "Object Detection"). Both hold the mask exactly,
where polygons are filled by their pixels' centres (`scpf.models.polygons`).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, Literal

import cv2
import numpy as np

from scpf.ingest.labelme_out import Labelled, labelme_json
from scpf.models.instances import encode_runs
from scpf.models.whole_files import write_whole
from scpf.sample_logs.finished_frames import FinishedFrame, SeenPole, full_masks

LabelFormat = Literal["labelme", "coco", "ids"]

CLASS: Final = "light_pole"
NOT_JUDGED: Final = 255
LEAST_FRACTION: Final = 0.25
LEAST_HEIGHT_SHARE: Final = 0.03
LEAST_THICKNESS_PX: Final = 1.5
"""A pole of which less shows, that is lower (of the picture's height), or thinner on average, may be found or not: at
1024 px such a pole stands some 75 m away, at 2048 px 150 m."""
IGNORED_CLASS: Final = "ignored"
"""What labelme's files call it."""


def write_labels(
    folder: Path, frames: Iterator[tuple[str, FinishedFrame]], labels: LabelFormat, about: dict[str, Any]
) -> int:
    """Write pictures and labels of named frames into ``folder``; returns the number of labelled poles.

    ``about``: how the set was made; it goes into COCO's ``info``, and into ``about.json`` of the others.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if labels == "coco":
        return _write_coco(folder, frames, about)
    write: Callable[[Path, str, FinishedFrame], None] = _write_labelme if labels == "labelme" else _write_ids
    poles = 0
    for name, frame in frames:
        write_whole(folder / f"{name}.jpg", frame.jpeg)
        write(folder, name, frame)
        poles += len(frame.poles)
    write_whole(folder / "about.json", _json(about))
    return poles


def _write_labelme(folder: Path, name: str, frame: FinishedFrame) -> None:
    labelled = []
    for pole in frame.poles:
        shown = pole.instance
        if not _is_judged(pole, frame):
            shown = replace(shown, landmark_class=IGNORED_CLASS)
        labelled.append(
            Labelled(shown, f"{pole.distance_m:.2f} m, {100 * pole.visible_fraction:.0f} % visible")
        )
    content = labelme_json(f"{name}.jpg", (frame.width_px, frame.height_px), labelled)
    write_whole(folder / f"{name}.json", content)


def _write_ids(folder: Path, name: str, frame: FinishedFrame) -> None:
    ids = np.zeros((frame.height_px, frame.width_px), dtype=np.uint8)
    for number, (pole, mask) in enumerate(zip(frame.poles, full_masks(frame), strict=True), 1):
        ids[mask] = number if number < NOT_JUDGED and _is_judged(pole, frame) else NOT_JUDGED
    done, data = cv2.imencode(".png", ids)
    assert done
    write_whole(folder / f"{name}.png", data.tobytes())


def _is_judged(pole: SeenPole, frame: FinishedFrame) -> bool:
    instance = pole.instance
    high_enough = instance.height_px >= LEAST_HEIGHT_SHARE * frame.height_px
    thick_enough = int(instance.mask.sum()) >= LEAST_THICKNESS_PX * instance.height_px
    return high_enough and thick_enough and pole.visible_fraction >= LEAST_FRACTION


def _write_coco(folder: Path, frames: Iterator[tuple[str, FinishedFrame]], about: dict[str, Any]) -> int:
    pictures = folder / "images"
    pictures.mkdir(exist_ok=True)
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for number, (name, frame) in enumerate(frames, 1):
        write_whole(pictures / f"{name}.jpg", frame.jpeg)
        image = {
            "id": number,
            "file_name": f"{name}.jpg",
            "width": frame.width_px,
            "height": frame.height_px,
            **frame.facts,
        }
        images.append(image)
        for pole, mask in zip(frame.poles, full_masks(frame), strict=True):
            x1, y1, x2, y2 = pole.instance.box_px
            annotation = {
                "id": len(annotations) + 1,
                "image_id": number,
                "category_id": 1,
                "segmentation": {"size": list(mask.shape), "counts": encode_runs(mask).tolist()},
                "area": int(mask.sum()),
                "bbox": [x1, y1, x2 - x1, y2 - y1],
                "iscrowd": 0,
                "ignore": int(not _is_judged(pole, frame)),
                "distance_m": pole.distance_m,
                "visible_fraction": pole.visible_fraction,
            }
            annotations.append(annotation)
    document = {
        "info": {"description": "simulated light poles", **about},
        "images": images,
        "annotations": annotations,
        "categories": [{"id": 1, "name": CLASS, "supercategory": "street"}],
    }
    write_whole(folder / "instances.json", _json(document))
    return len(annotations)


def _json(document: Any) -> bytes:
    return (json.dumps(document, indent=1) + "\n").encode()
