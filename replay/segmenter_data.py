"""The labelled pictures that ``scpf train segmenter`` was told to train on and to judge by."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from scpf.ingest.labelled_folders import labelled_images
from scpf.models.errors import UsageError
from scpf.models.labelled_images import IdsImage, LabelledImage, split
from scpf.models.worker_processes import usable_cores
from scpf.sample_logs.scene_files import is_whole, scene_paths, write_scenes

FIRST_SEED_TO_WEIGH = 2 * 10**6
"""Of the scenes that the evidence is weighed on: no training and no validation paints them."""

WORTH_PROCESSES = 64  # fewer scenes are painted before several processes have begun
TOLD_EVERY = 100


class PaintedScenes(NamedTuple):
    """How many to train on, how many to weigh the score's evidence on, and the folder where they are kept.

    ``keep``: those that lie there are not painted anew.
    """

    trained: int
    weighed: int
    folder: Path
    keep: bool = False


class TrainingPictures(NamedTuple):
    """``training``: one sequence a set, some more than once; ``weighing``: for the score; ``counted``: in words."""

    training: list[list[LabelledImage]]
    held_out: list[LabelledImage]
    weighing: list[LabelledImage]
    counted: str

    @property
    def names(self) -> dict[str, list[str]]:
        """The names of the pictures, for a configuration that shall say what was trained on."""
        sets = {id(images): images for images in self.training}.values()
        trained = [image.path.name for images in sets for image in images]
        return {"trained": trained, "held_out": [image.path.name for image in self.held_out]}


def gather(
    data: Sequence[Path],
    validate: Sequence[Path],
    classes: Sequence[str],
    held_out: float,
    seed: int,
    painted: PaintedScenes,
    report: Callable[[str], None],
) -> TrainingPictures:
    """The pictures of ``data``, and ``painted`` scenes; divided unless ``validate`` names others.

    Half of what is trained on are painted scenes, where there are some and other pictures, too. Raises UsageError where
    there is nothing to train on, and what the readers raise.
    """
    scenes = painted.trained
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
        training += [[*painted_images(painted, "train", range(scenes), report)]] * max(1, len(data))
        # Seeds of the held-out scenes lie apart, so that a larger --scenes never trains on them.
        judged += [] if validate else painted_images(painted, "held_out", _apart(scenes), report)
        counted.append(f"{scenes} painted scenes")
    if len(judged) < 2:
        raise UsageError("fewer than two pictures are held out to judge by", "give --validate, or label more")
    twice = {image.path.resolve() for images in training for image in images} & {
        image.path.resolve() for image in judged
    }
    if twice:
        raise UsageError(f"{min(twice)}: to train on and to judge by", "give --validate other pictures")
    counts = f"{', '.join(counted)}; {len(judged)} held out"
    return TrainingPictures(training, judged, paint_to_weigh(painted, report), counts)


def paint_to_weigh(painted: PaintedScenes, report: Callable[[str], None]) -> list[LabelledImage]:
    """The scenes to weigh the score's evidence on; none where none are wanted."""
    if not painted.weighed:
        return []
    seeds = range(FIRST_SEED_TO_WEIGH, FIRST_SEED_TO_WEIGH + painted.weighed)
    return [*painted_images(painted, "weighed", seeds, report)]


def painted_images(
    painted: PaintedScenes, name: str, seeds: range, report: Callable[[str], None]
) -> list[IdsImage]:
    """The street scenes of ``seeds``, painted into the folder ``name`` of the scenes' folder."""
    folder = painted.folder / name
    wanted = [seed for seed in seeds if not (painted.keep and is_whole(folder, seed))]
    kept = f", {len(seeds) - len(wanted)} are there" if len(wanted) < len(seeds) else ""
    report(f"painting {len(wanted)} scenes into {folder}{kept}")

    def told(done: int) -> None:
        if done % TOLD_EVERY == 0:
            report(f"{done} of {len(wanted)} scenes")

    cores = usable_cores() if len(wanted) >= WORTH_PROCESSES else 1
    write_scenes(folder, wanted, workers=cores, progress=told)
    return [IdsImage(*scene_paths(folder, seed)) for seed in seeds]


def told(images: Sequence[LabelledImage], report: Callable[[str], None]) -> Iterator[LabelledImage]:
    """The images, and word of every twentieth that is done with."""
    for done, image in enumerate(images, start=1):
        yield image
        if done % 20 == 0 or done == len(images):
            report(f"{done} of {len(images)} pictures")


def _apart(scenes: int) -> range:
    return range(10**6, 10**6 + max(scenes // 10, 8))
