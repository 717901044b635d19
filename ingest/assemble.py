"""Putting a drive log together: images with times, a reference trajectory, a calibration and a map."""

from __future__ import annotations

import hashlib
import heapq
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.assembly_report import SHOWN, AssemblyReport
from scpf.ingest.calibration import to_yaml
from scpf.ingest.drive_log import (
    CALIBRATION_ATTACHMENT,
    MAP_ATTACHMENT,
    SCPF_METADATA,
    DriveLogWriter,
    library_name,
)
from scpf.ingest.maps import encode_map
from scpf.ingest.pictures import Encoded, Picture
from scpf.ingest.reference import Reference
from scpf.models.camera import Camera
from scpf.models.errors import InputError
from scpf.models.geodesy import Origin
from scpf.models.road_map import RoadMap
from scpf.models.trajectory import MAX_GAP_NS, Trajectory

Stamps = NDArray[np.int64]
Event = int | Callable[[], None]
"""Index of an image, or what writes a message of the reference."""

GAP_FACTOR: Final = 1.5
"""An interval this many times the median one is a gap: a frame or more is missing."""


def assemble(
    output: Path,
    images: Sequence[Picture],
    stamps_ns: Stamps,
    camera: Camera,
    *,
    reference: Reference | None = None,
    road_map: RoadMap | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    sources: Sequence[Path] = (),
    found: AssemblyReport | None = None,
    drop_duplicates: bool = False,
    overwrite: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> AssemblyReport:
    """Write the drive log ``output`` and say what went into it.

    ``stamps_ns`` (N,) belongs to ``images`` (N). ``start_s`` and ``end_s`` keep a part of the drive, in seconds
    after the first image (asked for, hence not a loss). Images that cannot be read are dropped and counted; those
    that repeat the one before are counted, and left out with ``drop_duplicates``. ``found``: a report that already
    holds what was noticed or dropped while the images were listed.
    ``sources`` are recorded with their SHA-256. Raises InputError, among others where images and trajectory
    share no time, which is a mistaken clock.
    """
    if len(images) != len(stamps_ns):
        raise InputError(f"{len(images)} images and {len(stamps_ns)} times")
    if (images[0].width_px, images[0].height_px) != (camera.width_px, camera.height_px):
        size = f"{images[0].width_px}×{images[0].height_px}"
        text = f"the images have {size} px, the calibration is for {camera.width_px}×{camera.height_px} px"
        raise InputError(text, "is this the calibration of these images?")
    first_ns = int(stamps_ns[0])
    low = first_ns if start_s is None else first_ns + round(start_s * 1e9)
    high = int(stamps_ns[-1]) if end_s is None else first_ns + round(end_s * 1e9)
    chosen = [k for k, stamp in enumerate(stamps_ns) if low <= stamp <= high]
    if not chosen:
        raise InputError(
            f"no image lies between {start_s} and {end_s} s", f"the drive lasts {_span(stamps_ns):.3f} s"
        )
    report = found or AssemblyReport(str(output))
    if reference is not None:
        report.overlap_s = _overlap_s(stamps_ns[chosen], reference.trajectory)

    origin = road_map.origin if road_map is not None else None
    if origin is None and reference is not None:
        origin = reference.origin
    with DriveLogWriter(output, overwrite=overwrite, origin=origin) as log:
        log.write_camera(int(stamps_ns[chosen[0]]), camera)
        _attach(log, camera, road_map, report)
        kept = _write_all(
            log,
            images,
            stamps_ns,
            chosen,
            reference,
            report,
            drop_duplicates,
            progress,
        )
        _describe(report, stamps_ns[kept], reference.trajectory if reference is not None else None)
        log.metadata(SCPF_METADATA, _provenance(report, sources, origin))
    return report


def assemble_reference(
    output: Path,
    reference: Reference,
    *,
    road_map: RoadMap | None = None,
    sources: Sequence[Path] = (),
    found: AssemblyReport | None = None,
    overwrite: bool = False,
) -> AssemblyReport:
    """Write a drive log without images: the whole reference, and the map where there is one."""
    report = found or AssemblyReport(str(output))
    stamps = reference.trajectory.stamps_ns
    with DriveLogWriter(output, overwrite=overwrite, origin=reference.origin) as log:
        if road_map is not None:
            _attach_map(log, road_map, report)
        for _, write in reference.writes(log, int(stamps[0]), int(stamps[-1])):
            write()
        report.poses, report.duration_s = len(stamps), _span(stamps)
        log.metadata(SCPF_METADATA, _provenance(report, sources, reference.origin))
    return report


def _write_all(
    log: DriveLogWriter,
    images: Sequence[Picture],
    stamps_ns: Stamps,
    chosen: list[int],
    reference: Reference | None,
    report: AssemblyReport,
    drop_duplicates: bool,
    progress: Callable[[int, int], None] | None,
) -> list[int]:
    """Write images and reference in the order of their times; returns the images that were written."""
    first_ns, last_ns = int(stamps_ns[chosen[0]]), int(stamps_ns[chosen[-1]])
    # A margin, so that the first and the last image still lie between two poses.
    low, high = first_ns - MAX_GAP_NS, last_ns + MAX_GAP_NS
    beside: Iterator[tuple[int, Event]] = iter(())
    if reference is not None:
        beside = reference.writes(log, low, high)
        within = (reference.trajectory.stamps_ns >= low) & (reference.trajectory.stamps_ns <= high)
        report.poses = int(within.sum())
        report.poses_left_out = len(within) - report.poses
    kept: list[int] = []
    previous = b""
    pictures: Iterator[tuple[int, Event]] = ((int(stamps_ns[k]), k) for k in chosen)
    for stamp_ns, event in heapq.merge(beside, pictures, key=lambda event: event[0]):
        if not isinstance(event, int):
            event()
            continue
        k = event
        image = _read(images[k], report)
        if image is not None:
            # The bytes say it for decoded pixels, too: equal pixels are encoded equally.
            hashed = hashlib.blake2b(image.data, digest_size=16).digest()
            if hashed == previous:
                report.duplicates += 1
                if len(report.duplicates_at_s) < SHOWN:
                    report.duplicates_at_s.append((stamp_ns - int(stamps_ns[chosen[0]])) * 1e-9)
            if hashed == previous and drop_duplicates:
                report.duplicates_left_out += 1
            else:
                log.write_image(stamp_ns, image.data, image.format)
                kept.append(k)
            previous = hashed
        if progress is not None:
            progress(len(kept), len(chosen))
    if not kept:
        raise InputError(f"none of {len(chosen)} images could be read")
    return kept


def _read(image: Picture, report: AssemblyReport) -> Encoded | None:
    try:
        return image.encoded()
    except InputError as error:
        reason = "image that could not be read"
        report.dropped[reason] = report.dropped.get(reason, 0) + 1
        if report.dropped[reason] <= SHOWN:
            report.notes.append(error.message)
        return None


def _attach(log: DriveLogWriter, camera: Camera, road_map: RoadMap | None, report: AssemblyReport) -> None:
    log.attach(CALIBRATION_ATTACHMENT, "application/yaml", to_yaml(camera))
    if road_map is not None:
        _attach_map(log, road_map, report)


def _attach_map(log: DriveLogWriter, road_map: RoadMap, report: AssemblyReport) -> None:
    log.attach(MAP_ATTACHMENT, "application/geo+json", encode_map(road_map))
    report.landmarks = len(road_map.landmarks)


def _describe(report: AssemblyReport, stamps_ns: Stamps, trajectory: Trajectory | None) -> None:
    intervals = np.diff(stamps_ns) * 1e-9
    report.frames = len(stamps_ns)
    report.duration_s = _span(stamps_ns)
    if len(intervals):
        report.median_interval_s = float(np.median(intervals))
        for k in np.flatnonzero(intervals >= GAP_FACTOR * report.median_interval_s):
            report.gaps.append((float(stamps_ns[k] - stamps_ns[0]) * 1e-9, float(intervals[k])))
    if trajectory is None:
        report.frames_without_pose = len(stamps_ns)
    else:
        report.frames_without_pose = sum(trajectory.at(int(stamp)) is None for stamp in stamps_ns)


def _overlap_s(stamps_ns: Stamps, trajectory: Trajectory) -> float:
    low = max(int(stamps_ns[0]), int(trajectory.stamps_ns[0]))
    high = min(int(stamps_ns[-1]), int(trajectory.stamps_ns[-1]))
    if high < low:
        begin = (int(trajectory.stamps_ns[0]) - int(stamps_ns[0])) * 1e-9
        text = (
            f"images and trajectory share no time: the trajectory begins {begin:+.3f} s after the first image"
        )
        raise InputError(text, "are both clocks UTC?")
    return (high - low) * 1e-9


def _span(stamps_ns: Stamps) -> float:
    return float(int(stamps_ns[-1]) - int(stamps_ns[0])) * 1e-9


def _provenance(report: AssemblyReport, sources: Sequence[Path], origin: Origin | None) -> dict[str, str]:
    """The metadata record: how the log was made, of what, and what was left out."""
    import platform
    from importlib.metadata import version

    versions = {name: version(name) for name in ("scpf", "mcap", "numpy", "rosbags")}
    values: dict[str, Any] = {
        "made_by": library_name(),
        "made_from": {path.name: sha256(path) for path in sources},
        "versions": {**versions, "python": platform.python_version()},
        "origin": None if origin is None else list(origin),
        "dropped": report.dropped,
        "report": asdict(report),
    }
    return {name: value if isinstance(value, str) else json.dumps(value) for name, value in values.items()}


def sha256(path: Path) -> str:
    """The SHA-256 of a file; of a folder, that of the names and hashes of its files, sorted by name."""
    digest = hashlib.sha256()
    if path.is_dir():
        for child in sorted(entry for entry in path.iterdir() if entry.is_file()):
            digest.update(f"{child.name} {sha256(child)}\n".encode())
        return digest.hexdigest()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()
