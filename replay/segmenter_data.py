"""The labelled pictures that ``scpf train segmenter`` was told to train on and to judge by."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from scpf.ingest.labelled_folders import labelled_images
from scpf.models.errors import UsageError
from scpf.models.labelled_images import IdsImage, LabelledImage, ids_images, split
from scpf.sample_logs.street_scenes import write_scenes


class TrainingPictures(NamedTuple):
    """``training``: one sequence a set; ``counted``: in words, by set."""

    training: list[list[LabelledImage]]
    held_out: list[LabelledImage]
    counted: str

    @property
    def names(self) -> dict[str, list[str]]:
        """The names of the pictures, for a configuration that shall say what was trained on."""
        trained = [image.path.name for images in self.training for image in images]
        return {"trained": trained, "held_out": [image.path.name for image in self.held_out]}


def gather(
    data: Sequence[Path],
    validate: Sequence[Path],
    classes: Sequence[str],
    held_out: float,
    seed: int,
    painted: tuple[int, Path],
    report: Callable[[str], None],
) -> TrainingPictures:
    """The pictures of ``data``, and so many ``painted`` scenes in a folder; divided unless ``validate`` names others.

    Raises UsageError where there is nothing to train on, and what the readers raise.
    """
    scenes, folder = painted
    if not data and not scenes:
        raise UsageError("nothing to train on", "name folders of labelled pictures, or give --scenes")
    training: list[list[LabelledImage]] = []
    judged: list[LabelledImage] = [image for path in validate for image in labelled_images(path, classes)]
    counted = []
    for path in data:
        images = labelled_images(path, classes)
        rest, kept = (images, []) if validate else split(images, held_out, seed)
        training.append(rest)
        judged += kept
        counted.append(f"{len(rest)} pictures of {path.name}")
    if scenes:
        training.append([*paint(folder / "train", range(scenes), report)])
        # Seeds of the held-out scenes lie apart, so that a larger --scenes never trains on them.
        judged += [] if validate else paint(folder / "held_out", _apart(scenes), report)
        counted.append(f"{scenes} painted scenes")
    if len(judged) < 2:
        raise UsageError("fewer than two pictures are held out to judge by", "give --validate, or label more")
    twice = {image.path.resolve() for images in training for image in images} & {
        image.path.resolve() for image in judged
    }
    if twice:
        raise UsageError(f"{min(twice)}: to train on and to judge by", "give --validate other pictures")
    return TrainingPictures(training, judged, f"{', '.join(counted)}; {len(judged)} held out")


def paint(folder: Path, seeds: range, report: Callable[[str], None]) -> list[IdsImage]:
    """Paints the street scenes of ``seeds`` into ``folder``; all that lie there then."""
    report(f"painting {len(seeds)} scenes into {folder}")
    write_scenes(folder, seeds)
    return ids_images(folder)


def told(images: Sequence[LabelledImage], report: Callable[[str], None]) -> Iterator[LabelledImage]:
    """The images, and word of every twentieth that is done with."""
    for done, image in enumerate(images, start=1):
        yield image
        if done % 20 == 0 or done == len(images):
            report(f"{done} of {len(images)} pictures")


def _apart(scenes: int) -> range:
    return range(10**6, 10**6 + max(scenes // 10, 8))
