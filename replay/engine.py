"""The engine: a drive log through the pipeline, every step into the recording and the results."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from importlib.metadata import version
from math import isinf
from pathlib import Path
from typing import Any, Literal

from threadpoolctl import threadpool_limits

from scpf.ingest.assemble import sha256
from scpf.ingest.drive_log import DriveLog
from scpf.ingest.topics import IMAGE_TOPIC
from scpf.models.errors import InputError
from scpf.models.road_map import RoadMap, to_geojson
from scpf.replay import distance_models
from scpf.replay.about import about
from scpf.replay.ahead import Ahead
from scpf.replay.controls import Controls
from scpf.replay.frames import Window, first_state, read_frames
from scpf.replay.pace import FULL_SPEED, Pace, PaceSettings
from scpf.replay.pipeline import DistanceSource, Pipeline
from scpf.replay.recording import Recording
from scpf.replay.recording_images import SharedImages
from scpf.replay.results import Results
from scpf.replay.segmenters import RECORDED, build, reads_pixels
from scpf.replay.settings import Settings
from scpf.replay.step import Step
from scpf.replay.surface_terms import term_names

Images = Literal["embed", "separate", "none"]

REPORTED_PACKAGES = ("scpf", "numpy", "scipy", "opencv-python-headless", "torch", "rerun-sdk", "mcap")


@dataclass(frozen=True)
class Outputs:
    """The files that a replay leaves: ``NAME.rrd``, ``NAME.results.mcap`` and ``NAME.json``."""

    recording: Path
    results: Path
    summary: Path

    @staticmethod
    def of(directory: Path, name: str) -> Outputs:
        """The three paths for ``name`` in ``directory``."""
        return Outputs(
            directory / f"{name}.rrd", directory / f"{name}.results.mcap", directory / f"{name}.json"
        )

    def refuse_existing(self) -> None:
        """Raise InputError where one of the files is there already."""
        for path in (self.recording, self.results, self.summary):
            if path.exists():
                raise InputError(f"{path} exists", "use --overwrite, or another --output or --name")


def replay(
    log_path: Path,
    outputs: Outputs,
    settings: Settings,
    window: Window,
    on_step: Callable[[Step, int, int], None],
    *,
    record_timing: bool = False,
    images: Images = "embed",
    pace: PaceSettings = FULL_SPEED,
    controls: Controls | None = None,
) -> dict[str, Any]:
    """Replay one drive log; returns the summary that ``outputs.summary`` holds.

    ``on_step(step, done, total)`` is called after every frame; ``total`` counts the log's images. The recording
    is a function of log, settings and version alone, unless ``record_timing`` adds what each stage took. ``images``
    says where the pictures go: into it, into a file beside it that other runs of the log share, or nowhere. At a live
    ``pace`` that drops frames, the recording depends on the machine too.
    ``controls`` may pause it, and end it before the last frame.
    """
    # Matrices of a step are small: a second BLAS thread costs ten times what it saves.
    with threadpool_limits(1, "blas"), DriveLog(log_path) as log, ExitStack() as files:
        warnings: list[str] = []
        camera, road_map, trajectory = log.camera(), log.road_map(), log.trajectory()
        model = None if camera is None else distance_models.load(settings.distance_model, camera)
        warnings += [
            f"the log has no {what}: {consequence}"
            for missing, what, consequence in (
                (camera is None, "calibration", "no distances, no landmark constraints"),
                (road_map is None, "map", "no road and no landmark constraints"),
                (trajectory is None, "reference trajectory", "no errors"),
            )
            if missing
        ]
        warnings += _foreign_landmarks(road_map, model)
        configuration = {
            "settings": settings.as_dict(),
            "window": {
                "start_s": window.start_s,
                "stop_s": None if isinf(window.stop_s) else window.stop_s,
                "rate_hz": None if isinf(window.rate_hz) else window.rate_hz,
            },
            "pace": {"factor": None if isinf(pace.factor) else pace.factor, "late": pace.late},
            "log": log_path.name,
            "log_sha256": sha256(log_path),
            "versions": {package: version(package) for package in REPORTED_PACKAGES},
            "distance_model": dict(model.metadata) if model is not None else {},
        }
        shared: SharedImages | None = None
        if images == "separate":
            folder, digest = outputs.recording.parent, str(configuration["log_sha256"])
            shared = SharedImages.of(folder, log_path, digest, window)
            shared.write_unless_there(log, window)
        controls = controls or Controls()
        clock = Pace(pace, sleep=controls.sleep)
        controls.govern(clock)
        segment = build(
            settings.segmenter,
            settings.score_threshold,
            settings.bfloat16,
            settings.device,
            settings.checkpoint,
        )
        ahead = Ahead(segment, depth=clock.frames_ahead)
        pipeline = Pipeline(settings, ahead, model, camera, road_map)
        recorded = settings.segmenter == RECORDED
        frames = read_frames(
            log,
            trajectory,
            settings.gps,
            settings.seed,
            window,
            recorded=recorded,
            pixels=reads_pixels(settings.segmenter),
        )
        recording = files.enter_context(
            Recording(
                outputs.recording,
                name=outputs.recording.stem,
                camera=camera,
                road_map=road_map,
                about_markdown=about(log_path.name, configuration),
                settings={"configuration": json.dumps(configuration)},
                images=images == "embed",
                identity=shared.identity if shared else "",
                terms=term_names(settings) if settings.surface.terms else (),
            )
        )
        results = files.enter_context(
            Results(outputs.results, configuration, to_geojson(road_map) if road_map is not None else None)
        )
        problems: Counter[str] = Counter()
        total = log.channels[IMAGE_TOPIC].count if IMAGE_TOPIC in log.channels else 0
        done, begun, first_ns = 0, 0.0, 0
        for frame in files.enter_context(closing(ahead.frames(clock.frames(frames)))):
            if not pipeline.started:
                first = first_state(frame, trajectory)
                if first is not None:
                    pipeline.start(first)
            step = pipeline.step(frame)
            step = replace(step, timing_s={**step.timing_s, "segmentation": ahead.seconds})
            met = [*frame.problems, *_foreign_instances(step, model)]
            if met:
                problems.update(kind for kind, _ in met)
                told = tuple(("WARN", f"{kind}: {particulars}") for kind, particulars in met)
                step = replace(step, notes=(*step.notes, *told))
            if not done and warnings:
                step = replace(step, notes=(*step.notes, *(("WARN", text) for text in warnings)))
            recording.log(step if record_timing else replace(step, timing_s={}))
            results.log(step)
            clock.finished(frame)
            done += 1
            if done == 1:
                # The first frame pays for loading the network: the rate counts from its end.
                begun, first_ns = time.perf_counter() - controls.waited_s, frame.stamp_ns
            on_step(step, done, total)
            if not controls.goes_on():
                warnings.append(f"ended by a key after {done} of {total} images")
                break
            ahead.depth = clock.frames_ahead
        if not done:
            raise InputError(f"{log_path}: no image between {window.start_s} s and {window.stop_s} s")
        elapsed_s = max(time.perf_counter() - controls.waited_s - begun, 1e-9)
        summary = results.summary()
        if shared:
            summary["images"] = shared.path.name
        summary["rate"] = {
            "frames_per_s": (done - 1) / elapsed_s,
            "real_time_factor": (frame.stamp_ns - first_ns) * 1e-9 / elapsed_s,
            **clock.report(),
        }
    unlocated = summary["states"].get("initialising", 0)
    if unlocated:
        problems["frame before a reference pose or GPS fix says where the drive begins"] = unlocated
    if clock.dropped:
        problems["frame dropped, as it came too late"] = clock.dropped
    summary["warnings"] = warnings + [f"{count} × {kind}" for kind, count in problems.items()]
    partial = outputs.summary.with_name(outputs.summary.name + ".partial")
    partial.write_text(json.dumps(summary, indent=1, allow_nan=False) + "\n")
    partial.replace(outputs.summary)
    return summary


def _foreign_landmarks(road_map: RoadMap | None, model: DistanceSource | None) -> list[str]:
    """A warning for each class of the map's landmarks whose distance nothing predicts."""
    if road_map is None or model is None:
        return []
    foreign = Counter(mark.landmark_class for mark in road_map.landmarks)
    return [
        f"the map has {count} landmarks of class {name!r}, which the distance model does not know:"
        " they constrain nothing"
        for name, count in foreign.items()
        if name not in model.landmark_classes
    ]


def _foreign_instances(step: Step, model: DistanceSource | None) -> list[tuple[str, str]]:
    """A problem for each instance of a class whose distance nothing predicts: its kind, and the particulars."""
    if model is None:
        return []
    return [
        (
            f"instance of unknown landmark class {instance.landmark_class!r}",
            "the distance model was not trained on it",
        )
        for instance in step.unmeasured
        if instance.landmark_class not in model.landmark_classes
    ]
