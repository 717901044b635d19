"""``scpf label``: masks suggested on frames of a drive log, as labelme files for a person to correct."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal, NamedTuple

from cyclopts import Parameter

from scpf.models.whole_files import whole
from scpf.replay.status_line import StatusLine

if TYPE_CHECKING:
    from scpf.ingest.drive_log import DriveLog
    from scpf.models.instances import Image, Instance

CANDIDATES: Final = 5
"""Of so many frames in each stretch of the log the most doubtful one is taken."""

DOUBTED: Final = 0.1
"""Detections of a lower score raise no doubt."""


def label(
    log: Path,
    *,
    output: Annotated[Path, Parameter(alias="-o")],
    frame: Annotated[tuple[int, ...], Parameter(alias="-f")] = (),
    count: int = 50,
    doubtful: bool = False,
    segmenter: str = "polenet",
    threshold: float = 0.5,
    tolerance_px: float = 0.5,
    overwrite: bool = False,
    quiet: Annotated[bool, Parameter(alias="-q")] = False,
    format: Literal["text", "json"] = "text",
) -> int:
    """Suggest masks on frames of a drive log, as pictures with labelme files beside them.

    Open the folder with labelme, correct the outlines, and give it to `scpf train segmenter`. Exit code 3: frames that
    cannot be decoded were left out.

    Examples:

        scpf label campus.mcap -o labelled_campus

        scpf label campus.mcap -o labelled_campus --count 250 --doubtful

        scpf label campus.mcap -o labelled_campus --frame 40 --frame 80 --segmenter campus.safetensors

    Parameters
    ----------
    log
        The drive log.
    output
        The folder for NAME.jpg and NAME.json.
    frame
        Index of a frame; repeat it. Without it, --count chooses.
    count
        So many frames, spread evenly over the log.
    doubtful
        Of five frames in each stretch, take the one whose detections are the most doubtful: it teaches the most.
    segmenter
        `polenet`, `thorough` (three looks at each picture), `recorded` (masks that the log holds), or a file of
        weights.
    threshold
        Suggest detections from this score on. What is wrong is faster deleted than drawn.
    tolerance_px
        The outline may leave the mask's edge by so much, so that it has few points.
    overwrite
        Replace labels that are there already, corrected or not.
    quiet
        No progress on stderr.
    format
        How to print the summary on stdout.
    """
    import json

    from scpf.ingest.drive_log import DriveLog
    from scpf.models.errors import MissingError, UsageError

    if count < 1 or not 0 <= threshold <= 1 or tolerance_px < 0:
        raise UsageError("--count is positive, --threshold from 0 to 1, --tolerance-px not negative")
    masks = written = 0
    status = StatusLine(quiet)
    unreadable: list[str] = []
    with DriveLog(log) as opened:
        total = sum(1 for _ in opened.images())
        if not total:
            raise MissingError(f"{log} holds no images")
        stretches = _stretches(total, frame, count, CANDIDATES if doubtful else 1)
        for chosen in _suggestions(opened, stretches, segmenter, min(threshold, DOUBTED), unreadable):
            masks += _write(output, chosen, threshold, tolerance_px, overwrite)
            written += 1
            status.show(f"{written} of {len(stretches)} frames, {masks} masks")
    status.keep()
    for message in unreadable:
        print(f"scpf: {message}", file=sys.stderr)
    summary = {"folder": str(output), "frames": written, "masks": masks, "unreadable": len(unreadable)}
    print(json.dumps(summary) if format == "json" else f"{output}: {written} frames with {masks} masks")
    return 3 if unreadable else 0


class _Suggestion(NamedTuple):
    """A frame's picture, to be written under ``name``, with what was found in it."""

    name: str
    picture: bytes
    size_px: tuple[int, int]
    found: Sequence[Instance]

    @property
    def doubt(self) -> float:
        """How much a person's word on the detections would tell: most at a score of a half."""
        return sum(1 - abs(2 * each.score - 1) for each in self.found)


def _suggestions(
    log: DriveLog,
    stretches: Sequence[Sequence[int]],
    segmenter: str,
    least_score: float,
    unreadable: list[str],
) -> Iterator[_Suggestion]:
    """The most doubtful frame of each stretch; messages on those that cannot be decoded go to ``unreadable``."""
    from scpf.models import segmentation
    from scpf.models.errors import InputError
    from scpf.replay.frames import decode
    from scpf.replay.segmenters import RECORDED

    recorded = log.instances() if segmenter == RECORDED else {}
    segment = (
        None if segmenter == RECORDED else segmentation.load(segmenter, threads=1, threshold=least_score)
    )
    last = {stretch[-1] for stretch in stretches}
    wanted = {index for stretch in stretches for index in stretch}
    best: _Suggestion | None = None
    for index, image in enumerate(log.images()):
        if index not in wanted:
            continue
        try:
            pixels = decode(image.data, f"{log.path}: frame {index}")
        except InputError as error:
            unreadable.append(error.message)
        else:
            found = recorded.get(image.stamp_ns, []) if segment is None else segment(pixels)
            data, suffix = _picture(bytes(image.data), pixels)
            name = f"{log.path.stem}_{index:06d}{suffix}"
            suggestion = _Suggestion(name, data, (pixels.shape[1], pixels.shape[0]), found)
            if best is None or suggestion.doubt > best.doubt:
                best = suggestion
        if index in last and best is not None:
            yield best
            best = None


def _picture(encoded: bytes, pixels: Image) -> tuple[bytes, str]:
    """The picture as the log holds it, or as PNG where that is neither JPEG nor PNG, and the ending of its name."""
    import cv2

    if encoded.startswith(b"\xff\xd8"):
        return encoded, ".jpg"
    if encoded.startswith(b"\x89PNG"):
        return encoded, ".png"
    return cv2.imencode(".png", pixels[:, :, ::-1])[1].tobytes(), ".png"


def _write(folder: Path, chosen: _Suggestion, threshold: float, tolerance_px: float, overwrite: bool) -> int:
    """Writes picture and labels; returns the number of masks."""
    from scpf.ingest.labelme_out import Labelled, labelme_json
    from scpf.models.errors import InputError

    picture, labels = folder / chosen.name, (folder / chosen.name).with_suffix(".json")
    if labels.exists() and not overwrite:
        raise InputError(f"{labels} exists", "it may be corrected already; --overwrite replaces it")
    shown = [Labelled(each, f"score {each.score:.2f}") for each in chosen.found if each.score >= threshold]
    folder.mkdir(parents=True, exist_ok=True)
    for path, content in (
        (picture, chosen.picture),
        (labels, labelme_json(chosen.name, chosen.size_px, shown, tolerance_px)),
    ):
        with whole(path) as partial:
            partial.write_bytes(content)
    return len(shown)


def _stretches(total: int, frames: Sequence[int], count: int, candidates: int) -> list[list[int]]:
    """For each picture to be written, the frames that it may be. Raises UsageError for a frame that is not there."""
    from scpf.models.errors import UsageError

    if frames:
        for index in frames:
            if not 0 <= index < total:
                raise UsageError(f"--frame {index}: the log has frames 0 to {total - 1}")
        return [[index] for index in sorted(set(frames))]
    count = min(count, total)
    stretches = []
    for k in range(count):
        first, last = k * total // count, (k + 1) * total // count
        here = min(candidates, last - first)
        # In the middle of equal parts: one alone stands in the middle of its stretch.
        stretches.append([first + (2 * n + 1) * (last - first) // (2 * here) for n in range(here)])
    return stretches
