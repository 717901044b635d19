"""The camera's part of a recording: the image as the log holds it, masks, outlines and labels over it."""

from __future__ import annotations

from typing import Final

import numpy as np
import rerun as rr

from scpf.replay import overlays
from scpf.replay.recording_rows import RowBatches
from scpf.replay.step import Step

LOWEST_LABEL: Final = 0.93
"""Of the image's height: the label of a pole that is cut off below would lie outside."""


def log_image(rec: rr.RecordingStream, encoded: bytes | memoryview, image_format: str) -> None:
    """An image in the log's own bytes; cleared where there are none."""
    blob = bytes(encoded)  # bytes are taken as they are, an array would be converted
    kind = overlays.media_type(image_format, blob)
    image = rr.EncodedImage.from_fields(blob=blob, media_type=kind) if blob else rr.EncodedImage.cleared()
    rec.log("camera/image", image)


def log_instances(
    rec: rr.RecordingStream,
    rows: RowBatches,
    step: Step,
    classes: overlays.LandmarkClasses,
    height_px: int | None,
) -> None:
    """Masks, outlines and labels; what a frame does not have is cleared, or the last one stays on screen."""
    instances = [*(observation.instance for observation in step.observations), *step.unmeasured]
    matched = [*(match.landmark_id for match in step.matches), *("" for _ in step.unmeasured)]
    numbers = [classes.class_of(landmark_id) for landmark_id in matched]
    masks = overlays.mask_picture(instances, numbers)
    png, corner = ([], []) if masks is None else ([masks[0]], [(*masks[1], 0)])
    rows.add("camera/masks", rr.EncodedImage.columns, blob=png)
    rows.add("camera/masks", rr.Transform3D.columns, translation=corner)
    strips = [overlays.outlines(instance.mask, instance.offset_px) for instance in instances]
    ids = [number for number, parts in zip(numbers, strips, strict=True) for _ in parts]
    joined = [part for parts in strips for part in parts]
    rows.add("camera/outlines", rr.LineStrips2D.columns, strips=joined, class_ids=ids)
    boxes = np.array([instance.box_px for instance in instances], dtype=np.float32).reshape(-1, 4)
    lowest = LOWEST_LABEL * height_px if height_px else np.inf
    feet = np.column_stack([(boxes[:, 0] + boxes[:, 2]) / 2, np.minimum(boxes[:, 3], lowest)])
    texts, shown = overlays.labels(step), overlays.worth_reading(step)
    for entity, wanted in (("camera/labels", True), ("camera/labels_on_hover", False)):
        chosen = [k for k in range(len(texts)) if shown[k] is wanted]
        labels, classes_shown = [texts[k] for k in chosen], [numbers[k] for k in chosen]
        rows.add(entity, rr.Points2D.columns, positions=feet[chosen], labels=labels, class_ids=classes_shown)
