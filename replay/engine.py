"""The engine: a drive log through the pipeline, every step into the recording and the results."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from threadpoolctl import threadpool_limits

from scpf.ingest.drive_log import DriveLog
from scpf.models.errors import InputError
from scpf.models.road_map import to_geojson
from scpf.replay.about import about
from scpf.replay.ahead import Ahead
from scpf.replay.controls import Controls
from scpf.replay.drive import Drive, configuration
from scpf.replay.frames import Window, expected_frames, first_state, read_frames
from scpf.replay.outputs import Outputs
from scpf.replay.pace import FULL_SPEED, Pace, PaceSettings
from scpf.replay.pipeline import Pipeline, Segment
from scpf.replay.recording import Recording
from scpf.replay.recording_images import SharedImages
from scpf.replay.rehearsal import rehearse
from scpf.replay.remarks import Remarks
from scpf.replay.results import Results
from scpf.replay.segmenters import RECORDED, build, reads_pixels
from scpf.replay.settings import Settings
from scpf.replay.step import Step
from scpf.replay.surface_terms import term_names

Images = Literal["embed", "separate", "none"]


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

    ``on_step(step, done, total)`` is called after every frame; ``total`` is about how many there will be. The recording
    is a function of log, settings and version alone, unless ``record_timing`` adds what each stage took. ``images``
    says where the pictures go: into it, into a file beside it that other runs of the log share, or nowhere. At a live
    ``pace`` that drops frames, the recording depends on the machine too. ``controls`` may pause it, and end it before
    the last frame.
    """
    # Matrices of a step are small: a second BLAS thread costs ten times what it saves.
    with threadpool_limits(1, "blas"), DriveLog(log_path) as log, ExitStack() as files:
        drive = Drive.of(log, settings)
        configured = configuration(log, drive, settings, window, pace)
        rehearse(settings, drive)
        remarks = Remarks(drive.warnings(), None if drive.model is None else drive.model.landmark_classes)
        controls = controls or Controls()
        clock = Pace(pace, sleep=controls.sleep)
        controls.govern(clock)
        ahead = Ahead(_segmenter(settings), depth=clock.frames_ahead)
        pipeline = Pipeline(settings, ahead, drive.model, drive.camera, drive.road_map)
        frames = read_frames(
            log,
            drive.trajectory,
            settings.gps,
            settings.seed,
            window,
            recorded=settings.segmenter == RECORDED,
            pixels=reads_pixels(settings.segmenter),
        )
        shared: SharedImages | None = None
        if images == "separate":
            shared = SharedImages.of(outputs.recording.parent, log_path, configured["log_sha256"], window)
            shared.write_unless_there(log, window)
        recording = files.enter_context(
            Recording(
                outputs.recording,
                name=outputs.recording.stem,
                camera=drive.camera,
                road_map=drive.road_map,
                about_markdown=about(log_path.name, configured),
                settings={"configuration": json.dumps(configured)},
                images=images == "embed",
                identity=shared.identity if shared else "",
                terms=term_names(settings) if settings.surface.terms else (),
            )
        )
        geojson = None if drive.road_map is None else to_geojson(drive.road_map)
        results = files.enter_context(Results(outputs.results, configured, geojson))

        total = expected_frames(log, window)
        done, begun, first_ns = 0, 0.0, 0
        for frame in files.enter_context(closing(ahead.frames(clock.frames(frames)))):
            if not pipeline.started:
                first = first_state(frame, drive.trajectory)
                if first is not None:
                    pipeline.start(first)
            step = pipeline.step(frame)
            step = remarks.noted(replace(step, timing_s={**step.timing_s, "segmentation": ahead.seconds}))
            recording.log(step if record_timing else replace(step, timing_s={}))
            results.log(step)
            clock.finished(frame)
            done += 1
            if done == 1:
                # The first frame pays for loading the network: the rate counts from its end.
                begun, first_ns = time.perf_counter() - controls.waited_s, frame.stamp_ns
            on_step(step, done, total)
            if not controls.goes_on():
                remarks.warn(f"ended by a key after {done} of {total} frames")
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
    remarks.count(
        "frame before a reference pose or GPS fix says where the drive begins",
        summary["states"].get("initialising", 0),
    )
    remarks.count("frame dropped, as it came too late", clock.dropped)
    summary["warnings"] = remarks.all()
    outputs.write_summary(summary)
    return summary


def _segmenter(settings: Settings) -> Segment:
    return build(
        settings.segmenter,
        settings.score_threshold,
        settings.bfloat16,
        settings.device,
        settings.checkpoint,
    )
