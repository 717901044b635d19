"""Training of the distance model: samples out of drive logs, and predictions by models that never saw the pole."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.drive_log import DriveLog
from scpf.models.camera import Camera
from scpf.models.cross_fitted import CrossFittedDistance
from scpf.models.distance import DistanceModel, Predictions, TrainedOn
from scpf.models.distance_fit import fit
from scpf.models.distance_settings import DistanceSettings
from scpf.models.errors import InputError, MissingError
from scpf.models.features import BOX, FEATURES, Features, measure
from scpf.models.gaussian_process import MIN_SAMPLES
from scpf.models.instances import Instance
from scpf.models.labelling import label

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

RECORDED: Final = "recorded"
TOO_SMALL: Final = "too small to measure"
NO_POSE: Final = "no reference pose at the frame"


@dataclass(frozen=True, eq=False)
class Samples:
    """N labelled instances.

    ``features`` (N); ``distances_m``, ``landmark_ids``, ``stamps_ns``, ``landmark_classes`` (N,). ``dropped`` counts
    instances by the reason they were left out for; ``frames`` were read, ``unreadable`` of them could not
    be decoded.
    """

    features: Features
    distances_m: Array
    landmark_ids: NDArray[np.str_]
    stamps_ns: Stamps
    camera: Camera
    frames: int
    unreadable: int
    dropped: Mapping[str, int]
    landmark_classes: NDArray[np.str_]

    def __len__(self) -> int:
        return len(self.distances_m)

    def rows(self, which: NDArray[np.intp] | NDArray[np.bool_]) -> Samples:
        """The samples that ``which`` (indices or flags) selects."""
        return replace(
            self,
            features=self.features.rows(which),
            distances_m=self.distances_m[which],
            landmark_ids=self.landmark_ids[which],
            stamps_ns=self.stamps_ns[which],
            landmark_classes=self.landmark_classes[which],
        )

    def by_class(self) -> dict[str, Samples]:
        """The samples of each landmark class; what was dropped is not divided."""
        names = np.unique(self.landmark_classes).tolist()
        return {name: self.rows(self.landmark_classes == name) for name in names}


def gather(
    paths: Sequence[Path],
    segmenter: str = "polenet",
    threshold: float = 0.9,
    every: int = 1,
    max_distance_m: float = 60.0,
    on_frame: Callable[[int, int], None] | None = None,
    names: Sequence[str] = tuple(FEATURES),
) -> Samples:
    """Samples from every ``every``-th frame of the logs, labelled by their maps and reference trajectories.

    ``segmenter``: a name or a file, as ``segmentation.load`` takes it, or "recorded" for the log's own masks;
    instances of a score below ``threshold`` are left out. ``on_frame(frames, samples)`` is called after each frame.
    ``names``: the features to measure; an instance is too small where one of these cannot be.
    Raises MissingError where a log lacks calibration, trajectory or map, InputError where two logs come from different
    cameras or nothing could be labelled.
    """
    camera: Camera | None = None
    tables: list[Features] = []
    rows: list[tuple[float, str, int, str]] = []
    dropped: Counter[str] = Counter()
    frames = unreadable = 0
    for path in paths:
        with DriveLog(path) as log:
            its_camera, trajectory, road_map = log.camera(), log.trajectory(), log.road_map()
            if its_camera is None or trajectory is None or road_map is None:
                parts = (("calibration", its_camera), ("reference trajectory", trajectory), ("map", road_map))
                lacking = ", ".join(name for name, part in parts if part is None)
                raise MissingError(f"{path}: no {lacking} in the log", "training needs all three")
            camera = camera or its_camera
            _check_same(camera, its_camera, path)
            for stamp_ns, instances in segmented(log, segmenter, threshold, every):
                frames += 1
                pose = trajectory.at(stamp_ns)
                if instances is None:
                    unreadable += 1
                elif pose is None:
                    dropped[NO_POSE] += len(instances)
                elif instances:
                    labels = label(instances, camera, pose, road_map, max_distance_m)
                    measured = measure(instances, camera.width_px, camera.height_px, names)
                    dropped.update(each.reason for each in labels if each.distance_m is None)
                    known = np.array([each.distance_m is not None for each in labels])
                    dropped[TOO_SMALL] += int((known & measured.too_small).sum())
                    kept = np.flatnonzero(known & ~measured.too_small)
                    tables.append(measured.rows(kept))
                    for k in kept.tolist():
                        each, name = labels[k], instances[k].landmark_class
                        rows.append((each.distance_m or 0.0, each.landmark_id, stamp_ns, name))
                if on_frame is not None:
                    on_frame(frames, len(rows))
    if camera is None or not rows:
        reasons = "; ".join(f"{count} × {reason}" for reason, count in dropped.items() if count)
        hint = reasons or "the segmenter found nothing"
        raise InputError(f"no labelled instance in {frames} frames, {unreadable} of them unreadable", hint)
    distances, ids, stamps, classes = zip(*rows, strict=True)
    features = Features(
        tables[0].names,
        np.concatenate([table.values for table in tables]),
        np.concatenate([table.cut for table in tables]),
        np.concatenate([table.too_small for table in tables]),
    )
    return Samples(
        features,
        np.array(distances),
        np.array(ids),
        np.array(stamps, dtype=np.int64),
        camera,
        frames,
        unreadable,
        {reason: count for reason, count in dropped.most_common() if count},
        np.array(classes),
    )


def segmented(
    log: DriveLog, segmenter: str, threshold: float, every: int
) -> Iterator[tuple[int, Sequence[Instance] | None]]:
    """Stamp and instances of every ``every``-th frame; None for an image that cannot be decoded.

    ``segmenter``, ``threshold``: as ``gather`` takes them.
    """
    if segmenter == RECORDED:
        found = log.instances()
        for stamp_ns in sorted(found)[::every]:
            yield stamp_ns, found[stamp_ns]
        return
    from scpf.models.segmentation import load
    from scpf.replay.frames import decode

    segment = load(segmenter, threads=1, threshold=threshold)
    for index, picture in enumerate(log.images()):
        if index % every:
            continue
        try:
            image = decode(picture.data, f"{log.path}: frame {index}")
        except InputError:
            yield picture.stamp_ns, None
            continue
        yield picture.stamp_ns, segment(image)


def _check_same(camera: Camera, other: Camera, path: Path) -> None:
    same_size = (camera.width_px, camera.height_px) == (other.width_px, other.height_px)
    if not (same_size and np.allclose(camera.matrix, other.matrix, rtol=0.01, atol=1.0)):
        raise InputError(
            f"{path}: another camera than that of the first log", "train one model for each camera"
        )


def train(
    samples: Samples, settings: DistanceSettings, seed: int, notes: Mapping[str, str] | None = None
) -> DistanceModel:
    """The model of all samples; ``notes`` say where they come from. InputError where they are of several classes."""
    camera, classes = samples.camera, np.unique(samples.landmark_classes).tolist()
    if len(classes) != 1:
        raise InputError(f"samples of {len(classes)} landmark classes: {classes}", "train one model for each")
    about = TrainedOn(classes[0], camera.width_px, camera.height_px, camera.matrix, dict(notes or {}))
    return fit(samples.features, samples.distances_m, settings, seed, about)


def cross_fit(
    samples: Samples, model: DistanceModel, settings: DistanceSettings, seed: int, folds: int = 10
) -> CrossFittedDistance:
    """``model``, and a prediction of every sample by a model that never saw its pole.

    The poles are dealt into ``folds`` parts of like many samples (one pole each where there are fewer); the samples of
    a part are predicted by a model that is trained on all others, gate and hyperparameters fitted anew, beginning at
    those of ``model``. Raises InputError where a part leaves too few samples to train on.
    """
    poles, counts = np.unique(samples.landmark_ids, return_counts=True)
    dealt = {pole: k % folds for k, pole in enumerate(poles[np.argsort(-counts, kind="stable")])}
    part_of = np.array([dealt[pole] for pole in samples.landmark_ids])
    n = len(samples)
    mean, variance, function = np.full((3, n), np.nan)
    expert, in_range = np.zeros(n, dtype=np.intp), np.zeros(n, dtype=np.bool_)
    for part in range(max(part_of) + 1):
        mine, others = np.flatnonzero(part_of == part), np.flatnonzero(part_of != part)
        if len(others) < 2 * MIN_SAMPLES:
            raise InputError(
                f"without {len(np.unique(samples.landmark_ids[mine]))} of {len(poles)} poles, {len(others)} "
                f"samples of {n} are left to train on",
                "take a longer drive, or a lower --threshold",
            )
        rest = samples.rows(others)
        fitted = fit(rest.features, rest.distances_m, settings, seed, model.trained_on, start=model)
        found = fitted.predict_features(samples.features.rows(mine))
        mean[mine], variance[mine] = found.mean_m, found.variance_m2
        function[mine], in_range[mine] = found.function_variance_m2, found.in_range
        # A part may leave a single expert; what answered is then called by the first expert's name.
        expert[mine] = np.minimum(found.expert, len(model.names) - 1)
    boxes = samples.features.columns(BOX)
    return CrossFittedDistance(
        model, samples.stamps_ns, boxes, Predictions(mean, variance, function, expert, in_range)
    )
