"""The segmenters a replay can run, by name: networks that look at the image, and masks that the log holds."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from scpf.models.devices import DeviceName
from scpf.models.instances import Instance
from scpf.models.maskrcnn_conventions import CheckpointSettings
from scpf.replay.pipeline import Segment
from scpf.replay.step import Frame

RECORDED = "recorded"


def reads_pixels(name: str) -> bool:
    """Whether the segmenter looks at the image, so that the image has to be decoded."""
    return name != RECORDED


def build(
    name: str,
    threshold: float,
    bfloat16: bool = False,
    device: DeviceName = "cpu",
    checkpoint: CheckpointSettings | None = None,
) -> Segment:
    """``recorded``: the log's own masks; anything else: ``scpf.models.segmentation.load``'s name or file.

    Instances of a score below ``threshold`` are left out. What a weights file does not say, and was assumed, is
    printed on stderr.
    """
    if name == RECORDED:
        return lambda frame: [instance for instance in frame.recorded if instance.score >= threshold]
    from scpf.models.segmentation import load

    segmenter = load(
        name, threads=1, threshold=threshold, bfloat16=bfloat16, device=device, checkpoint=checkpoint
    )
    description = getattr(segmenter, "description", "")
    if description:
        print(f"scpf: {name}: {description}", file=sys.stderr)

    def segment(frame: Frame) -> Sequence[Instance]:
        return [] if frame.image is None else segmenter(frame.image)

    return segment
